"""Reads and writes the files in prior/weights: plain arrays with a description; nothing is unpickled."""

import hashlib
import io
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from risk_sac.errors import ConfigError

MOST_BYTES = 3_000_000  # of a file
DATA = Path(str(files("risk_sac.search.prior"))) / "weights"
Arrays = Mapping[str, NDArray[Any]]


@cache
def weights_digest() -> str:
    """Returns the beginning of the SHA-256 of all shipped files."""
    digest = hashlib.sha256()
    for path in sorted(DATA.glob("*.npz")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def write_arrays(path: Path, meta: Mapping[str, object], arrays: Arrays) -> None:
    """Writes arrays with their description."""
    described = {"meta": np.frombuffer(json.dumps(meta).encode(), np.uint8), **arrays}
    np.savez_compressed(path, **described)  # type: ignore[arg-type]  # numpy's stub takes a name for `allow_pickle`


@contextmanager
def arrays_of(path: Path) -> Iterator[tuple[dict[str, Any], Arrays]]:
    """Opens a file for reading; errors in the block, too, are taken for faults of the file.

    Raises:
      ConfigError: the file is damaged, too large, or for another layout.
    """
    if path.stat().st_size > MOST_BYTES:
        raise ConfigError("prior", f"{path.name} of {path.stat().st_size} bytes", f"at most {MOST_BYTES}")
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as arrays:
            yield json.loads(arrays["meta"].tobytes()), arrays
    except (ValueError, KeyError, TypeError, EOFError, BadZipFile) as error:
        remedy = "what `risk-sac pretrain` writes, as this version"
        raise ConfigError("prior", f"{path.name}: {error}", remedy) from error
