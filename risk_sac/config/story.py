"""Story of a scenario document: what its actors do besides the search, and when.

The model follows OpenSCENARIO XML 1.3. A story has acts, an act has maneuver groups, a group has maneuvers, a maneuver
has events, and an event has actions and a start trigger. Values are arithmetic over the document's parameters.
Source: ASAM OpenSCENARIO XML 1.3, class reference.
"""

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from risk_sac.config.base import Chosen, Settings
from risk_sac.config.values import Expression
from risk_sac.errors import ConfigError

ElementName = Annotated[str, StringConstraints(min_length=1, max_length=200)]
ActorName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,63}$")]
RoadId = Annotated[str, StringConstraints(min_length=1, max_length=100)]
AnyRoad = RoadId | Chosen[RoadId]
AnyName = ElementName | Chosen[ElementName]
"""A name, or one for each word of a parameter: `scenario.scene.Value.choose` tells which it is in a scene."""
Rule = Literal["greater", "greater_or_equal", "less", "less_or_equal", "equal", "not_equal"]
Coordinates = Literal["entity", "lane", "road", "trajectory"]
Along = Literal["euclidean", "longitudinal", "lateral"]
Direction = Literal["longitudinal", "lateral", "vertical"]
Shape = Literal["step", "linear", "sinusoidal", "cubic"]
ElementKind = Literal["story", "act", "maneuver_group", "maneuver", "event", "action"]
ElementState = Literal["standby", "running", "complete", "start", "end", "stop", "skip"]


# Positions


class WorldPosition(Settings):
    """Point of the plane, m; the net's coordinates are the road file's."""

    kind: Literal["world"]
    x_m: Expression
    y_m: Expression
    heading_rad: Expression | None = None
    """Absolute; without it the direction of the nearest lane."""


class _Turned(Settings):
    heading_rad: Expression = 0.0
    heading: Literal["relative", "absolute"] = "relative"
    """Relative to the lane, road, route, trajectory or actor; a lane's direction is that of its traffic."""


class LanePosition(_Turned):
    """Point of an OpenDRIVE lane."""

    kind: Literal["lane"]
    road: AnyRoad
    lane: Expression
    """OpenDRIVE's lane id, a whole number."""
    s_m: Expression
    """Along the road's reference line."""
    offset_m: Expression = 0.0
    """To the lane's middle, positive to the left of the reference line's direction."""


class RoadPosition(_Turned):
    """Point given by an OpenDRIVE road's reference line."""

    kind: Literal["road"]
    road: AnyRoad
    s_m: Expression
    t_m: Expression = 0.0


class RelativeLanePosition(_Turned):
    """Point of a lane some lanes beside an actor's."""

    kind: Literal["relative_lane"]
    to: ActorName
    lanes: Expression = 0.0
    """Added to the actor's lane id, without counting lane 0."""
    ds_m: Expression = 0.0
    along: Literal["road", "lane"] = "road"
    """Whether `ds_m` counts along the road's reference line or along the lane."""
    offset_m: Expression = 0.0


class RelativeRoadPosition(_Turned):
    """Point given by an actor's place on its road."""

    kind: Literal["relative_road"]
    to: ActorName
    ds_m: Expression = 0.0
    dt_m: Expression = 0.0


class RelativePosition(_Turned):
    """Point given by an actor's axes, or by the world's axes through an actor."""

    kind: Literal["relative"]
    to: ActorName
    dx_m: Expression = 0.0
    dy_m: Expression = 0.0
    axes: Literal["actor", "world"] = "actor"


class RoutePosition(_Turned):
    """Point along a route."""

    kind: Literal["on_route"]
    route: AnyName
    s_m: Expression
    """Along the reference lines of the route's roads, from its first waypoint's road's begin of use."""
    lane: Expression | None = None
    """OpenDRIVE's lane id there; then `offset_m` is to its middle, else `t_m` is to the reference line."""
    offset_m: Expression = 0.0
    t_m: Expression = 0.0


class TrajectoryPosition(_Turned):
    """Point along a trajectory."""

    kind: Literal["on_trajectory"]
    trajectory: AnyName
    s_m: Expression
    t_m: Expression = 0.0


Position = Annotated[
    WorldPosition
    | LanePosition
    | RoadPosition
    | RelativeLanePosition
    | RelativeRoadPosition
    | RelativePosition
    | RoutePosition
    | TrajectoryPosition,
    Field(discriminator="kind"),
]


# Routes and trajectories


class RoutePath(Settings):
    """Waypoints that a route leads through, by the shortest way along lanes."""

    waypoints: Annotated[tuple[Position, ...], Field(min_length=2, max_length=1000)]
    closed: bool = False


