"""Defines an episode's parts: its scene, its road and its frames.

Geometry is metric and mathematical: x east, y north, heading 0 = east, counter-clockwise, radians,
and every position is the centre of the actor's body. SUMO's own conventions (front bumper, compass
degrees) end in `risk_sac.sim.reading`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.world.documented import Documented

Floats = NDArray[np.float64]
Point = tuple[float, float]  # x, y, m
Vector = NDArray[np.float32]  # what a network takes and gives
Bools = NDArray[np.bool_]

STEP_S = 0.1  # one control step is one simulation step


class Kind(IntEnum):
    """Way of moving: in lanes, or anywhere as pedestrians do."""

    VEHICLE = 0
    PEDESTRIAN = 1


class Role(IntEnum):
    """Part of an actor in a scenario."""

    EGO = 0
    ADVERSARY = 1
    BACKGROUND = 2
    STATIC = 3
    STORY = 4  # follows the scenario's story; one that a method leads away from it is an adversary from then on


class Signal(IntEnum):
    """Colour of the signal ahead of the ego; NONE without a signal."""

    NONE = 0
    GREEN = 1
    YELLOW = 2
    RED = 3


class Lane(NamedTuple):
    """Lane that cars may use, on a road or through a junction."""

    id: str  # SUMO's
    line: Floats  # 2 x p: x and y of its middle, in its direction, m
    width_m: float
    limit_mps: float
    left: str  # the lane beside it, of the same direction; "" without one
    right: str
    may_change_left: bool  # whether the markings let a car change to that lane
    may_change_right: bool
    successors: tuple[str, ...]  # lanes of the same `Road` that it leads to
    on_route: bool  # whether it leads on along the ego's route


class StopLine(NamedTuple):
    """Stop line of a signal at a lane's end, for one successor."""

    lane: str
    leads_to: str  # the successor that the signal lets in
    signal: str  # id of the traffic light
    link: int  # index of its letter in the state of the light


class Road(NamedTuple):
    """The lanes around the ego's route, and the stop lines on it."""

    lanes: tuple[Lane, ...] = ()
    stop_lines: tuple[StopLine, ...] = ()


@dataclass(frozen=True, slots=True)
class Scene:
    """Static parameters ξ of an episode: a point in its family's space."""

    family: str
    values: Mapping[str, float]


# Rows of a frame's state. Compiled code takes the whole of it: each array that it is handed costs as much as a loop.
X, Y, HEADING, VX, VY, SPEED, LATERAL, ACCEL, OFFSET, LENGTH, WIDTH = range(11)


class Row:
    """One row of a frame's state, read by name."""

    def __init__(self, index: int) -> None:
        self.index = index

    def __get__(self, frame: "Frame", owner: type) -> Floats:
        """The row, `n`; a view."""
        row: Floats = frame.state[self.index]
        return row


class FrameFields(NamedTuple):
    """Fields of a frame.

    One is made in every step, and a frozen dataclass takes three times as long to make.
    """

    time_s: float
    ids: tuple[str, ...]
    kind: NDArray[np.int8]
    body: NDArray[np.int8]  # code of `risk_sac.scenario.bodies`
    role: NDArray[np.int8]
    state: Floats  # rows x n: those below
    signal: Signal
    stop_line_m: float  # ego's front bumper to its next signal's stop line; negative once past; inf without one
    link: NDArray[np.uint8]  # SUMO's letter of the signal ahead, such as ord("g"): green, but has to yield; 0: none
    teleported: tuple[str, ...] = ()


class Frame(FrameFields):
    """All actors after a simulation step, in `n` columns, the ego first."""

    __slots__ = ()

    x_m = Row(X)
    y_m = Row(Y)
    heading_rad = Row(HEADING)
    vx_mps = Row(VX)  # velocity over the last step, east
    vy_mps = Row(VY)  # north
    speed_mps = Row(SPEED)  # along the lane or the walking direction, never negative
    lateral_mps = Row(LATERAL)  # across the lane, positive to the left
    accel_mps2 = Row(ACCEL)
    lane_offset_m = Row(
        OFFSET
    )  # from its lane's middle, or a piloted ego's path; positive to the left; 0 of pedestrians
    length_m = Row(LENGTH)
    width_m = Row(WIDTH)

    @property
    def ego_speed_mps(self) -> float:
        """Speed of the ego."""
        return float(self.state[SPEED, 0])


OptionalReal = float | None  # null where it is not finite: JSON has no other word for that
Reals = list[OptionalReal]
RealRows = list[list[OptionalReal]]


class Series(Documented):
    """Time series: `T` steps, `n` actors, ego first, `M` requirements, `a` actions.

    Entries of an actor that is absent are null.
    """

    time_s: Reals
    """T, of the simulator."""
    released_s: float
    """When the adversaries were handed to the policy, as `time_s` counts."""
    ids: list[str]
    """n."""
    kind: list[str]
    """n; vehicle | pedestrian: whether it moves in lanes or anywhere."""
    body: list[str]
    """n; car | van | truck | bus | motorcycle | bicycle | pedestrian | child | obstacle."""
    role: list[str]
    """n; ego | adversary | background | static | story."""
    length_m: Reals
    """n."""
    width_m: Reals
    """n."""
    x_m: RealRows
    """T x n, centre of the body."""
    y_m: RealRows
    """T x n."""
    heading_rad: RealRows
    """T x n; 0 = east, counter-clockwise."""
    speed_mps: RealRows
    """T x n."""
    lateral_mps: RealRows
    """T x n; positive to the left."""
    accel_mps2: RealRows
    """T x n."""
    lane_offset_m: RealRows | None = None
    """T x n; a vehicle's centre from its lane's centre, positive to the left."""
    link: list[list[str | None]] | None = None
    """T x n; SUMO's letter of the signal ahead, such as `g`: green, but has to yield. Null without a signal, and in
    older files."""
    visible: list[list[bool | None]]
    """T x n; to the ego's sensor. Null for the ego itself, here and in what follows."""
    distance_m: RealRows
    """T x n, to the ego."""
    ttc_s: RealRows
    """T x n; null where not on a collision course."""
    rss_longitudinal_m: RealRows
    """T x n, margin; negative where violated."""
    rss_lateral_m: RealRows
    """T x n, margin; negative where violated."""
    requirements: list[str]
    """M."""
    robustness: RealRows
    """T x M, scaled; negative where violated."""
    soft_min: Reals
    """T."""
    actions: RealRows
    """T x a, of the adversaries, normalised: what led to the step."""
    signal: list[str]
    """T; colour ahead of the ego: none | green | yellow | red."""
