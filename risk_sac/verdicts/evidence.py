"""Record of an episode up to contact as arrays: the judge's input."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.maps.carriageway import carriageway_of, square_of
from risk_sac.risk.publish import nearest_lane
from risk_sac.scenario.layout import Area, Layout
from risk_sac.sim.collision import Contact, contact_with
from risk_sac.verdicts.course import WANDER_M, BodyOnPath, MovingBox, Path, along_series, recorded_path
from risk_sac.world.geometry import Size
from risk_sac.world.types import HEADING, LENGTH, STEP_S, VX, VY, WIDTH, Bools, Floats, X, Y

Letters = NDArray[Any]  # as numbers
KERB_STEPS = 10  # looks within the time ahead

PER_ACTOR = ("x_m", "y_m", "heading_rad", "vx_mps", "vy_mps", "speed_mps", "lateral_mps", "accel_mps2", "lane_offset_m")


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


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """Arrays of `T` frames up to the contact and `n` actors.

    The ego is column 0. Values are NaN where an actor has left.
    """

    time_s: Floats  # T, from the adversaries' release; negative before it
    ids: tuple[str, ...]
    kind: NDArray[np.int8]  # n
    body: NDArray[np.int8]  # n, codes of `risk_sac.scenario.bodies`
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
    as_written: bool = False  # nothing deviates from the scenario, so that the others' behaviour is not judged

    @classmethod
    def from_series(cls, series: Mapping[str, NDArray[Any]], ground: Ground, released_s: float) -> "Evidence":
        """Reads an episode's time series (`Trace.series`); `released_s` is the adversaries' release."""
        known = np.asarray(series["visible"] == 1.0)
        known[:, 0] = True
        names = (*PER_ACTOR, "link", "kind", "body", "role", "length_m", "width_m")
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
          ValueError: it is not there, or is the ego.
        """
        if id_ not in self.ids[1:]:
            raise ValueError(f"striker {id_!r} is not among the recorded {self.ids[1:]}")
        column = self.ids.index(id_)
        if np.isnan(self.x_m[-1, column]):
            raise ValueError(f"striker {id_!r} has left before the contact; wanted one that is there in the last frame")
        return column

    @cached_property
    def ego_path(self) -> Path:
        """The ego's recorded path; a verdict reads it many times."""
        return recorded_path(self.x_m[:, 0], self.y_m[:, 0], self.heading_rad[:, 0])

    @property
    def released(self) -> int:
        """Returns the frame of the adversaries' release, at most the last."""
        return min(int(np.searchsorted(self.time_s, -self.step_s / 2)), len(self.time_s) - 1)

    @property
    def tells_story(self) -> bool:
        """Whether the episode plays a scenario's story, which begins with the release."""
        return self.released == 0 and len(self.time_s) > 1

    def since(self, before_s: float) -> int:
        """The first frame of the last `before_s` seconds."""
        return int(np.searchsorted(self.time_s, self.time_s[-1] - before_s - 1e-6))


def inside(areas: Sequence[Area], x_m: Floats, y_m: Floats, margin_m: float = 0.0) -> Bools:
    """Tells which points lie in an area or within `margin_m` of one."""
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
    """Tells which points reach an area in `ahead_s` at constant velocity."""
    t = np.linspace(0.0, ahead_s, KERB_STEPS + 1)[:, None]
    soon: Bools = np.any(inside(areas, x_m + t * vx_mps, y_m + t * vy_mps), axis=0)
    return soon


class LaneSeries(NamedTuple):
    """Lane of an actor, frame by frame."""

    limit_mps: Floats
    width_m: Floats


def lanes_of(evidence: Evidence, actor: int, first: int = 0) -> LaneSeries:
    """Reads the nearest lane in an actor's direction from frame `first` on.

    Without a net, without a lane nearby and where the actor has left, it is the ground's limit and width.
    """
    e, ground = evidence, evidence.ground
    limit_mps = np.full(len(e.time_s) - first, ground.speed_limit_mps)
    width_m = np.full(len(e.time_s) - first, ground.lane_width_m)
    if not ground.net:
        return LaneSeries(limit_mps, width_m)
    carriageway = carriageway_of(ground.net)
    places = zip(e.x_m[first:, actor].tolist(), e.y_m[first:, actor].tolist(), strict=True)
    for t, (x, y) in enumerate(places):
        if math.isnan(x):
            continue
        _, limit, width = nearest_lane(carriageway.lanes(square_of(x, y)), x, y, float(e.heading_rad[first + t, actor]))
        if math.isfinite(limit):
            limit_mps[t], width_m[t] = limit, width
    return LaneSeries(limit_mps, width_m)


NO_JUMP_M = 0.5  # what the offset may differ in a step from what the ego moved across
STANDING_M = 0.01  # driven in a step; below it the direction of motion is noise


