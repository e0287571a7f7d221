"""Reads untrusted .npz files of plain arrays in bounded memory, executing nothing."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.errors import DamagedError

# A full series of dense has 23 arrays, 5 MB and 0.6 million values. As text of an answer a value takes some 100 bytes.
MOST_ARRAYS, MOST_BYTES, MOST_VALUES = 64, 2**25, 2**21
PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
KINDS = "biufU"  # of numpy's types: booleans, integers, floats and text


def read_series(path: Path) -> dict[str, NDArray[Any]]:
    """Reads the time series that `write_series` wrote.

    Raises:
      DamagedError: as of `unpack_arrays`; it names the file.
      OSError: it cannot be read.
    """
    try:
        return unpack_arrays(read_limited(path))
    except DamagedError as error:
        raise DamagedError(f"{path} is damaged: {error}") from error


def read_limited(path: Path) -> bytes:
    """Reads a file up to `MOST_BYTES` + 1, which `unpack_arrays` refuses."""
    with path.open("rb") as file:
        return file.read(MOST_BYTES + 1)


def unpack_arrays(content: bytes, most_values: int = MOST_VALUES) -> dict[str, NDArray[Any]]:
    """Unpacks the arrays of a file's content.

    Raises:
      DamagedError: it is no .npz, holds something else than plain arrays, or more than the limits.
    """
    try:
        arrays = _unpack(content)
    except Exception as error:  # what zipfile, zlib and numpy raise of bytes that mean nothing is an open set
        raise DamagedError(str(error)) from error
    if (values := sum(array.size for array in arrays.values())) > most_values:
        raise DamagedError(f"it holds {values} values; wanted at most {most_values}")
    return arrays


def _unpack(content: bytes) -> dict[str, NDArray[Any]]:
    if len(content) > MOST_BYTES:
        raise ValueError(f"it is larger than {MOST_BYTES} bytes")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = archive.infolist()
    size = sum(entry.file_size for entry in entries)
    if len(entries) > MOST_ARRAYS or size > MOST_BYTES:
        raise ValueError(f"{len(entries)} arrays of {size} bytes; wanted at most {MOST_ARRAYS}, of {MOST_BYTES} bytes")
    for entry in entries:
        if entry.compress_type not in PACKED:  # the others are unpacked whole, whatever size they say
            raise ValueError(f"{entry.filename} is packed in another way than `numpy.savez` packs")
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        arrays = dict(file)
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray):
            raise ValueError(f"{name} is no array")
        if array.dtype.kind not in KINDS:
            raise ValueError(f"{name} holds {array.dtype}; wanted numbers or text")
    return arrays
