"""Places of a story: positions become poses in the net's coordinates, and poses become places on lanes.

Source: ASAM OpenSCENARIO XML 1.3, class reference: positions, and its sections on coordinate systems and routes.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from risk_sac.config.story import Position, Story
from risk_sac.errors import ConfigError
from risk_sac.scenario.travel_line import Pose, TravelLine, line_of
from risk_sac.scenario.value import Value
from risk_sac.world.net import Net, NetLane, once
from risk_sac.world.road_geometry import TOLERANCE_M, Across, RoadFile, Roadway
from risk_sac.world.types import Floats

FARTHEST_M = 30.0  # of a pose from the line of its lane
Of = Callable[[str], Pose]


class Spot(NamedTuple):
    """Place on a lane of the SUMO net."""

    lane: NetLane
    at_m: float  # along the lane's line
    left_m: float  # of the lane's line


class OnRoad(NamedTuple):
    """Place on a lane of the road file."""

    road: str
    lane: int
    s_m: float
    offset_m: float  # of the lane's middle, positive to the left of the reference line's direction


class Places:
    """Places of one net and of the road file that it was converted from."""

    def __init__(self, net: Net, road: RoadFile | None, story: Story, value: Value) -> None:
        """Prepares to find places.

        Args:
          net: SUMO's.
          road: the OpenDRIVE file; without it only points, relative positions and SUMO's lanes can be found.
          story: with the routes and trajectories that positions name.
          value: of the scene's parameters.
        """
        self._net, self._road, self._story, self._value = net, road, story, value

    def pose(self, position: Position, of: Of) -> Pose:
        """Returns the pose of a position in the net's coordinates.

        Args:
          position: in the road file's coordinates.
          of: returns the present pose of an actor's reference point.

        Raises:
          ConfigError: there is no such place; `field` is that of the position.
        """
        number = self._number
        if position.kind == "world":
            x_m, y_m = (
                number(position.x_m, "x_m") + self._net.shift_m[0],
                number(position.y_m, "y_m") + self._net.shift_m[1],
            )
            if position.heading_rad is not None:
                return Pose(x_m, y_m, number(position.heading_rad, "heading_rad"))
            near = nearest_lane(self._net, x_m, y_m, None)
            return Pose(x_m, y_m, _direction(near) if near is not None else 0.0)
        turned = number(position.heading_rad, "heading_rad")
        base = self._base(position, of)
        return base._replace(heading_rad=turned if position.heading == "absolute" else base.heading_rad + turned)

    def _base(self, position: Position, of: Of) -> Pose:
        """Returns the pose of a position without its own heading."""
        number = self._number
        match position.kind:
            case "lane":
                lane = round(number(position.lane, "lane"))
                s_m, offset_m = number(position.s_m, "s_m"), number(position.offset_m, "offset_m")
                return self._on_lane(OnRoad(self._value.choose(position.road), lane, s_m, offset_m))
            case "relative_lane":
                here = self.opendrive(of(position.to))
                lane = lanes_beside(here.lane, round(number(position.lanes, "lanes")))
                ds_m, offset_m = number(position.ds_m, "ds_m"), number(position.offset_m, "offset_m")
                return self._on_lane(OnRoad(here.road, lane, here.s_m + ds_m, offset_m))
            case _:
                raise ConfigError("kind", position.kind, "lane or relative_lane")

    def _number(self, expression: str | float, field: str) -> float:
        return self._value.of(expression, field)

    def _roads(self) -> RoadFile:
        if self._road is None:
            raise ConfigError("road", "a position on a road, and no road file", "an OpenDRIVE file beside the net")
        return self._road

    def _on_lane(self, place: OnRoad) -> Pose:
        """Returns the pose on a lane, in the direction of its traffic."""
        road = self._roads().road(place.road)
        s_m = _within(road, place.s_m)
        middle = road.middle(place.lane, s_m)
        x_m, y_m, heading = road.point(s_m, Across(middle.t_m + place.offset_m, middle.slope))
        return self._shifted(x_m, y_m, heading + (math.pi if road.backwards(place.lane) else 0.0))

    def _shifted(self, x_m: float, y_m: float, heading_rad: float) -> Pose:
        return Pose(x_m + self._net.shift_m[0], y_m + self._net.shift_m[1], heading_rad)

    def spot(self, pose: Pose) -> Spot | None:
        """Returns the place on the nearest lane of the pose's direction; None if there is none within 30 m."""
        return nearest_lane(self._net, pose.x_m, pose.y_m, pose.heading_rad)

    def beside(self, spot: Spot, lanes: int) -> Spot | None:
        """Returns the place as many lanes to the left, at the same height; None if no car drives there."""
        other = self._net.lanes.get(f"{spot.lane.edge}_{spot.lane.index + lanes}")
        if other is None or not other.drivable:
            return None
        x_m, y_m, _ = line_of(spot.lane.centre).pose(spot.at_m, spot.left_m)
        at_m, left_m = line_of(other.centre).project(x_m, y_m)
        return Spot(other, at_m, left_m)

    def ahead(self, spot: Spot, length_m: float, edges: Sequence[str] = ()) -> TravelLine:
        """Returns the way on from a place, along the middles of lanes.

        Args:
          spot: where it begins; its offset is left out.
          length_m: after which it may end; it ends before where no lane goes on.
          edges: of a route; without them, and after them, the straightest way.
        """
        line = line_of(spot.lane.centre)
        points, lane = [line.points[line.station_m > spot.at_m]], spot.lane
        begin = np.array([line.pose(spot.at_m)[:2]])
        left_m = length_m - (line.length_m - spot.at_m)
        while left_m > 0.0:
            links = sorted(self._net.onward.get(lane.id, ()), key=lambda link: abs(link.turn_rad))
            links = [link for link in links if link.target.edge in edges] or links
            if not links:
                break
            for lane in (*links[0].inside, links[0].target):
                points.append(lane.centre)
                left_m -= line_of(lane.centre).length_m
        return line_of(np.concatenate([begin, *points]))

    def opendrive(self, pose: Pose) -> OnRoad:
        """Returns road, lane, s and offset of a pose; raises `ConfigError` if no road is near."""
        roads, best = self._roads(), None
        x_m, y_m = pose.x_m - self._net.shift_m[0], pose.y_m - self._net.shift_m[1]
        for road in roads.roads.values():
            s_m, t_m = road.project(x_m, y_m)
            lane = road.lane_at(s_m, t_m)
            middle = road.middle(lane, s_m)
            x, y, heading = road.point(s_m, middle)
            apart = math.remainder(heading + (math.pi if road.backwards(lane) else 0.0) - pose.heading_rad, math.tau)
            outside = max(math.hypot(x - x_m, y - y_m) - road.width_m(lane, s_m) / 2, 0.0)
            rank = (outside, abs(apart) > math.pi / 2, abs(apart) > math.radians(20.0), abs(t_m - middle.t_m))
            if best is None or rank < best[0]:
                best = rank, OnRoad(road.id, lane, s_m, t_m - middle.t_m)
        if best is None or best[0][0] > FARTHEST_M:
            raise ConfigError("", f"the point {x_m:.1f}, {y_m:.1f} without a road near it", "a point on a road")
        return best[1]