def column(values: Floats, actor: int) -> Floats:
    """One actor's values, contiguous as compiled code needs them."""
    return np.ascontiguousarray(values[:, actor])


def recorded_size(evidence: Evidence, actor: int) -> Size:
    """The size of an actor."""
    return Size(float(evidence.length_m[actor]) / 2, float(evidence.width_m[actor]) / 2)


def recorded_motion(evidence: Evidence, actor: int) -> MovingBox[Floats]:
    """The body of an actor in every frame."""
    e = evidence
    x, y, heading, vx, vy = (column(each, actor) for each in (e.x_m, e.y_m, e.heading_rad, e.vx_mps, e.vy_mps))
    return MovingBox(x, y, heading, vx, vy, recorded_size(e, actor))


def recorded_contact(evidence: Evidence, striker: int) -> Contact:
    """Returns the striker's contact in the last step; its `other` is 1."""
    e, both, steps = evidence, [0, striker], np.zeros((2, WIDTH + 1, 2))
    for state, t in zip(steps, (-2 if len(e.time_s) > 1 else -1, -1), strict=True):
        state[[X, Y, HEADING]] = e.x_m[t, both], e.y_m[t, both], e.heading_rad[t, both]
        state[[VX, VY, LENGTH, WIDTH]] = e.vx_mps[t, both], e.vy_mps[t, both], e.length_m[both], e.width_m[both]
    return contact_with(steps[0], steps[1], 1, float(e.time_s[-1]), e.step_s)


def ego_path(evidence: Evidence) -> Path:
    """The ego's recorded path."""
    return evidence.ego_path


def front_moved_across(evidence: Evidence) -> Floats:
    """Sums the front bumper's lateral motion, `T`, m, positive to the left.

    The sum starts in the first frame and goes on across lanes.

    It is the front bumper's offset from the lane that SUMO has it on, without the jumps to the next lane; beside the
    road SUMO goes on with the last lane. Without recorded offsets it is the sum of the lateral speed, which drifts
    where lanes bend.
    """
    e = evidence
    lateral = e.lateral_mps[:, 0] * e.step_s
    offset, width = e.lane_offset_m[:, 0], lanes_of(e, 0).width_m
    steps = np.diff(offset, prepend=offset[:1])
    steps -= width * np.round((steps - lateral) / width)
    jumps = ~(np.abs(steps - lateral) <= NO_JUMP_M)  # to a lane of another width; NaN without offsets
    moved: Floats = np.cumsum(np.where(jumps, lateral, steps))
    return moved


def keeps_lane(evidence: Evidence, first: int) -> bool:
    """Whether the ego kept its lane from frame `first` on.

    Choice: its front moved across by 0.375 m at most.
    """
    moved = front_moved_across(evidence)[first:]
    return bool(np.abs(moved - moved[0]).max() <= WANDER_M)


def lane_path(evidence: Evidence, first: int) -> Path:
    """Returns the path of the ego's lane at frame `first`.

    It is the recorded path without what the ego moved across since; its place across the lane stays the same.
    """
    recorded, moved, lane = ego_path(evidence), front_moved_across(evidence), lane_heading(evidence)
    if not np.isnan(evidence.lane_offset_m[:, 0]).any():  # of its centre: less than its front, if it is turned aside
        moved = moved - evidence.length_m[0] / 2 * np.sin(evidence.heading_rad[:, 0] - lane)
    after = np.arange(len(moved)) > first
    moved = np.where(after, moved - moved[first], 0.0)
    x, y = recorded.x + moved * np.sin(lane), recorded.y - moved * np.cos(lane)
    return recorded_path(x, y, np.where(after, lane, recorded.heading))


def lane_heading(evidence: Evidence) -> Floats:
    """Computes the heading of the ego's lane from its motion, `T`.

    While the ego stands it is the heading before, in the first frame the ego's own.
    """
    x, y = evidence.x_m[:, 0], evidence.y_m[:, 0]
    dx, dy = np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1])
    driven = np.hypot(dx, dy)
    across = evidence.lateral_mps[:, 0] * evidence.step_s
    lane = np.arctan2(dy, dx) - np.arcsin(np.clip(across / np.maximum(driven, STANDING_M), -1.0, 1.0))
    lane[0] = evidence.heading_rad[0, 0]
    latest: Floats = lane[np.maximum.accumulate(np.where(driven > STANDING_M, np.arange(len(lane)), 0))]
    return latest


def seen_along(path: Path, evidence: Evidence, striker: int) -> BodyOnPath[Floats]:
    """The striker along the ego's path, frame by frame."""
    size, motion = recorded_size(evidence, 0), recorded_motion(evidence, striker)
    return along_series(path, column(evidence.speed_mps, 0), size, motion)
