"""A contact and its time series, with time counted from the contact."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.records import Collision
from risk_sac.run_folder.results import Contact
from risk_sac.types import Floats

Series = Mapping[str, NDArray[Any]]
BOX = [(1, 1), (-1, 1), (-1, -1), (1, -1)]  # corners of a body


def on_body(pose: Sequence[float], size_m: tuple[float, float], corners: Sequence[tuple[float, float]]) -> Floats:
    """Returns places on a body; its corners are in half lengths ahead and half widths to the left."""
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
    """SHA-256 over the names, types, shapes and bytes of all arrays, however they were compressed."""
    digest = hashlib.sha256()
    for name in sorted(series):
        array = np.ascontiguousarray(series[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


@dataclass(frozen=True)
class Recording:
    """A contact's time series, or its twin's, with time counted from the contact."""

    contact: Contact
    series: Mapping[str, NDArray[np.generic]]
    twin: str = ""  # what is different, where the series is not the contact's own but that of its episode's twin

    @property
    def collision(self) -> Collision:
        """What was recorded at the contact."""
        assert self.contact.episode.collision is not None  # that is what makes an episode a contact
        return self.contact.episode.collision

    @cached_property
    def time_s(self) -> Floats:
        """`T`, negative before the contact."""
        time: Floats = self["time_s"] - float(self["released_s"]) - self.collision.time_s
        return time

    @property
    def released_s(self) -> float:
        """When the adversaries were released."""
        return -self.collision.time_s

    @property
    def conflict_s(self) -> float | None:
        """When the conflict began; None in a twin, if nobody judged the contact, or if it was before the recording."""
        if self.twin or self.collision.judgement is None:
            return None
        began_s = self.collision.judgement.conflict_s - self.collision.time_s
        return began_s if began_s >= self.time_s[0] else None

    @cached_property
    def other(self) -> int:
        """Column of the actor that the ego touched; the ego's is 0."""
        return [str(id_) for id_ in self.series["ids"]].index(self.collision.other_id)

    def __getitem__(self, name: str) -> Floats:
        return np.asarray(self.series[name], dtype=np.float64)

    def pose(self, actor: int, time_s: float) -> tuple[float, float, float]:
        """Centre and heading at any time within the recording, between two frames as the contact's search does."""
        x, y, heading = (self[name][:, actor] for name in ("x_m", "y_m", "heading_rad"))
        at = (float(np.interp(time_s, self.time_s, values)) for values in (x, y, np.unwrap(heading)))
        return next(at), next(at), next(at)

    def hidden(self) -> Iterator[tuple[float, float]]:
        """The spans in which the ego could not see the other."""
        unseen = np.concatenate(([False], self["visible"][:, self.other] == 0, [False]))
        edges = np.flatnonzero(unseen[1:] != unseen[:-1])
        for start, end in edges.reshape(-1, 2):
            yield self.time_s[start], self.time_s[min(end, len(self.time_s) - 1)]
