"""The arrays of an episode's series: the actions in them, and a digest of them."""

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.types import Floats

Series = Mapping[str, NDArray[Any]]


def actions_of(series: Series) -> Floats:
    """The actions since the release, `T x a`."""
    actions = series["actions"]
    released = int(np.searchsorted(series["time_s"], series["released_s"]))
    return actions[released + 1 :]


def trajectory_digest(series: Series) -> str:
    """SHA-256 over the names, types, shapes and bytes of all arrays, however they were compressed."""
    digest = hashlib.sha256()
    for name in sorted(series):
        array = np.ascontiguousarray(series[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
