"""State that story conditions and actions read: actors, roads, variables, time."""

import math
from collections.abc import Mapping
from copy import copy
from typing import NamedTuple, Protocol

import numpy as np
import shapely

from risk_sac.config.story import Along
from risk_sac.config.story_actions import Coordinates, LanePosition, LaneTarget, Position
from risk_sac.errors import ConfigError
from risk_sac.scenario.lane_places import LanePlace
from risk_sac.scenario.layout import Reach, StoryPlan
from risk_sac.scenario.places import OnRoad, StoryPlaces
from risk_sac.scenario.travel_line import Pose, TravelLine, line_of
from risk_sac.sim.story.cast import ANYWHERE, STANDS_MPS, DeviationRoom, Mover, Present
from risk_sac.world.types import STEP_S

LINE_M = 3000.0  # of the way ahead of a lane's beginning; an actor at its end gets the next piece
A_POINT = Reach(0.0, 0.0)
STRAIGHT_M = 1000.0


class Apart(NamedTuple):
    """One actor relative to another: ahead and left, m, and their rates."""

    ahead_m: float
    left_m: float
    ahead_mps: float
    left_mps: float


class Stage:
    """The present of a story.

    Attributes:
      time_s: since the story's start.
      present: all actors that are there, by name.
      movers: those that the engine moves.
      numbers: variables that hold numbers.
      words: variables that hold words.
      travelled_m: of each actor since the story's start, without teleports.
      stood_s: how long each actor has stood.
      unmet: actions that could not be done, in words.
    """

    def __init__(self, plan: StoryPlan) -> None:
        """Puts all actors of the story where they start."""
        self.plan, self.time_s = plan, 0.0
        self.present: dict[str, Present] = {}
        self.movers = {name: Mover(name, start) for name, start in plan.actors.items()}
        story = plan.story
        self.numbers = {name: float(value) for name, value in story.variables.items()}
        self.words = dict(story.words)
        self.travelled_m: dict[str, float] = {}
        self.stood_s: dict[str, float] = {}
        self.unmet: set[str] = set()
        self._off_s: dict[str, float | None] = {}
        self._end_s: dict[str, float | None] = {}
        self._lines: dict[tuple[str, tuple[str, ...]], TravelLine] = {}
        self.places: StoryPlaces = plan.places
        for name, start in plan.actors.items():
            self.onto_road(self.movers[name], start.pose)

    def look(self, others: Mapping[str, Present]) -> None:
        """Takes in where all actors are now."""
        before = self.present
        moved = {name: mover.present for name, mover in self.movers.items() if not mover.gone}
        self.present = {**others, **moved}
        for name, actor in self.present.items():
            gone_m = math.dist(actor[:2], before[name][:2]) if name in before else 0.0
            self.travelled_m[name] = self.travelled_m.get(name, 0.0) + gone_m
            self.stood_s[name] = self.stood_s.get(name, 0.0) + STEP_S if self.stands(name) and name in before else 0.0

    def look_again(self, name: str) -> None:
        """Updates an actor that was moved without travelling there."""
        self.present[name] = self.movers[name].present

    def after(self, seconds: float) -> "Stage":
        """Returns a read-only stage after some time at constant velocities."""
        later = copy(self)
        later.time_s = self.time_s + seconds
        later.present = {name: actor.after(seconds) for name, actor in self.present.items()}
        later.travelled_m = {
            name: gone_m + self.present[name].speed_mps * seconds if name in self.present else gone_m
            for name, gone_m in self.travelled_m.items()
        }
        later.stood_s = {name: stood_s + seconds if stood_s else 0.0 for name, stood_s in self.stood_s.items()}
        later._off_s, later._end_s = dict(self._off_s), dict(self._end_s)
        return later

    def stands(self, name: str) -> bool:
        """Whether an actor does not move."""
        return self.present[name].speed_mps < STANDS_MPS

    def of(self, name: str) -> Pose:
        """Reference pose of an actor."""
        return self.present[name].pose

    def pose(self, position: Position) -> Pose:
        """Pose of a position now."""
        return self.places.pose(position, self.of)

    def target(self, to: "str | Position") -> Present | None:
        """Returns an actor if present, or a standing place."""
        if isinstance(to, str):
            return self.present.get(to)
        return Present.moving(self.pose(to), 0.0, 0.0, A_POINT)

    # Roads

    def onto_road(self, mover: Mover, pose: Pose) -> None:
        """Puts an actor on the way ahead: its lane's, or straight on."""
        spot = None if mover.free else self.places.spot(pose)
        if spot is None:
            mover.follow(straight(pose), 0.0)
            return
        line = self.lane_line(spot, mover.name)
        mover.follow(line, *line.project(pose.x_m, pose.y_m))

    def onto_way(self, mover: Mover) -> None:
        """Puts an actor beyond either line end on the way from there."""
        if not mover.guided and not 0.0 <= mover.station_m < mover.line.length_m:
            self.onto_road(mover, mover.line.pose(mover.station_m, mover.left_m))

    def lane_line(self, spot: LanePlace, of: str = "") -> TravelLine:
        """Returns the way from a lane's beginning on, along the actor's route."""
        edges = self.movers[of].edges if of in self.movers else self.plan.edges.get(of, ())
        key = spot.lane.id, edges
        if key not in self._lines:
            self._lines[key] = self.places.ahead(LanePlace(spot.lane, 0.0, 0.0), LINE_M, edges)
        return self._lines[key]

    def way_to(self, name: str, target: Pose) -> tuple[float, float]:
        """Distance along an actor's way to a place, m, and its speed."""
        actor = self.present[name]
        if name in self.movers:
            line: TravelLine | None = self.movers[name].line
        else:
            spot = self.places.spot(actor.pose)
            line = None if spot is None else self.lane_line(spot, name)
        if line is None:
            return math.dist(actor[:2], target[:2]), actor.speed_mps
        return line.project(*target[:2])[0] - line.project(*actor[:2])[0], actor.speed_mps

    def way_between(self, here: Pose, there: Pose) -> tuple[TravelLine, tuple[str, ...]] | None:
        """Returns the line along lanes between places, and its edges, or None."""
        try:
            return self.places.way(here, there)
        except ConfigError:
            return None

    def lane_of(self, target: "float | str | LaneTarget", own: Pose) -> LanePlace | None:
        """Returns the spot that a lane change leads to, beside a pose."""
        here = self.places.spot(own)
        if here is None:
            return None
        if isinstance(target, LaneTarget):
            other = self.present.get(target.to)
            there = None if other is None else self.places.spot(other.pose)
            if other is None or there is None:
                return None
            lanes = round(float(target.lanes))
            if there.lane.edge == here.lane.edge:
                return self.places.beside(here, there.lane.index + lanes - here.lane.index)
            place = self.on_road(other.pose)
            if place is None:
                return self.places.beside(here, there.lane.index + lanes - here.lane.index)
            return self._numbered(_lane_beside(place.lane, lanes), own, here)
        return self._numbered(round(float(target)), own, here)

    def _numbered(self, lane: int, own: Pose, here: LanePlace) -> LanePlace | None:
        """Spot on the lane of this OpenDRIVE id beside a pose."""
        place = self.on_road(own)
        if place is None:
            return None
        if place.lane * lane > 0:  # the same direction: ids count away from the middle, on both sides
            return self.places.beside(here, abs(place.lane) - abs(lane))
        across = LanePosition(kind="lane", road=place.road, lane=float(lane), s_m=place.s_m)
        return self.places.spot(self.pose(across))

    def on_road(self, pose: Pose) -> OnRoad | None:
        """Place on a road of the OpenDRIVE file; None without one."""
        try:
            return self.places.opendrive(pose)
        except ConfigError:
            return None

    def room(self, mover: Mover) -> DeviationRoom:
        """Room beside an actor's body, up to its road's car lanes' edges."""
        spot = None if mover.free else self.places.spot(mover.pose)
        if spot is None:
            return ANYWHERE
        half_m = spot.lane.width_m / 2 - mover.reach.width_m / 2
        left_m = right_m = half_m
        lanes = 1
        while (other := self.places.beside(spot, lanes)) is not None:
            left_m, lanes = left_m + other.lane.width_m, lanes + 1
        lanes = -1
        while (other := self.places.beside(spot, lanes)) is not None:
            right_m, lanes = right_m + other.lane.width_m, lanes - 1
        return DeviationRoom(left_m - spot.left_m, right_m + spot.left_m)

    def lane_heading(self, name: str) -> float:
        """Direction of an actor's lane; its own where it is on none."""
        pose = self.of(name)
        spot = self.places.spot(pose)
        return pose.heading_rad if spot is None else line_of(spot.lane.centre).pose(spot.at_m).heading_rad

    def off_road_s(self, name: str) -> float | None:
        """Time of an actor beside all lanes, s; None if on one."""
        spot = self.places.spot(self.of(name))
        return self._since(self._off_s, name, spot is None or abs(spot.left_m) > spot.lane.width_m / 2)

    def at_end_s(self, name: str) -> float | None:
        """Time of a story actor at its way's end, s, or None."""
        mover = self.movers.get(name)
        return self._since(self._end_s, name, mover is not None and mover.station_m >= mover.line.length_m)

    def _since(self, times_s: dict[str, float | None], name: str, true: bool) -> float | None:
        since_s = times_s.get(name)
        since_s = times_s[name] = (self.time_s if since_s is None else since_s) if true else None
        return None if since_s is None else self.time_s - since_s

    # Distances

    def apart(self, one: Present, other: Present, coordinates: Coordinates) -> Apart:
        """Finds one actor relative to another, along axes or lanes."""
        if coordinates == "road" and (found := self._along_road(one, other)) is not None:
            return found
        if coordinates != "entity" and (found := self._along_lanes(one, other)) is not None:
            return found
        ahead, left = _turned(other.x_m - one.x_m, other.y_m - one.y_m, one.heading_rad)
        own, its = one.along(one.heading_rad), other.along(one.heading_rad)
        return Apart(ahead, left, its[0] - own[0], its[1] - own[1])

    def _along_road(self, one: Present, other: Present) -> Apart | None:
        """The same along the reference line of their common road, or None."""
        here, there = self.on_road(one.pose), self.on_road(other.pose)
        if here is None or there is None or here.road != there.road:
            return None
        apart, rates = list[tuple[float, float]](), list[tuple[float, float]]()
        for place, actor in ((here, one), (there, other)):
            road_rad, t_m = self.places.across(place)
            apart.append((place.s_m, t_m))
            rates.append(actor.along(road_rad))
        sign = 1.0 if math.cos(one.heading_rad - self.places.across(here)[0]) >= 0.0 else -1.0
        both = (
            apart[1][0] - apart[0][0],
            apart[1][1] - apart[0][1],
            rates[1][0] - rates[0][0],
            rates[1][1] - rates[0][1],
        )
        return Apart(*(sign * value for value in both))

    def _along_lanes(self, one: Present, other: Present) -> Apart | None:
        """The same along the lane from the one behind to the other.

        None if neither lane leads there.
        """
        for first, second, sign in ((one, other, 1.0), (other, one, -1.0)):
            spot = self.places.spot(first.pose)
            if spot is None:
                continue
            line = self.lane_line(spot)
            from_m, from_left_m = line.project(first.x_m, first.y_m)
            to_m, to_left_m = line.project(second.x_m, second.y_m)
            if not 0.0 < to_m < line.length_m or to_m < from_m:
                continue
            slow = first.along(line.pose(from_m).heading_rad)
            fast = second.along(line.pose(to_m).heading_rad)
            apart = (to_m - from_m, to_left_m - from_left_m, fast[0] - slow[0], fast[1] - slow[1])
            return Apart(*(sign * value for value in apart))
        return None

    def distance(
        self, one: Present, other: Present, along: Along, coordinates: Coordinates, *, freespace: bool
    ) -> tuple[float, float]:
        """Computes two actors' distance, m, at least 0, and closing speed, m/s.

        Without `freespace` it is that of their reference points, else that of their boxes.
        """
        if along == "euclidean":
            dx, dy = other.x_m - one.x_m, other.y_m - one.y_m
            apart_m = math.hypot(dx, dy)
            rate = (dx * (other.vx_mps - one.vx_mps) + dy * (other.vy_mps - one.vy_mps)) / max(apart_m, 1e-9)
            return (float(shapely.distance(box(one), box(other))) if freespace else apart_m), -rate
        apart = self.apart(one, other, coordinates)
        if along == "longitudinal":
            from_to, rate, side = apart.ahead_m, apart.ahead_mps, 0
        else:
            from_to, rate, side = apart.left_m, apart.left_mps, 1
        sign = 1.0 if from_to >= 0.0 else -1.0
        if not freespace:
            return abs(from_to), -sign * rate
        own, its = extent(one.reach, 0.0), extent(other.reach, other.heading_rad - one.heading_rad)
        (own_low, own_high), (low, high) = own[side], its[side]
        gap_m = max(from_to + low - own_high, own_low - from_to - high)
        return max(gap_m, 0.0), -sign * rate


