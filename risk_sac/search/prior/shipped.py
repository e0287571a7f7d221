"""The prior of a pattern: what was trained on its shipped family.

prior/weights/<family>.npz   plain arrays; README.md says how they were made
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from risk_sac.scenario.families import FAMILIES
from risk_sac.search.prior.files import DATA, arrays_of, write_arrays
from risk_sac.search.prior.script_model import ScriptModel
from risk_sac.search.scripts import SIZE
from risk_sac.world.types import Floats

GRID = 65535  # of points in files


@dataclass(frozen=True, slots=True)
class Prior:
    """What was trained on a shipped family; its points are in the unit cube of that family's space, genes behind."""

    family: str
    model: ScriptModel
    library: Floats  # n x inputs; points that led to failures
    library_kinds: tuple[str, ...]  # n, names of variants
    card: Mapping[str, object]


def write_prior(path: Path, prior: Prior) -> None:
    """Writes a prior as plain arrays."""
    names = {"kinds": prior.model.kinds, "egos": prior.model.egos, "library_kinds": prior.library_kinds}
    meta = {"family": prior.family, **names, **prior.card}
    library = np.round(prior.library * GRID).astype(np.uint16)
    write_arrays(path, meta, {"library": library, **prior.model.arrays()})


def read_prior(path: Path) -> Prior:
    """Reads what `write_prior` wrote; nothing is unpickled.

    Raises:
      ConfigError: the file is damaged, too large, or for scenes and scripts of another layout.
    """
    with arrays_of(path) as (meta, arrays):
        library = arrays["library"].astype(np.float64) / GRID
        model = ScriptModel.from_arrays(arrays, tuple(meta.pop("kinds")), tuple(meta.pop("egos")))
        family, kinds = meta.pop("family"), tuple(meta.pop("library_kinds"))
        wanted = inputs_of(family)
        if library.shape != (len(kinds), wanted) or model.inputs != wanted:
            raise ValueError(f"points of {model.inputs} and {library.shape[1:]} numbers, not {wanted}")
    return Prior(family, model, library, kinds, meta)


def inputs_of(family: str) -> int:
    """Numbers of a point of a shipped family: scene parameters, then genes."""
    shipped = FAMILIES[family]
    return shipped.space.dimension + SIZE * len(shipped.adversaries)


@cache
def shipped_prior(family: str) -> Prior:
    """Returns the prior of a shipped family."""
    return read_prior(DATA / f"{family}.npz")
