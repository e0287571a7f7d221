"""Full time series of a contact, from the file its worker wrote."""

import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.types import Kind, Role, Signal
from service.errors import StorageError
from service.schemas import Series

_NAMED = {"kind": Kind, "role": Role, "signal": Signal}


def load_series(path: Path) -> Series:
    """Read an .npz of arrays; numbers that are not finite become None.

    Raises:
      StorageError: the file is missing, damaged, or lacks an array.
    """
    try:
        # Opened here: numpy leaves a file open that it opened itself and found damaged.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return Series.model_validate({name: _plain(name, arrays[name]) for name in Series.model_fields})
    except FileNotFoundError as error:
        raise StorageError(f"the time series {path.name!r} is gone") from error
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise StorageError(f"the time series {path.name!r} is damaged: {error}") from error


def _plain(name: str, array: NDArray[Any]) -> list[Any]:
    if name in _NAMED:
        return [_NAMED[name](int(value)).name.lower() for value in array]
    if array.dtype.kind == "f":
        missing = ~np.isfinite(array)
        array = array.astype(object)
        array[missing] = None
    values: list[Any] = array.tolist()
    return values
