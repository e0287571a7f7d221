"""A failure and its time series, with times relative to its violation."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.records import Collision, Violation
from risk_sac.run_folder.results import RecordedFailure
from risk_sac.world.types import Floats

Series = Mapping[str, NDArray[Any]]
BOX = [(1, 1), (-1, 1), (-1, -1), (1, -1)]  # corners of a body


def on_body(pose: Sequence[float], size_m: tuple[float, float], corners: Sequence[tuple[float, float]]) -> Floats:
    """Returns places on a body; corners: half lengths ahead, half widths left."""
    x, y, heading = pose
    cos, sin = np.cos(heading), np.sin(heading)
    placed: Floats = np.array(corners) * (np.array(size_m) / 2) @ np.array([(cos, sin), (-sin, cos)]) + (x, y)
    return placed


def actions_of(series: Series) -> Floats:
    """The actions since the release, `T x a`."""
    actions = series["actions"]
    released = int(np.searchsorted(series["time_s"], series["released_s"]))
    return actions[released + 1 :]


def trajectory_digest(series: Series) -> str:
    """Returns SHA-256 over all arrays' names, types, shapes and uncompressed bytes."""
    digest = hashlib.sha256()
    for name in sorted(series):
        array = np.ascontiguousarray(series[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class Recording:
    """Time series of a failure or its twin, timed from the violation."""

    failure: RecordedFailure
    series: Mapping[str, NDArray[np.generic]]
    twin: str = ""  # what is different, where the series is not the failure's own but that of its episode's twin

    @property
    def violation(self) -> Collision | Violation:
        """The violation that names the failure."""
        assert self.failure.episode.worst_violation is not None  # that is what makes an episode a failure
        return self.failure.episode.worst_violation

    @property
    def collision(self) -> Collision | None:
        """The contact, if that names the failure."""
        return self.violation if isinstance(self.violation, Collision) else None

    @cached_property
    def time_s(self) -> Floats:
        """`T`, negative before the violation."""
        time: Floats = self["time_s"] - float(self["released_s"]) - self.violation.time_s
        return time

    @property
    def released_s(self) -> float:
        """Time of the adversaries' release."""
        return -self.violation.time_s

    @property
    def conflict_s(self) -> float | None:
        """Time when the conflict began; None where it is not recorded.

        It is not in a twin, without a contact, or if it began before the recording.
        """
        if self.twin or self.collision is None:
            return None
        began_s = self.collision.judgement.conflict_s - self.collision.time_s
        return began_s if began_s >= self.time_s[0] else None

    @cached_property
    def other(self) -> int | None:
        """Column of the touched or most relevant actor (ego: 0), or None."""
        other = self.violation.other_id
        return None if other is None else [str(id_) for id_ in self.series["ids"]].index(other)

    @property
    def moment(self) -> str:
        """Names the event at time 0."""
        return "contact" if self.collision else f"{self.violation.requirement} violated"

    @property
    def involved(self) -> tuple[int, ...]:
        """Columns of the ego and of that actor."""
        return (0,) if self.other is None else (0, self.other)

    def __getitem__(self, name: str) -> Floats:
        return np.asarray(self.series[name], dtype=np.float64)

    def pose(self, actor: int, time_s: float) -> tuple[float, float, float]:
        """Returns centre and heading at a time, interpolated between two frames."""
        x, y, heading = (self[name][:, actor] for name in ("x_m", "y_m", "heading_rad"))
        at = (float(np.interp(time_s, self.time_s, values)) for values in (x, y, np.unwrap(heading)))
        return next(at), next(at), next(at)

    def hidden(self) -> Iterator[tuple[float, float]]:
        """Yields spans in which the ego does not see the other."""
        if self.other is None:
            return
        unseen = np.concatenate(([False], self["visible"][:, self.other] == 0, [False]))
        edges = np.flatnonzero(unseen[1:] != unseen[:-1])
        for start, end in edges.reshape(-1, 2):
            yield self.time_s[start], self.time_s[min(end, len(self.time_s) - 1)]
