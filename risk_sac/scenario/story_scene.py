"""Starts and story of one scene whose document states places by road."""

import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from risk_sac.config.base import Settings
from risk_sac.config.scenario import EGO, Moving, Scenario
from risk_sac.config.story import Story, VariableCondition
from risk_sac.config.story_actions import AcquirePositionAction, Action, AssignRouteAction, FollowTrajectoryAction
from risk_sac.errors import ConfigError
from risk_sac.scenario.bodies import BODIES, BodyName
from risk_sac.scenario.lane_places import LanePlace, extended, joined, nearest_lane
from risk_sac.scenario.layout import Deviation, Reach, StoryActor, StoryPlan, VehicleStart, settled
from risk_sac.scenario.places import StoryPlaces
from risk_sac.scenario.space import Value
from risk_sac.scenario.travel_line import Pose, line_of
from risk_sac.world.net import Net, NetLane
from risk_sac.world.road_geometry import RoadFile


@cache  # a road file is kept with its net, by what is in it
def road_of(file: str) -> RoadFile:
    """Reads an OpenDRIVE file."""
    return RoadFile.read(Path(file))


class StoryScene:
    """Places of one scene, by its document's road file and story."""

    def __init__(self, document: Scenario, value: Value, file: str, net: Net) -> None:
        """Reads the road file, which lies beside the net's `file`."""
        self._document, self._value, self._net = document, value, net
        road = None
        if document.road is not None:
            road = road_of(str(Path(file).parent / value.word(document.road)))
        self.story = settled(document.story or Story(), value.of, value.choose, "story")
        self.places = StoryPlaces(net, road, self.story, value)
        self._poses: dict[str, Pose] = {}
        self._placing: list[str] = []

    def reach(self, name: str, body: BodyName) -> Reach:
        """Bounding box of an actor: the file's, or the body's own."""
        moving = self._moving(name)
        box = None if moving is None else self._value.choose(moving.box)
        if box is None:
            return Reach(BODIES[body].length_m, BODIES[body].width_m)
        return Reach(box.length_m, box.width_m, box.ahead_m)

    def _moving(self, name: str) -> Moving | None:
        return self._document.ego if name == EGO else self._document.actors.get(name)

    def put(self, name: str, middle: Pose, body: BodyName) -> None:
        """Notes where an actor's body starts, unless a position says so."""
        if name not in self._poses:
            self._poses[name] = ahead_of(middle, -self.reach(name, body).ahead_m)

    def pose(self, name: str) -> Pose:
        """Returns the start of an actor's reference point.

        Raises:
          ConfigError: there is no such place, or it depends on an actor that is not there before it.
        """
        if name in self._poses:
            return self._poses[name]
        moving, path = self._moving(name), name if name == EGO else f"actors.{name}"
        if moving is None or moving.start.position is None:
            raise ConfigError(f"{path}.start", f"a position relative to {name!r}", "an actor that starts before it")
        if name in self._placing:
            raise ConfigError(f"{path}.start.position", " → ".join([*self._placing, name]), "a chain without a cycle")
        self._placing.append(name)
        position = settled(moving.start.position, self._value.of, self._value.choose, f"{path}.start.position")
        try:
            pose = self.places.pose(position, self.pose)
        except ConfigError as error:
            field = f"{path}.start.position.{error.field}".removesuffix(".")
            raise ConfigError(field, error.got, error.expected, error.remedy) from error
        self._placing.pop()
        self._poses[name] = pose
        return pose

    def middle(self, name: str, body: BodyName) -> Pose:
        """Returns the start of the middle of an actor's body."""
        return ahead_of(self.pose(name), self.reach(name, body).ahead_m)

    def front_spot(self, name: str, body: BodyName) -> LanePlace:
        """Returns the lane place of a vehicle's front; raises `ConfigError` off lanes."""
        front = ahead_of(self.middle(name, body), self.reach(name, body).length_m / 2)
        spot = self.places.spot(front) or nearest_lane(self._net, front.x_m, front.y_m, None)
        if spot is None:
            path = name if name == EGO else f"actors.{name}"
            got = f"{front.x_m:.1f}, {front.y_m:.1f} m, which is far from all lanes"
            raise ConfigError(f"{path}.start.position", got, "a place near a lane")
        return spot

    def route(self, name: str, lane: NetLane, metres: float) -> tuple[str, ...] | None:
        """Returns the edges of an actor's first way, and straight on after.

        The way may end after so many metres. None where the story states no way.

        Raises:
          ConfigError: there is no such way.
        """
        for action in actions_of(self.story, name):
            try:
                if isinstance(action, FollowTrajectoryAction):
                    line = self.places.trajectory(str(action.trajectory), self.pose, self.pose(name))
                    edges = self.places.edges(line)
                elif isinstance(action, AssignRouteAction):
                    edges = self.places.route(str(action.route), self.pose).edges
                elif isinstance(action, AcquirePositionAction):
                    spot = self.places.spot(self.places.pose(action.position, self.pose))
                    edges = () if spot is None else (spot.lane.edge,)
                else:
                    continue
            except ConfigError as error:
                field = f"story.{error.field}".removesuffix(".")
                raise ConfigError(field, error.got, error.expected, error.remedy) from error
            if lane.edge in edges:
                edges = edges[edges.index(lane.edge) :]
            return extended(self._net, joined(self._net, (lane.edge, *edges)), metres)
        return None

    def put_vehicle(self, start: VehicleStart) -> None:
        """Notes where a vehicle starts that is placed by its lane."""
        lane = self._net.lanes[f"{start.route[0]}_{start.lane}"]
        line = line_of(lane.centre)
        at_m = start.position_m * line.length_m / lane.length_m - start.shape.length_m / 2
        self.put(start.id, line.pose(at_m, start.left_m), start.body)

    def plan(
        self,
        bodies: Mapping[str, BodyName],
        speeds_mps: Mapping[str, float],
        free: Mapping[str, bool],
        ego: VehicleStart,
    ) -> StoryPlan:
        """Returns the engine's plan; `free` says whether each actor moves freely."""
        actors, others = dict[str, StoryActor](), dict[str, StoryActor]()
        for name, body in bodies.items():
            start = StoryActor(self.pose(name), speeds_mps.get(name, 0.0), self.reach(name, body), free.get(name, True))
            document = self._document.actors.get(name)
            follows = document is not None and document.role == "story" and name in free
            (actors if follows else others)[name] = start
        named = {condition.variable for condition in _parameter_conditions(self.story)}
        bound = self.story.deviation
        return StoryPlan(
            story=self.story,
            actors=actors,
            others=others,
            numbers={name: value for name, value in self._value.numbers.items() if name in named},
            words={name: word for name, word in self._value.words.items() if name in named},
            edges={EGO: ego.route},
            places=self.places,
            deviation=Deviation(bound.accel_mps2, bound.lateral_mps),
        )


def actions_of(story: Story, name: str) -> Iterator[Action]:
    """Yields an actor's actions: those at the start, then in story order."""
    yield from (init.do for init in story.init if init.actor == name)
    for acts in story.stories.values():
        for group in (group for act in acts for group in act.groups if name in group.actors):
            yield from (
                named.do for maneuver in group.maneuvers for event in maneuver.events for named in event.actions
            )


def ahead_of(pose: Pose, by_m: float) -> Pose:
    """A pose so far ahead of another."""
    x_m, y_m, heading_rad = pose
    return Pose(x_m + by_m * math.cos(heading_rad), y_m + by_m * math.sin(heading_rad), heading_rad)


def _parameter_conditions(part: Any) -> Iterator[VariableCondition]:
    """All conditions of a story that ask for a parameter."""
    if isinstance(part, VariableCondition) and part.kind == "parameter":
        yield part
    if isinstance(part, Settings):
        for name in type(part).model_fields:
            yield from _parameter_conditions(getattr(part, name))
    elif isinstance(part, tuple):
        for member in part:
            yield from _parameter_conditions(member)
    elif isinstance(part, Mapping):
        yield from _parameter_conditions(tuple(part.values()))
