"""Response body of a failure, with the time series that a worker wrote."""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.errors import DamagedError
from risk_sac.records import Failure, Triage
from risk_sac.run_folder.arrays import read_limited, unpack_arrays
from risk_sac.run_folder.results import FAILURES
from risk_sac.series import Series
from risk_sac.types import Kind, Role, Signal
from service.errors import SeriesLost
from service.settings import ServiceSettings
from service.store.stored import StoredFailure

_NAMED = {"kind": Kind, "role": Role, "signal": Signal}


def failure_body(campaign_id: str, failure: StoredFailure, triage: Triage | None, settings: ServiceSettings) -> Failure:
    """Returns a failure with its time series, or the reason for none, and its triage."""
    series, problem = None, None
    try:
        series = load_series(*series_file(campaign_id, failure, settings))
    except SeriesLost as error:
        problem = str(error)
    return Failure(**dict(failure.episode), series=series, series_problem=problem, triage=triage)


def series_file(campaign_id: str, failure: StoredFailure, settings: ServiceSettings) -> tuple[Path, str | None]:
    """Returns path and SHA-256 of a failure's time series; SeriesLost if none was recorded."""
    if failure.series is None:
        raise SeriesLost("no time series was recorded")
    folder = settings.run_folder(campaign_id, failure.episode.run_id) / FAILURES
    return folder / failure.series, failure.series_sha256


def load_series(path: Path, sha256: str | None) -> Series:
    """The series as a body; raises what `load_arrays` does, also for arrays that are no series."""
    arrays = load_arrays(path, sha256)
    try:
        return series_body(arrays)
    except (ValueError, TypeError, OverflowError) as error:  # pydantic's, too
        raise SeriesLost(f"the time series {path.name!r} is damaged: {str(error).partition(chr(10))[0]}") from error


def series_body(arrays: Mapping[str, NDArray[Any]]) -> Series:
    """Returns the public arrays as a body; numbers that are not finite are None."""
    told = arrays.keys() & Series.model_fields.keys()
    return Series.model_validate({name: _plain(name, arrays[name]) for name in told})


def load_arrays(path: Path, sha256: str | None) -> dict[str, NDArray[Any]]:
    """The series as its worker wrote it, an .npz of arrays.

    Args:
      path: the file.
      sha256: of its content, as its worker told; None: not checked.

    Raises:
      SeriesLost: the file is missing, too large, not the one that was written, or lacks an array.
    """
    try:
        content = read_limited(path)
        _verify(path, content, sha256)
        arrays = unpack_arrays(content)
        names = (name for name, field in Series.model_fields.items() if field.is_required() or name in arrays)
        return {name: arrays[name] for name in names}
    except FileNotFoundError as error:
        raise SeriesLost(f"the time series {path.name!r} is gone") from error
    except (OSError, KeyError, DamagedError) as error:
        raise SeriesLost(f"the time series {path.name!r} is damaged: {error}") from error


def _verify(path: Path, content: bytes, sha256: str | None) -> None:
    actual = hashlib.sha256(content).hexdigest()
    if sha256 is not None and actual != sha256:
        raise SeriesLost(f"the time series {path.name!r} is damaged: its SHA-256 is {actual}, wanted {sha256}")


def _letter(value: float | str) -> str | None:
    """SUMO's letter of a signal, which may be written as its number."""
    if isinstance(value, str):
        return value or None
    return chr(int(value)) if value > 0 else None


def _plain(name: str, array: NDArray[Any]) -> Any:
    if name == "link":
        return [[_letter(each) for each in row] for row in array.tolist()]
    if name in _NAMED:
        return [_NAMED[name](int(value)).name.lower() for value in array]
    if array.dtype.kind == "f":
        missing = ~np.isfinite(array)
        array = array.astype(object)
        array[missing] = None
    return array.tolist()
