"""Record of an episode up to its contact, as arrays; the judge's only input."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.ground import Area
from risk_sac.scenario.layout import Layout
from risk_sac.types import STEP_S, Bools, Floats

Letters = NDArray[Any]  # as numbers
KERB_STEPS = 10  # looks within the time ahead

PER_ACTOR = (
    "x_m",
    "y_m",
    "heading_rad",
    "vx_mps",
    "vy_mps",
    "speed_mps",
    "lateral_mps",
    "accel_mps2",
    "lane_offset_m",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """Place of an episode, as far as a verdict depends on it."""

    friction: float = 1.0
    speed_limit_mps: float = 13.89
    lane_width_m: float = 3.3
    crossings: tuple[Area, ...] = ()  # pedestrian crossings
    junctions: tuple[Area, ...] = ()
    roadway: tuple[Area, ...] = ()  # where vehicles drive; none: pedestrians are judged as if always on it
    net: str = ""  # the net's file; none: the ego is judged as if always on its carriageway

    @classmethod
    def of(cls, layout: Layout, speed_limit_mps: float) -> "Ground":
        """Reads the place from a layout."""
        names = ("friction", "lane_width_m", "crossings", "junctions", "roadway", "net")
        return cls(speed_limit_mps=speed_limit_mps, **{name: getattr(layout, name) for name in names})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evidence:
    """Arrays of `T` frames up to the contact and `n` actors.

    The ego is column 0. Values are NaN where an actor has left.
    """

    time_s: Floats  # T, from the adversaries' release; negative before it
    ids: tuple[str, ...]
    kind: NDArray[np.int8]  # n
    role: NDArray[np.int8]  # n
    length_m: Floats  # n
    width_m: Floats  # n
    x_m: Floats  # this and the following: T x n
    y_m: Floats
    heading_rad: Floats
    vx_mps: Floats
    vy_mps: Floats
    speed_mps: Floats
    lateral_mps: Floats
    accel_mps2: Floats
    lane_offset_m: Floats  # from the lane SUMO has the vehicle on; NaN where it was not recorded
    link: Letters  # SUMO's letter of the signal ahead, of the crossing for a pedestrian; 0: none, NaN where it has left
    known: Bools  # in the ego's sight
    ground: Ground = Ground()
    step_s: float = STEP_S

    @classmethod
    def from_series(cls, series: Mapping[str, NDArray[Any]], ground: Ground, released_s: float) -> "Evidence":
        """From the time series of an episode, see `Trace.series`; the adversaries were released at `released_s`."""
        known = np.asarray(series["visible"] == 1.0)
        known[:, 0] = True
        names = (*PER_ACTOR, "link", "kind", "role", "length_m", "width_m")
        values: dict[str, Any] = {name: series[name] for name in names}
        return cls(
            time_s=series["time_s"] - released_s,
            ids=tuple(map(str, series["ids"])),
            known=known,
            ground=ground,
            **values,
        )

    def until(self, frame: int) -> "Evidence":
        """The evidence up to and including a frame."""
        over_time = ("time_s", *PER_ACTOR, "link", "known")
        return replace(self, **{name: getattr(self, name)[: frame + 1] for name in over_time})

    def column(self, id_: str) -> int:
        """Column of an actor that is there in the last frame.

        Raises:
          ValueError: it is not, or it is the ego.
        """
        if id_ not in self.ids[1:]:
            raise ValueError(f"striker {id_!r} is not among the recorded {self.ids[1:]}")
        column = self.ids.index(id_)
        if np.isnan(self.x_m[-1, column]):
            raise ValueError(f"striker {id_!r} has left before the contact; wanted one that is there in the last frame")
        return column

    def since(self, before_s: float) -> int:
        """The first frame of the last `before_s` seconds."""
        return int(np.searchsorted(self.time_s, self.time_s[-1] - before_s - 1e-6))


def inside(areas: Sequence[Area], x_m: Floats, y_m: Floats, margin_m: float = 0.0) -> Bools:
    """Tells which points lie in any of the areas.

    Points up to `margin_m` outside an area count too.
    """
    found = np.zeros(np.shape(x_m), dtype=np.bool_)
    for area in areas:
        here = np.ones(np.shape(x_m), dtype=np.bool_)
        for nx, ny, c in area.sides:
            here &= nx * x_m + ny * y_m <= c + margin_m
        found |= here
    return found


def soon_inside(
    areas: Sequence[Area], x_m: Floats, y_m: Floats, vx_mps: Floats, vy_mps: Floats, ahead_s: float
) -> Bools:
    """Tells which points are in one of the areas within `ahead_s`.

    They keep their velocity.
    """
    t = np.linspace(0.0, ahead_s, KERB_STEPS + 1)[:, None]
    soon: Bools = np.any(inside(areas, x_m + t * vx_mps, y_m + t * vy_mps), axis=0)
    return soon
