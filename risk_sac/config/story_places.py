"""Places of a story: positions, routes and trajectories.

Positions are those of OpenSCENARIO XML; values are arithmetic over the document's parameters.
Source: ASAM OpenSCENARIO XML 1.3, class reference.
"""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from risk_sac.config.base import Chosen, Settings
from risk_sac.config.values import Expression

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