def lanes_beside(lane: int, lanes: int) -> int:
    """Returns the lane id as many lanes on; there is no lane 0."""
    other = lane + lanes
    return other if lane * other > 0 else other + (1 if lanes > 0 else -1) if lanes else lane


def _within(road: Roadway, s_m: float) -> float:
    if not -TOLERANCE_M <= s_m <= road.length_m + TOLERANCE_M:
        raise ConfigError("s_m", f"{s_m:g} m along road {road.id!r}", f"0 to {road.length_m:g}")
    return min(max(s_m, 0.0), road.length_m)


@once
def _pieces(net: Net) -> tuple[list[NetLane], Floats]:
    """Pieces of the lines of all lanes for cars: the lanes, and x, y, dx, dy, length and station of each."""
    lanes, rows = list[NetLane](), list[Floats]()
    for lane in net.lanes.values():
        if not lane.drivable or lane.use not in ("lane", "inside"):
            continue
        line = line_of(lane.centre)
        steps = np.diff(line.points, axis=0)
        lengths = np.diff(line.station_m)
        rows.append(np.column_stack((line.points[:-1], steps / lengths[:, None], lengths, line.station_m[:-1])))
        lanes += [lane] * len(lengths)
    return lanes, np.concatenate(rows) if rows else np.empty((0, 6))


def nearest_lane(net: Net, x_m: float, y_m: float, heading_rad: float | None) -> Spot | None:
    """Returns the place on the nearest lane for cars within 30 m.

    Args:
      net: where.
      x_m: of the point.
      y_m: of the point.
      heading_rad: within 90° of which the lane leads; None: any lane.
    """
    lanes, rows = _pieces(net)
    x, y, cos, sin, lengths, stations = rows.T
    along = (x_m - x) * cos + (y_m - y) * sin
    left = (y_m - y) * cos - (x_m - x) * sin
    on = np.clip(along, 0.0, lengths)
    apart = np.hypot(along - on, left)
    if heading_rad is not None:
        fit = cos * math.cos(heading_rad) + sin * math.sin(heading_rad)
        apart = np.where(fit > 0.0, apart, np.inf)
    if not len(apart) or not apart.min() <= FARTHEST_M:
        return None
    i = int(np.argmin(apart))
    return Spot(lanes[i], float(stations[i] + on[i]), float(left[i]))


def _direction(spot: Spot) -> float:
    return line_of(spot.lane.centre).pose(spot.at_m).heading_rad
