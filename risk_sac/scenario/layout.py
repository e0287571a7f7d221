"""Start of an episode: vehicles, pedestrians, areas of ground, and story."""

import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import shapely

from risk_sac.config.base import Settings
from risk_sac.config.scenario import Chosen, is_expression
from risk_sac.config.story import Story, StoryEvent
from risk_sac.scenario.bodies import BODIES, Body, BodyName
from risk_sac.scenario.places import StoryPlaces
from risk_sac.scenario.travel_line import Pose
from risk_sac.world.types import Point, Role


class Reach(NamedTuple):
    """Bounding box of an actor, seen from its reference point."""

    length_m: float
    width_m: float
    ahead_m: float = 0.0
    """From the reference point, such as the rear axle's middle, forward to the box's middle."""


class StoryActor(NamedTuple):
    """Start of an actor that follows the story."""

    pose: Pose  # of its reference point
    speed_mps: float
    reach: Reach
    free: bool = False  # whether it moves anywhere, and not along lanes


class Deviation(NamedTuple):
    """Bounds of what an adversary adds to its story; 0 adds nothing."""

    accel_mps2: float = 0.0
    lateral_mps: float = 0.0


AS_WRITTEN = Deviation()
TIMELESS_CONDITIONS = frozenset({"state", "variable", "parameter", "collision"})
TIMELESS_ACTIONS = frozenset({"none", "variable", "visibility", "delete"})


def is_shifted(event: StoryEvent) -> bool:
    """Whether a deviation may shift an event's start trigger.

    An event that begins with its act, or as another element changes, follows what went before.
    """
    return any(condition.kind not in TIMELESS_CONDITIONS for group in event.start or () for condition in group) and any(
        action.do.kind not in TIMELESS_ACTIONS for action in event.actions
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StoryPlan:
    """Everything that the engine of a story needs for one episode."""

    story: Story  # without expressions and choices
    actors: Mapping[str, StoryActor]  # those that follow the story, in the document's order
    others: Mapping[str, StoryActor] = field(default_factory=dict)  # the ego, and all that the story does not move
    numbers: Mapping[str, float] = field(default_factory=dict)  # parameters
    words: Mapping[str, str] = field(default_factory=dict)
    edges: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # the ways of actors that have one
    places: StoryPlaces = field(compare=False)
    deviation: Deviation = AS_WRITTEN
    shifts_s: Mapping[str, float] = field(default_factory=dict)  # actor -> how much later its triggers fire


def shifted_groups(story: Story) -> Iterator[tuple[str, ...]]:
    """Yields actors of each group with triggers that a deviation may shift."""
    for acts in story.stories.values():
        for group in (group for act in acts for group in act.groups):
            if any(is_shifted(event) for maneuver in group.maneuvers for event in maneuver.events):
                yield group.actors


def settled(part: Any, of: Callable[[Any, str], float], choose: Callable[[Any], Any], path: str = "") -> Any:
    """Replaces expressions and choices by their values.

    It does so in settings, and in mappings and tuples of settings.

    `path` is the part's in its document.
    """
    if isinstance(part, Chosen):
        return settled(choose(part), of, choose, path)
    if isinstance(part, Settings):
        changed = {}
        for name, info in type(part).model_fields.items():
            before, here = getattr(part, name), f"{path}.{name}".removeprefix(".")
            after: Any = before
            if is_expression(info) and isinstance(before, str):
                after = of(before, here)
            elif is_expression(info) and isinstance(before, Mapping):
                after = {key: of(value, f"{here}.{key}") for key, value in before.items()}
            elif not isinstance(before, str):
                after = settled(before, of, choose, here)
            if after is not before:
                changed[name] = after
        return part.model_copy(update=changed) if changed else part
    if isinstance(part, tuple):
        members = tuple(settled(member, of, choose, f"{path}[{i}]") for i, member in enumerate(part))
        return part if all(map(operator.is_, members, part)) else members
    if isinstance(part, Mapping):
        return {key: settled(member, of, choose, f"{path}.{key}") for key, member in part.items()}
    return part


SAME_POINT_M = 1e-6
ON_THE_EDGE_M2 = 1e-9  # twice the area of a triangle that counts as none


@dataclass(frozen=True, slots=True)
class Area:
    """Convex polygon: nx·x + ny·y <= c for each of its sides.

    (nx, ny) is the side's unit normal outwards.
    """

    sides: tuple[tuple[float, float, float], ...]  # nx, ny, c of each

    @classmethod
    def of(cls, corners: Sequence[Sequence[float]]) -> "Area":
        """With these corners, counter-clockwise, of a convex polygon."""
        sides = []
        for (x, y), (to_x, to_y) in zip(corners, [*corners[1:], corners[0]], strict=True):
            dx, dy = to_x - x, to_y - y
            length = math.hypot(dx, dy)
            if length > SAME_POINT_M:
                nx, ny = dy / length, -dx / length
                sides.append((nx, ny, nx * x + ny * y))
        return cls(tuple(sides))

    @classmethod
    def box(cls, x_low_m: float, x_high_m: float, y_low_m: float, y_high_m: float) -> "Area":
        """A rectangle along the axes."""
        return cls.of([(x_low_m, y_low_m), (x_high_m, y_low_m), (x_high_m, y_high_m), (x_low_m, y_high_m)])

    def contains(self, x_m: float, y_m: float) -> bool:
        """Whether the point lies in the area."""
        for nx, ny, c in self.sides:  # noqa: SIM110  # `all` takes twice as long, in each step
            if nx * x_m + ny * y_m > c:
                return False
        return True

    def grown(self, by_m: float) -> "Area":
        """The area with a border added on every side."""
        return Area(tuple((nx, ny, c + by_m) for nx, ny, c in self.sides))


def ribbon(line: Sequence[Point], width_m: float) -> list[list[Point]]:
    """Returns a line's ribbon as counter-clockwise quadrangles with shared slanting sides."""
    points = np.array(_without_repeats(line), dtype=np.float64)
    if len(points) < 2:
        return []
    steps = np.diff(points, axis=0)
    steps /= np.hypot(*steps.T)[:, None]
    left = np.column_stack((-steps[:, 1], steps[:, 0]))
    across = np.concatenate((left[:1], (left[:-1] + left[1:]) / 2, left[-1:]))
    # Keeps the width round a bend; bounded, or a hairpin's corner would run away.
    across /= np.maximum((across * across).sum(axis=1), 0.25)[:, None]
    a, b = points + across * width_m / 2, points - across * width_m / 2
    quads = []
    for i in range(len(points) - 1):
        corners: list[Point] = [(float(x), float(y)) for x, y in (b[i], b[i + 1], a[i + 1], a[i])]
        quads += [corners] if is_convex(corners) else triangles(corners)
    return quads


def triangles(outline: Sequence[Point]) -> list[list[Point]]:
    """Returns a polygon as triangles, counter-clockwise; none if it has no area.

    Source: shapely's constrained Delaunay triangulation; an outline that crosses itself is made valid before.
    """
    ring = _without_repeats(outline)
    if len(ring) < 3:
        return []
    parts = shapely.constrained_delaunay_triangles(shapely.make_valid(shapely.Polygon(ring)))
    corners = (list(part.exterior.coords)[:3] for part in shapely.orient_polygons(parts).geoms)
    return [corner for corner in corners if _doubled_area(corner) > ON_THE_EDGE_M2]


def is_convex(corners: Sequence[Point]) -> bool:
    """Whether a polygon is convex and counter-clockwise, straight corners allowed."""
    n = len(corners)
    turns = (_doubled_area([corners[i - 1], corners[i], corners[(i + 1) % n]]) for i in range(n))
    return all(turn >= -ON_THE_EDGE_M2 for turn in turns)


def areas(polygons: Iterable[Sequence[Sequence[float]]]) -> tuple[Area, ...]:
    """Of convex polygons."""
    return tuple(Area.of(polygon) for polygon in polygons)


def _doubled_area(ring: Sequence[Point]) -> float:
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(ring, [*ring[1:], ring[0]], strict=True))