def straight(pose: Pose, length_m: float = STRAIGHT_M) -> TravelLine:
    """A line straight on."""
    way = np.array((math.cos(pose.heading_rad), math.sin(pose.heading_rad)))
    return line_of(np.array((pose.x_m, pose.y_m)) + np.outer((0.0, length_m), way), np.full(2, pose.heading_rad))


def box(actor: Present) -> shapely.Polygon:
    """Bounding box of an actor."""
    (x, y), reach = actor.middle, actor.reach
    cos, sin = math.cos(actor.heading_rad), math.sin(actor.heading_rad)
    along = np.array((cos, sin)) * max(reach.length_m, 1e-6) / 2
    left = np.array((-sin, cos)) * max(reach.width_m, 1e-6) / 2
    return shapely.Polygon(np.array((x, y)) + np.array((along + left, along - left, -along - left, left - along)))


def extent(reach: Reach, turned_rad: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Reach of a turned box behind, ahead, right and left.

    It is from the box's reference point.
    """
    cos, sin = math.cos(turned_rad), math.sin(turned_rad)
    half_length, half_width = reach.length_m / 2, reach.width_m / 2
    along = abs(cos) * half_length + abs(sin) * half_width
    across = abs(sin) * half_length + abs(cos) * half_width
    ahead, left = reach.ahead_m * cos, reach.ahead_m * sin
    return (ahead - along, ahead + along), (left - across, left + across)


def _turned(dx: float, dy: float, heading_rad: float) -> tuple[float, float]:
    """A vector along a heading and to the left of it."""
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    return dx * cos + dy * sin, dy * cos - dx * sin


def _lane_beside(lane: int, left: int) -> int:
    """Returns the OpenDRIVE lane id `left` lanes to the left, without 0."""
    wanted = lane + left if lane < 0 else lane - left
    return wanted - int(math.copysign(1, lane)) if wanted == 0 or (wanted > 0) != (lane > 0) else wanted


ALONG, ACROSS = frozenset({"along"}), frozenset({"across"})
NEITHER: frozenset[str] = frozenset()


class Doing(Protocol):
    """An action of one actor while it runs.

    Attributes:
      controls: "along", "across" or both; an action ends another one of the same actor that controls the same.
    """

    controls: frozenset[str]

    def begin(self, mover: Mover, stage: Stage) -> bool:
        """Starts now; returns whether it is over already."""

    def step(self, mover: Mover, stage: Stage) -> bool:
        """Sets the actor's next step; returns whether the action is then over."""
