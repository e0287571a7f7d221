"""Places and actions of a story: positions, routes, trajectories, motions and variables.

Positions are those of OpenSCENARIO XML; values are arithmetic over the document's parameters.
Source: ASAM OpenSCENARIO XML 1.3, class reference.
"""

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
    """Point in an actor's axes, or in the world's axes through it."""

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
    """Trajectory of clothoids, of which arcs and lines are special cases."""

    kind: Literal["clothoids"]
    segments: Annotated[tuple[ClothoidSegment, ...], Field(min_length=1, max_length=1000)]
    end_time_s: Expression | None = None


Trajectory = Annotated[Polyline | ClothoidSpline, Field(discriminator="kind")]

Coordinates = Literal["entity", "lane", "road", "trajectory"]
Shape = Literal["step", "linear", "sinusoidal", "cubic"]


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
    """Speed of a profile, and the time to reach it."""

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
    """Speed at a synchronisation's target, and how long it is kept before."""

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
    """Meaning of the times of a trajectory's points."""

    domain: Literal["absolute", "relative"] = "absolute"
    scale: Expression = 1.0
    offset_s: Expression = 0.0


class FollowTrajectoryAction(Settings):
    """Follows a trajectory at the actor's speed or at its points' times."""

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