def _without_repeats(line: Sequence[Point]) -> list[Point]:
    kept: list[Point] = []
    for point in line:
        if not kept or math.dist(kept[-1], point) >= SAME_POINT_M:
            kept.append(point)
    return kept


LEAD_IN_S = 1.5  # in which SUMO drives all vehicles, before the adversaries are released to the policy
CAR_LENGTH_M, CAR_WIDTH_M = BODIES["car"].length_m, BODIES["car"].width_m
TRUCK_LENGTH_M, TRUCK_WIDTH_M = BODIES["truck"].length_m, BODIES["truck"].width_m


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyStart:
    """Body of an actor at its start."""

    id: str
    body: BodyName
    size_m: tuple[float, float] | None = None  # length and width, if they are not the usual ones of the body

    @property
    def shape(self) -> Body:
        """The body in its size."""
        return BODIES[self.body].sized(self.size_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleStart(BodyStart):
    """A vehicle on its route's first edge."""

    role: Role
    route: tuple[str, ...]  # edges of the net
    lane: int  # index on the first edge, 0 is the rightmost
    position_m: float  # of the front bumper along the first edge
    speed_mps: float
    left_m: float = 0.0  # of the lane's middle
    body: BodyName = "car"  # one that moves in lanes
    uses_oncoming: bool = False  # whether an adversary may leave its edge for oncoming lanes beside it


@dataclass(frozen=True, slots=True, kw_only=True)
class PedestrianStart(BodyStart):
    """Actor that moves freely: a pedestrian, or a bicycle across a road."""

    role: Role
    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    body: BodyName = "pedestrian"  # one that moves freely


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticStart(BodyStart):
    """Body that never moves, anywhere in the plane: parked or an obstacle."""

    x_m: float  # of its centre
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Everything a simulator needs to set up one episode."""

    net: str  # file below sumo_nets/, or anywhere
    ego: VehicleStart
    vehicles: tuple[VehicleStart, ...]
    pedestrians: tuple[PedestrianStart, ...] = ()
    statics: tuple[StaticStart, ...] = ()
    crossings: tuple[Area, ...] = ()  # pedestrian crossings, where drivers yield
    roadway: tuple[Area, ...] = ()  # where vehicles drive, as far as pedestrians may get there
    junctions: tuple[Area, ...] = ()  # where the ways of vehicles cross
    lane_width_m: float = 3.3
    signal: str | None = None  # id of the traffic light
    signal_offset_s: float = 0.0  # where in its cycle the episode starts
    friction: float = 1.0
    horizon_steps: int = 150  # of 0.1 s
    wary: bool = False  # whether drivers stop for an ego that stands askew; SUMO tells them of a box along its lane
    set_speed_mps: float = math.inf  # that the ego keeps to; no lane's limit is above it
    story: StoryPlan | None = None  # what actors of the role `STORY` do; without a lead-in
