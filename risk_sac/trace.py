"""The full time series of one episode, kept while it runs and written only if the ego touched something."""

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from risk_sac.types import Bools, Floats, Frame

PER_ACTOR = ("x_m", "y_m", "heading_rad", "speed_mps", "lateral_mps", "accel_mps2")
PER_OTHER = ("distance_m", "ttc_s", "rss_longitudinal_m", "rss_lateral_m", "visible")


@dataclass(slots=True)
class Trace:
    """What every step appends; arrays are built only by `series`."""

    requirements: tuple[str, ...]
    frames: list[Frame] = field(default_factory=list)
    others: list[tuple[Floats | Bools, ...]] = field(default_factory=list)  # of PER_OTHER, each without the ego
    robustness: list[Floats] = field(default_factory=list)
    soft_min: list[float] = field(default_factory=list)
    least_ttc_s: list[float] = field(default_factory=list)  # over the actors the ego answers for
    actions: list[NDArray[np.float32]] = field(default_factory=list)  # one fewer than frames

    def series(self) -> dict[str, NDArray[np.generic]]:
        """Arrays by name: `T` frames, `n` actors of the first frame, NaN where one has left.

        `actions` is `T x a`, the action that led to the frame; NaN in the first.
        """
        first = self.frames[0]
        column = {id_: i for i, id_ in enumerate(first.ids)}
        steps, n = len(self.frames), len(first.ids)
        result: dict[str, NDArray[np.generic]] = {
            "time_s": np.array([frame.time_s for frame in self.frames]),
            "ids": np.array(first.ids),
            "kind": first.kind,
            "role": first.role,
            "length_m": first.length_m,
            "width_m": first.width_m,
            "requirements": np.array(self.requirements),
            "robustness": np.array(self.robustness),
            "soft_min": np.array(self.soft_min),
            "least_ttc_s": np.array(self.least_ttc_s),
            "signal": np.array([frame.signal for frame in self.frames], dtype=np.int8),
        }
        columns = [[column[id_] for id_ in frame.ids] for frame in self.frames]
        for name in PER_ACTOR:
            values = np.full((steps, n), np.nan)
            for t, frame in enumerate(self.frames):
                values[t, columns[t]] = getattr(frame, name)
            result[name] = values
        for k, name in enumerate(PER_OTHER):
            values = np.full((steps, n), np.nan)
            for t, arrays in enumerate(self.others):
                values[t, columns[t][1:]] = arrays[k]
            result[name] = values
        size = len(self.actions[0]) if self.actions else 0
        result["actions"] = np.vstack((np.full((1, size), np.nan, dtype=np.float32), *self.actions))
        return result


def write_series(path: Path, series: dict[str, NDArray[np.generic]]) -> None:
    """Writes an .npz that is either complete or absent.

    Raises:
      OSError: the disk is full or the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".partial")
    with temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **series)
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def read_series(path: Path) -> dict[str, NDArray[np.generic]]:
    """Reads what `write_series` wrote."""
    with np.load(path, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}