class Vertex(Settings):
    """Corner of a polyline, and when it is passed."""

    position: Position
    time_s: Expression | None = None


class Polyline(Settings):
    """Trajectory of straight pieces."""

    kind: Literal["polyline"]
    vertices: Annotated[tuple[Vertex, ...], Field(min_length=2, max_length=10_000)]
    closed: bool = False


class ClothoidSegment(Settings):
    """Piece whose curvature changes in proportion to its length."""

    curvature_start: Expression
    """1/m, positive to the left."""
    curvature_end: Expression
    length_m: Expression
    position: Position | None = None
    """Where it begins; without it at the end of the piece before."""
    turned_rad: Expression = 0.0
    """Heading beside that of the piece before."""
    time_s: Expression | None = None
    """When its begin is passed."""


class ClothoidSpline(Settings):
    """Trajectory of clothoids; a single clothoid, an arc and a line are such."""

    kind: Literal["clothoids"]
    segments: Annotated[tuple[ClothoidSegment, ...], Field(min_length=1, max_length=1000)]
    end_time_s: Expression | None = None


Trajectory = Annotated[Polyline | ClothoidSpline, Field(discriminator="kind")]


# Actions


class Dynamics(Settings):
    """Course of a value from its present to its target."""

    shape: Shape = "step"
    by: Literal["time", "rate", "distance"] = "time"
    value: Expression = 0.0
    """s, change per second (its size counts), or m."""


class RelativeTarget(Settings):
    """Value relative to that of another actor."""

    to: ActorName
    value: Expression = 0.0
    how: Literal["delta", "factor"] = "delta"
    continuous: bool = False
    """Whether the target follows the other actor's value, without an end."""


class SpeedAction(Settings):
    """Brings actors to a speed, m/s."""

    kind: Literal["speed"]
    target: Expression | RelativeTarget
    dynamics: Dynamics = Dynamics()


class SpeedEntry(Settings):
    """Speed of a profile, and how long it takes from the entry before."""

    speed: Expression
    """m/s."""
    time_s: Expression | None = None


class SpeedProfileAction(Settings):
    """Brings actors through a series of speeds."""

    kind: Literal["speed_profile"]
    entries: Annotated[tuple[SpeedEntry, ...], Field(min_length=1, max_length=10_000)]
    to: ActorName | None = None
    """Actor that the speeds are relative to."""
    mode: Literal["position", "follow"] = "position"
    accel_mps2: Expression | None = None
    """Largest acceleration where an entry has no time."""
    brake_mps2: Expression | None = None


class LaneTarget(Settings):
    """Lane relative to that of an actor."""

    to: ActorName
    lanes: Expression
    """Positive to the left in the direction of the actor `to`."""


class LaneChangeAction(Settings):
    """Changes the lane."""

    kind: Literal["lane_change"]
    target: Expression | LaneTarget
    """OpenDRIVE's lane id, or lanes beside an actor's."""
    offset_m: Expression = 0.0
    """To the target lane's middle."""
    dynamics: Dynamics


class LaneOffsetAction(Settings):
    """Changes the offset from the lane's middle."""

    kind: Literal["lane_offset"]
    target: Expression | RelativeTarget
    """m, positive to the left."""
    shape: Shape = "step"
    lateral_mps2: Expression | None = None
    """Largest lateral acceleration, by which the duration follows from the shape."""
    continuous: bool = False


class DistanceAction(Settings):
    """Keeps a distance to another actor, along or across."""

    kind: Literal["longitudinal_distance", "lateral_distance"]
    to: ActorName
    distance_m: Expression | None = None
    time_gap_s: Expression | None = None
    """Of a longitudinal distance: over the own speed."""
    freespace: bool = False
    continuous: bool = False
    displacement: Literal["any", "ahead", "behind", "left", "right"] = "any"
    """On which side of the other actor."""
    coordinates: Coordinates = "entity"
    accel_mps2: Expression | None = None
    """Without bounds the distance is reached at once."""
    brake_mps2: Expression | None = None
    speed_mps: Expression | None = None

    @model_validator(mode="after")
    def _one_gap(self) -> Self:
        if self.distance_m is not None and self.time_gap_s is not None:
            raise ConfigError("", "distance_m and time_gap_s", "one of them at most")
        return self


class FinalSpeed(Settings):
    """Speed at the target of a synchronisation, and how long before it is kept."""

    speed: Expression | RelativeTarget
    steady_m: Expression | None = None
    steady_s: Expression | None = None


class SynchroniseAction(Settings):
    """Arrives at a place when another actor arrives at its own."""

    kind: Literal["synchronise"]
    master: ActorName
    master_target: Position
    target: Position
    final_speed: FinalSpeed | None = None
    master_tolerance_m: Expression = 0.0
    tolerance_m: Expression = 0.0


