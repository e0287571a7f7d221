"""Places of a story: positions become poses, and poses places on lanes.

Source: ASAM OpenSCENARIO XML 1.3, class reference: positions, and its sections on coordinate systems and routes.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from risk_sac.config.story import Story
from risk_sac.config.story_actions import LanePosition, Position, RelativeLanePosition, RoutePosition, WorldPosition
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.scenario import lane_places
from risk_sac.scenario.space import Value
from risk_sac.scenario.travel_line import Pose, TravelLine, line_of, trajectory_line
from risk_sac.world.net import Net
from risk_sac.world.plane_curves import Across
from risk_sac.world.road_geometry import TOLERANCE_M, RoadFile, Roadway
from risk_sac.world.road_links import LaneEnd, RoadLeg, leg_line, onward, road_path
from risk_sac.world.types import Floats

EDGE_M = 2.0  # between the places of a line whose edges are looked up
Of = Callable[[str], Pose]


class OnRoad(NamedTuple):
    """Place on a lane of the road file."""

    road: str
    lane: int
    s_m: float
    offset_m: float  # of the lane's middle, positive to the left of the reference line's direction


class RouteLine(NamedTuple):
    """Way of a route."""

    line: TravelLine  # along the middles of lanes
    edges: tuple[str, ...]  # of the SUMO net


class StoryPlaces:
    """Places on a net and on the road file it comes from."""

    def __init__(self, net: Net, road: RoadFile | None, story: Story, value: Value) -> None:
        """Prepares; without `road` finds only points, relative positions and SUMO's lanes."""
        self._net, self._road, self._story, self._value = net, road, story, value
        self._open = list[str]()  # trajectories that are being resolved

    # Positions

    def pose(self, position: Position, of: Of) -> Pose:
        """Returns the pose of a road file's position in the net.

        `of` has actors' present poses.

        Raises:
          ConfigError: there is no such place; `field` is that of the position.
        """
        if isinstance(position, WorldPosition):
            return self._point(position)
        turned = self._number(position.heading_rad, "heading_rad")
        base = self._base(position, of)
        return base._replace(heading_rad=turned if position.heading == "absolute" else base.heading_rad + turned)

    def _point(self, position: WorldPosition) -> Pose:
        x_m, y_m = self._number(position.x_m, "x_m"), self._number(position.y_m, "y_m")
        here = self._shifted(x_m, y_m, 0.0)
        if position.heading_rad is not None:
            return here._replace(heading_rad=self._number(position.heading_rad, "heading_rad"))
        near = lane_places.nearest_lane(self._net, here.x_m, here.y_m, None)
        return here if near is None else here._replace(heading_rad=lane_places.spot_pose(near).heading_rad)

    def _base(self, position: Position, of: Of) -> Pose:
        number = self._number
        match position.kind:
            case "lane":
                return self.lane_pose(self.on_road(position))
            case "road":
                road = self._roads().road(self._value.choose(position.road))
                return self._beside(road, _within(road, number(position.s_m, "s_m")), number(position.t_m, "t_m"))
            case "relative_lane":
                return self._relative_lane(position, of(position.to))
            case "relative_road":
                here = self.opendrive(of(position.to))
                road = self._roads().road(here.road)
                t_m = road.middle(here.lane, here.s_m).t_m + here.offset_m + number(position.dt_m, "dt_m")
                leg, forward = self._along_road(here, number(position.ds_m, "ds_m"))
                there = self._beside(self._roads().road(leg.road), leg.to_m, t_m if forward else -t_m)
                return there if forward else there._replace(heading_rad=there.heading_rad + math.pi)
            case "relative":
                x_m, y_m, heading = of(position.to)
                dx, dy = number(position.dx_m, "dx_m"), number(position.dy_m, "dy_m")
                cos, sin = (math.cos(heading), math.sin(heading)) if position.axes == "actor" else (1.0, 0.0)
                return Pose(x_m + cos * dx - sin * dy, y_m + sin * dx + cos * dy, heading)
            case "on_route":
                return self._on_route(position, of)
            case "on_trajectory":
                line = self.trajectory(self._value.choose(position.trajectory), of)
                s_m, t_m = number(position.s_m, "s_m"), number(position.t_m, "t_m")
                if not -TOLERANCE_M <= s_m <= line.length_m + TOLERANCE_M:
                    raise ConfigError("s_m", f"{s_m:g} m along a trajectory", f"0 to {line.length_m:g}")
                return line.pose(s_m, t_m)._replace(heading_rad=line.direction_rad(s_m))
            case _:
                raise ConfigError("kind", repr(position.kind), "another kind of position")

    def _number(self, expression: str | float, field: str) -> float:
        return self._value.of(expression, field)

    def _roads(self) -> RoadFile:
        if self._road is None:
            raise ConfigError("road", "a position on a road, and no road file", "an OpenDRIVE file beside the net")
        return self._road

    def on_road(self, position: LanePosition) -> OnRoad:
        """Returns the place on a road of a position on a lane."""
        lane = self._whole(position.lane, "lane")
        s_m, offset_m = self._number(position.s_m, "s_m"), self._number(position.offset_m, "offset_m")
        return OnRoad(self._value.choose(position.road), lane, s_m, offset_m)

    def _whole(self, expression: str | float, field: str) -> int:
        number = self._number(expression, field)
        if abs(number - round(number)) > 1e-6:
            raise ConfigError(field, f"{number:g}", "a whole number")
        return round(number)

    def lane_pose(self, place: OnRoad) -> Pose:
        """Returns the pose of a lane place, facing along its traffic."""
        road = self._roads().road(place.road)
        s_m = _within(road, place.s_m)
        middle = road.middle(place.lane, s_m)
        x_m, y_m, heading = road.point(s_m, Across(middle.t_m + place.offset_m, middle.slope))
        return self._shifted(x_m, y_m, heading + (math.pi if road.backwards(place.lane) else 0.0))

    def _beside(self, road: Roadway, s_m: float, t_m: float) -> Pose:
        """Returns the pose beside a reference line, in its direction."""
        return self._shifted(*road.point(s_m, Across(t_m, 0.0)))

    def _shifted(self, x_m: float, y_m: float, heading_rad: float) -> Pose:
        return Pose(x_m + self._net.shift_m[0], y_m + self._net.shift_m[1], heading_rad)

    def _relative_lane(self, position: RelativeLanePosition, other: Pose) -> Pose:
        ds_m, offset_m = self._number(position.ds_m, "ds_m"), self._number(position.offset_m, "offset_m")
        lanes = self._whole(position.lanes, "lanes")
        if self._road is None:
            return self._relative_spot(other, lanes, ds_m, offset_m)
        here = self.opendrive(other)
        if position.along == "road":
            leg, same = self._along_road(here, ds_m)
        else:
            faces = self.lane_pose(here._replace(offset_m=0.0)).heading_rad
            ahead = math.cos(faces - other.heading_rad) >= 0.0
            forward = (not self._road.road(here.road).backwards(here.lane)) == ahead
            leg = self._walk(here, abs(ds_m), forward=forward == (ds_m >= 0.0), by_lane=True)
            same = leg.forward == (forward == (ds_m >= 0.0))
        lane = lanes_beside(leg.out, lanes if same else -lanes)
        return self.lane_pose(OnRoad(leg.road, lane, leg.to_m, offset_m if same else -offset_m))

    def _relative_spot(self, other: Pose, lanes: int, ds_m: float, offset_m: float) -> Pose:
        """Returns the pose on SUMO's lanes; their direction replaces the reference line's."""
        spot = self.spot(other)
        there = lane_places.beside(self._net, spot, lanes) if spot is not None else None
        if there is None:
            raise ConfigError("lanes", f"{lanes} lanes left of a pose", "a lane for cars")
        line = self.ahead(there, max(ds_m, 0.0)) if there.at_m + ds_m >= 0.0 else None
        if line is None or line.length_m < ds_m - TOLERANCE_M:
            raise ConfigError("ds_m", f"{ds_m:g} m along lane {there.lane.id!r}", "a place on the road")
        return line.pose(ds_m, offset_m)

    def _along_road(self, here: OnRoad, ds_m: float) -> tuple[RoadLeg, bool]:
        """Follows reference lines; returns the last leg and if its direction agrees."""
        leg = self._walk(here, abs(ds_m), forward=ds_m >= 0.0, by_lane=False)
        return leg, leg.forward == (ds_m >= 0.0)

    def _walk(self, here: OnRoad, distance_m: float, *, forward: bool, by_lane: bool) -> RoadLeg:
        begin = LaneEnd(here.road, here.lane, forward)
        legs, missing_m = onward(self._roads(), begin, here.s_m, distance_m, by_lane=by_lane)
        if missing_m > 0.0:
            got = f"{distance_m:g} m on along lane {here.lane} of road {here.road!r}"
            raise ConfigError("ds_m", got, f"at most {distance_m - missing_m:g} m, where the lane ends")
        return legs[-1]

    # Places of poses

    def spot(self, pose: Pose, on: OnRoad | None = None) -> lane_places.LanePlace | None:
        """Returns the place on the nearest lane within 30 m, or None.

        The lanes of the net at `on` are preferred.
        """
        among = (f"{on.road}_{on.lane}",) if on is not None else ()
        return lane_places.nearest_lane(self._net, pose.x_m, pose.y_m, pose.heading_rad, among)

    def beside(self, spot: lane_places.LanePlace, lanes: int) -> lane_places.LanePlace | None:
        """Returns the place `lanes` to the left, at equal height, or None."""
        return lane_places.beside(self._net, spot, lanes)

    def opendrive(self, pose: Pose) -> OnRoad:
        """Returns a pose's road, lane, s and offset; raises `ConfigError` off roads.

        Of several roads the one is taken whose lane holds the pose, whose traffic goes its way, and is nearest.
        """
        roads = self._roads()
        x_m, y_m = pose.x_m - self._net.shift_m[0], pose.y_m - self._net.shift_m[1]
        best, places = None, roads.near(x_m, y_m)
        for road, near_m in places:
            s_m, t_m = road.project(x_m, y_m, near_m)
            lane = road.lane_at(s_m, t_m)
            middle = road.middle(lane, s_m)
            x, y, heading = road.point(s_m, middle)
            turned = abs(math.remainder(heading + math.pi * road.backwards(lane) - pose.heading_rad, math.tau))
            outside = max(math.hypot(x - x_m, y - y_m) - road.width_m(lane, s_m) / 2, 0.0)
            rank = (round(outside, 2), turned > math.pi / 2, round(turned, 2), abs(t_m - middle.t_m))
            if best is None or rank < best[0]:
                best = rank, OnRoad(road.id, lane, s_m, t_m - middle.t_m)
        if best is None or best[0][0] > lane_places.FARTHEST_M:
            raise ConfigError("", f"the point {x_m:.1f}, {y_m:.1f} without a road near it", "a point on a road")
        return best[1]

    def across(self, place: OnRoad) -> tuple[float, float]:
        """Returns the reference line's direction, rad, and distance left of it, m."""
        road = self._roads().road(place.road)
        t_m = road.middle(place.lane, place.s_m).t_m + place.offset_m
        return self._beside(road, place.s_m, t_m).heading_rad, t_m

    # Lines

    def trajectory(self, name: str, of: Of, start: Pose | None = None) -> TravelLine:
        """Returns the line of one of the story's trajectories.

        `start` is for one that does not say where it begins.

        Raises:
          ConfigError: there is none of this name, it names itself, or its times go back.
        """
        trajectories = self._story.trajectories
        if name not in trajectories:
            known = list(trajectories)
            raise ConfigError("trajectory", repr(name), f"one of {', '.join(known)}", did_you_mean(name, known))
        if name in self._open:
            raise ConfigError("trajectory", f"{name!r}, which names itself", "positions that can be resolved")
        self._open.append(name)
        try:
            return trajectory_line(trajectories[name], lambda position: self.pose(position, of), self._number, start)
        finally:
            self._open.pop()

    def route(self, name: str, of: Of) -> RouteLine:
        """Returns a route's way: the line along lanes, and the net's edges.

        Raises:
          ConfigError: there is none of this name, or no lane leads from one waypoint to the next.
        """
        if self._road is None:
            poses = [self.pose(waypoint, of) for waypoint in self._waypoints(name)]
            edges = lane_places.joined(
                self._net, [spot.lane.edge for pose in poses if (spot := self.spot(pose)) is not None]
            )
            first = self.spot(poses[0])
            if first is None:
                raise ConfigError("waypoints", "a first waypoint without a lane near it", "a point on a lane")
            length_m = sum(self._net.edges[edge].lanes[0].length_m for edge in edges)
            return RouteLine(self.ahead(first, length_m, edges), tuple(edges))
        line = self._leg_lines(self._legs(name, of))
        return RouteLine(line, self.edges(line))

    def way(self, here: Pose, there: Pose) -> RouteLine:
        """Returns the shortest way along lanes between poses; raises `ConfigError` without one."""
        if self._road is not None:
            line = self._leg_lines(self._between([self.opendrive(here), self.opendrive(there)]))
            return RouteLine(line, self.edges(line))
        first, last = self.spot(here), self.spot(there)
        if first is None or last is None:
            raise ConfigError("position", "a place without a lane near it", "a place near a lane")
        edges = tuple(lane_places.joined(self._net, [first.lane.edge, last.lane.edge]))
        return RouteLine(
            self.ahead(first, sum(self._net.edges[edge].lanes[0].length_m for edge in edges), edges), edges
        )

    def edges(self, line: TravelLine) -> tuple[str, ...]:
        """Returns the net's edges along a line, without gaps."""
        stations = np.linspace(0.0, line.length_m, max(2, math.ceil(line.length_m / EDGE_M) + 1))
        spots = (
            self.spot(line.pose(station)._replace(heading_rad=line.direction_rad(station))) for station in stations
        )
        return tuple(
            lane_places.joined(self._net, [s.lane.edge for s in spots if s is not None and s.lane.use == "lane"])
        )

    def _waypoints(self, name: str) -> Sequence[Position]:
        routes = self._story.routes
        if name not in routes:
            raise ConfigError("route", repr(name), f"one of {', '.join(routes)}", did_you_mean(name, list(routes)))
        path = routes[name]
        return (*path.waypoints, path.waypoints[0]) if path.closed else path.waypoints

    def _legs(self, name: str, of: Of) -> list[RoadLeg]:
        places = [
            self.on_road(waypoint) if isinstance(waypoint, LanePosition) else self.opendrive(self.pose(waypoint, of))
            for waypoint in self._waypoints(name)
        ]
        return self._between(places)

    def _between(self, places: Sequence[OnRoad]) -> list[RoadLeg]:
        """Returns legs of the shortest ways from each place to the next."""
        roads, legs = self._roads(), list[RoadLeg]()
        for here, there in itertools.pairwise(places):
            begin, goal = (LaneEnd(p.road, p.lane, not roads.road(p.road).backwards(p.lane)) for p in (here, there))
            from_m, to_m = (_within(roads.road(place.road), place.s_m) for place in (here, there))
            for place in (here, there):
                roads.road(place.road).middle(place.lane, place.s_m)  # the lane is there
            legs += road_path(roads, begin, from_m, goal, to_m)
        return legs

    def _leg_lines(self, legs: Sequence[RoadLeg]) -> TravelLine:
        rows: Floats = np.concatenate([leg_line(self._roads().road(leg.road), leg) for leg in legs])
        return line_of(rows[:, :2] + np.array(self._net.shift_m), np.unwrap(rows[:, 2]))

    def _on_route(self, position: RoutePosition, of: Of) -> Pose:
        """Returns the pose along a route.

        Lane ids, offsets and t count in the route's direction: lanes right of it are negative. The standard leaves
        this open; so the Euro NCAP collection means it.
        """
        legs = self._legs(self._value.choose(position.route), of)
        s_m = left_m = self._number(position.s_m, "s_m")
        for leg in legs:
            if left_m <= leg.length_m + TOLERANCE_M:
                break
            left_m -= leg.length_m
        if not -TOLERANCE_M <= left_m <= leg.length_m + TOLERANCE_M:
            raise ConfigError("s_m", f"{s_m:g} m along a route", f"0 to {sum(leg.length_m for leg in legs):g}")
        side = 1 if leg.forward else -1
        road, at_m = self._roads().road(leg.road), leg.from_m + side * left_m
        if position.lane is None:
            across = Across(side * self._number(position.t_m, "t_m"), 0.0)
        else:
            middle = road.middle(side * self._whole(position.lane, "lane"), at_m)
            across = Across(middle.t_m + side * self._number(position.offset_m, "offset_m"), middle.slope)
        there = self._shifted(*road.point(at_m, across))
        return there if leg.forward else there._replace(heading_rad=there.heading_rad + math.pi)

    def ahead(self, spot: lane_places.LanePlace, length_m: float, edges: Sequence[str] = ()) -> TravelLine:
        """Returns the way on from a place, without offset, along lanes' middles.

        It is shorter than `length_m` where no lane goes on; without edges, and after them, it is the straightest.
        """
        place = self._named(spot)
        if place is None:
            lanes = lane_places.lanes_ahead(self._net, spot.lane, length_m + spot.at_m, edges)
            line = line_of(np.concatenate([lane.centre for lane in lanes]))
            return line.cut(spot.at_m, min(spot.at_m + length_m, line.length_m))
        roads = self._roads()
        lanes = lane_places.lanes_ahead(self._net, spot.lane, length_m, edges) if edges else []
        keep = {name.rpartition("_")[0] for lane in lanes for name in lane.original}
        begin = LaneEnd(place.road, place.lane, not roads.road(place.road).backwards(place.lane))
        legs, _ = onward(roads, begin, place.s_m, length_m, keep)
        return self._leg_lines(legs)

    def _named(self, spot: lane_places.LanePlace) -> OnRoad | None:
        if self._road is None:
            return None
        x_m, y_m, _ = lane_places.lane_line(spot.lane).pose(spot.at_m)
        x_m, y_m = x_m - self._net.shift_m[0], y_m - self._net.shift_m[1]
        places = list[tuple[float, OnRoad]]()
        for name in spot.lane.original:
            id_, _, lane = name.rpartition("_")
            road = self._road.roads.get(id_)
            if road is not None and lane.lstrip("-").isdigit():
                s_m, t_m = road.project(x_m, y_m)
                if int(lane) in road.section(s_m).lanes:
                    apart = abs(t_m - road.middle(int(lane), s_m).t_m)
                    places.append((apart, OnRoad(id_, int(lane), s_m, 0.0)))
        return min(places)[1] if places else None


def lanes_beside(lane: int, lanes: int) -> int:
    """Returns the lane id `lanes` further on; there is no lane 0."""
    other = lane + lanes
    return other if lane * other > 0 or lanes == 0 else other + (1 if lanes > 0 else -1)


def _within(road: Roadway, s_m: float) -> float:
    if not -TOLERANCE_M <= s_m <= road.length_m + TOLERANCE_M:
        raise ConfigError("s_m", f"{s_m:g} m along road {road.id!r}", f"0 to {road.length_m:g}")
    return min(max(s_m, 0.0), road.length_m)