class TrajectoryTiming(Settings):
    """How the times of a trajectory's points count."""

    domain: Literal["absolute", "relative"] = "absolute"
    scale: Expression = 1.0
    offset_s: Expression = 0.0


class FollowTrajectoryAction(Settings):
    """Follows a trajectory, at its own speed or at the times of its points."""

    kind: Literal["follow_trajectory"]
    trajectory: AnyName
    timing: TrajectoryTiming | None = None
    mode: Literal["position", "follow"] = "position"
    from_m: Expression = 0.0
    """Where on the trajectory it begins."""


class AssignRouteAction(Settings):
    """Follows a route from now on."""

    kind: Literal["assign_route"]
    route: AnyName


class AcquirePositionAction(Settings):
    """Drives to a place, by the shortest way."""

    kind: Literal["acquire_position"]
    position: Position


class TeleportAction(Settings):
    """Is moved to a place."""

    kind: Literal["teleport"]
    position: Position


class VisibilityAction(Settings):
    """Appears to traffic and sensors, or vanishes."""

    kind: Literal["visibility"]
    traffic: bool
    sensors: bool


class DeleteAction(Settings):
    """Leaves the scenario."""

    kind: Literal["delete"]
    actor: ActorName | None = None
    """Without it the actors of the group."""


class VariableAction(Settings):
    """Sets or changes a variable; a truth value is 1 or 0."""

    kind: Literal["variable"]
    variable: ElementName
    value: Expression = 0.0
    word: ElementName | None = None
    """In place of a number."""
    how: Literal["set", "add", "multiply"] = "set"


class NoAction(Settings):
    """Ends at once; stands for an action that has no effect here."""

    kind: Literal["none"]


Action = Annotated[
    SpeedAction
    | SpeedProfileAction
    | LaneChangeAction
    | LaneOffsetAction
    | DistanceAction
    | SynchroniseAction
    | FollowTrajectoryAction
    | AssignRouteAction
    | AcquirePositionAction
    | TeleportAction
    | VisibilityAction
    | DeleteAction
    | VariableAction
    | NoAction,
    Field(discriminator="kind"),
]


# Conditions


class _Condition(Settings):
    name: ElementName = "condition"
    delay_s: Expression = 0.0
    edge: Literal["none", "rising", "falling", "rising_or_falling"] = "none"


class _EntityCondition(_Condition):
    of: Annotated[tuple[ActorName, ...], Field(min_length=1, max_length=100)]
    """Actors whose values are compared."""
    which: Literal["any", "all"] = "any"


class TimeCondition(_Condition):
    """Compares the time since the story's start, s."""

    kind: Literal["time"]
    rule: Rule
    value: Expression


class DistanceCondition(_EntityCondition):
    """Compares the distance to an actor or a place, m."""

    kind: Literal["distance"]
    to: ActorName | Position
    rule: Rule
    value: Expression
    along: Along = "euclidean"
    freespace: bool = False
    coordinates: Coordinates = "entity"


class HeadwayCondition(_EntityCondition):
    """Compares the distance to an actor over the own speed, s."""

    kind: Literal["time_headway"]
    to: ActorName
    rule: Rule
    value: Expression
    along: Along = "longitudinal"
    freespace: bool = False
    coordinates: Coordinates = "entity"


class CollisionTimeCondition(_EntityCondition):
    """Compares the time to collision with an actor or a place, s."""

    kind: Literal["time_to_collision"]
    to: ActorName | Position
    rule: Rule
    value: Expression
    along: Along = "longitudinal"
    freespace: bool = True
    coordinates: Coordinates = "entity"


class SpeedCondition(_EntityCondition):
    """Compares speeds, m/s."""

    kind: Literal["speed"]
    rule: Rule
    value: Expression
    direction: Direction | None = None
    """Without it the size of the velocity."""


class RelativeSpeedCondition(_EntityCondition):
    """Compares the speed less that of another actor, m/s."""

    kind: Literal["relative_speed"]
    to: ActorName
    rule: Rule
    value: Expression
    direction: Direction | None = None


class AccelerationCondition(_EntityCondition):
    """Compares accelerations, m/s²."""

    kind: Literal["acceleration"]
    rule: Rule
    value: Expression
    direction: Direction | None = None


class TravelledCondition(_EntityCondition):
    """Holds once an actor travelled so far, m."""

    kind: Literal["travelled"]
    value: Expression


class ReachCondition(_EntityCondition):
    """Holds within a tolerance around a place."""

    kind: Literal["reach"]
    position: Position
    tolerance_m: Expression


class StandStillCondition(_EntityCondition):
    """Holds once an actor stood so long, s."""

    kind: Literal["stand_still"]
    duration_s: Expression


class CollisionCondition(_EntityCondition):
    """Holds while an actor touches another one."""

    kind: Literal["collision"]
    partner: ActorName | None = None
    """Without it any other actor."""


class AngleCondition(_EntityCondition):
    """Holds while a heading is within a tolerance of an angle, rad."""

    kind: Literal["angle"]
    angle_rad: Expression
    tolerance_rad: Expression
    relative: bool = False
    """To the lane; else absolute."""


class OffroadCondition(_EntityCondition):
    """Holds once an actor was off the road, or at its end, so long, s."""

    kind: Literal["offroad", "end_of_road"]
    duration_s: Expression


class StateCondition(_Condition):
    """Holds once a part of the story is in a state."""

    kind: Literal["state"]
    element: ElementName
    of_kind: ElementKind
    state: ElementState


class VariableCondition(_Condition):
    """Compares a variable, or a parameter, with a number or a word."""

    kind: Literal["variable", "parameter"]
    variable: ElementName
    rule: Rule
    value: Expression = 0.0
    word: ElementName | None = None
    """In place of a number."""


Condition = Annotated[
    TimeCondition
    | DistanceCondition
    | HeadwayCondition
    | CollisionTimeCondition
    | SpeedCondition
    | RelativeSpeedCondition
    | AccelerationCondition
    | TravelledCondition
    | ReachCondition
    | StandStillCondition
    | CollisionCondition
    | AngleCondition
    | OffroadCondition
    | StateCondition
    | VariableCondition,
    Field(discriminator="kind"),
]

Trigger = Annotated[tuple[Annotated[tuple[Condition, ...], Field(max_length=100)], ...], Field(max_length=100)]
"""Groups of conditions; it fires once all conditions of one group hold."""


# The storyboard


class NamedAction(Settings):
    """Action of an event."""

    name: ElementName = "action"
    do: Action


class StoryEvent(Settings):
    """Actions that begin together."""

    name: ElementName
    start: Trigger | None = None
    """Without it the event starts with its act."""
    actions: Annotated[tuple[NamedAction, ...], Field(min_length=1, max_length=100)]
    priority: Literal["override", "skip", "parallel"] = "override"
    most: Annotated[int, Field(ge=1, le=1000)] = 1
    """Executions."""


class Maneuver(Settings):
    """Events in a named group."""

    name: ElementName = "maneuver"
    events: Annotated[tuple[StoryEvent, ...], Field(max_length=1000)]


class ManeuverGroup(Settings):
    """Maneuvers of some actors."""

    name: ElementName = "group"
    actors: Annotated[tuple[ActorName, ...], Field(max_length=100)] = ()
    triggering: bool = False
    """Whether the actors that triggered the act are actors too."""
    maneuvers: Annotated[tuple[Maneuver, ...], Field(max_length=100)] = ()
    most: Annotated[int, Field(ge=1, le=1000)] = 1


class StoryAct(Settings):
    """Part of a story with a start and an end."""

    name: ElementName = "act"
    groups: Annotated[tuple[ManeuverGroup, ...], Field(min_length=1, max_length=100)]
    start: Trigger | None = None
    """Without it at time 0."""
    stop: Trigger | None = None


class InitAction(Settings):
    """Action of one actor at time 0."""

    actor: ActorName
    do: Action


class DeviationBounds(Settings):
    """How far a search may lead the actors of a story away from it; with zeros they follow it exactly."""

    accel_mps2: Annotated[float, Field(ge=0, le=10)] = 1.5
    """Added to the acceleration."""
    lateral_mps: Annotated[float, Field(ge=0, le=3)] = 0.5
    """Added to the speed across."""


class Story(Settings):
    """What story actors do from time 0 on, and when the episode ends."""

    routes: Annotated[Mapping[ElementName, RoutePath], Field(max_length=200)] = {}
    trajectories: Annotated[Mapping[ElementName, Trajectory], Field(max_length=200)] = {}
    variables: Annotated[Mapping[ElementName, Expression], Field(max_length=200)] = {}
    """Name → number at time 0; a truth value is 1 or 0."""
    words: Annotated[Mapping[ElementName, ElementName], Field(max_length=200)] = {}
    """Name → word at time 0, of variables that hold words."""
    init: Annotated[tuple[InitAction, ...], Field(max_length=1000)] = ()
    """Beside starts and speeds of the actors themselves."""
    stories: Annotated[Mapping[ElementName, tuple[StoryAct, ...]], Field(max_length=100)] = {}
    stop: Trigger | None = None
    """Ends the episode."""
    deviation: DeviationBounds = DeviationBounds()
    """Of methods that act; a zero action is the story."""
