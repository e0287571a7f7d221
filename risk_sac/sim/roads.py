"""Lanes, signals and lateral room around the route; placing of vehicles."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from itertools import takewhile
from typing import NamedTuple, Protocol

import libsumo
import numpy as np
import shapely

from risk_sac.config import EgoConfig
from risk_sac.scenario.bodies import BODIES
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.limits import GRAVITY_MPS2, emergency_decel_mps2
from risk_sac.sim.paths import (
    CAR,
    HEADING,
    STATION,
    Along,
    Way,
    X,
    Y,
    car_may_use,
    controlled_links,
    edge_of,
    leads_on,
    needs_lane_change,
    way_of,
)
from risk_sac.sim.reading import COLOURS, NONE
from risk_sac.world.types import Floats, Lane, Road, Role, Signal, StopLine

KEEP_ROUTE = 1  # of SUMO's `moveToXY`: the nearest place on the route
REACH_M = 600.0  # of the route; no episode drives farther
LEFT, RIGHT = 1, -1
ANYWHERE = "ignoring"  # class that SUMO refuses on no lane


def road_around(route: Sequence[str]) -> Road:
    """Returns the road around a route: its lanes, and its junctions' lanes.

    Stop lines are those before the route's lanes: an ego does not see the signals of other directions.
    """
    near = _edges_near(route)
    ids = [id_ for edge in near for id_ in _lanes_of(edge) if car_may_use(id_)]
    links = {id_: [link[4] or link[0] for link in libsumo.lane.getLinks(id_)] for id_ in ids}
    on_route = _on_route(route, ids, links)
    lanes = tuple(_lane(id_, ids, [each for each in links[id_] if each in links], id_ in on_route) for id_ in ids)
    signals = controlled_links()
    stop_lines = tuple(
        StopLine(lane.id, leads_to, *signals[lane.id, leads_to])
        for lane in lanes
        if edge_of(lane.id) in route
        for leads_to in lane.successors
        if (lane.id, leads_to) in signals
    )
    return Road(lanes, stop_lines)


def signals_at(stop_lines: Sequence[StopLine]) -> tuple[Signal, ...]:
    """Returns what the signal of each stop line shows now."""
    signals = {line.signal for line in stop_lines}
    states = {signal: libsumo.trafficlight.getRedYellowGreenState(signal) for signal in signals}
    return tuple([COLOURS.get(states[signal][link], NONE) for _, _, signal, link in stop_lines])


def _edges_near(route: Sequence[str]) -> Iterable[str]:
    """Returns the route's edges, and those that meet them at junctions."""
    found, reached_m = dict.fromkeys(route[:1]), 0.0
    for edge in route:
        if reached_m > REACH_M:
            break
        reached_m += libsumo.lane.getLength(f"{edge}_0")
        for junction in (libsumo.edge.getFromJunction(edge), libsumo.edge.getToJunction(edge)):
            found |= dict.fromkeys(libsumo.junction.getIncomingEdges(junction))
            found |= dict.fromkeys(libsumo.junction.getOutgoingEdges(junction))
    return found


def _lanes_of(edge: str) -> list[str]:
    return [f"{edge}_{i}" for i in range(libsumo.edge.getLaneNumber(edge))]


def _on_route(route: Sequence[str], ids: Sequence[str], links: dict[str, list[str]]) -> set[str]:
    """Returns lanes that lead along the route, on edges and through junctions."""
    found = {id_ for id_ in ids if edge_of(id_) in route and leads_on(route, id_)}
    for id_ in sorted(found):
        edge = edge_of(id_)
        if edge in route[:-1]:
            following = route[route.index(edge) + 1]
            for via in links[id_]:
                found |= _through(via, following, links)
    return found


def _through(lane: str, following: str, links: dict[str, list[str]]) -> set[str]:
    """Collects the lanes of a way through a junction.

    `lane` is its first one; there are none if the way does not lead to the `following` edge.
    """
    way: set[str] = set()
    while lane in links and lane.startswith(":") and lane not in way:
        way.add(lane)
        lane = next(iter(links[lane]), "")
    return way if edge_of(lane) == following else set()


def _lane(id_: str, ids: Sequence[str], successors: Sequence[str], on_route: bool) -> Lane:
    edge, _, index = id_.rpartition("_")
    left, right = f"{edge}_{int(index) + 1}", f"{edge}_{int(index) - 1}"
    return Lane(
        id=id_,
        line=np.array(libsumo.lane.getShape(id_)).T,
        width_m=libsumo.lane.getWidth(id_),
        limit_mps=libsumo.lane.getMaxSpeed(id_),
        left=left if left in ids else "",
        right=right if right in ids else "",
        may_change_left=left in ids and CAR in libsumo.lane.getChangePermissions(id_, LEFT),
        may_change_right=right in ids and CAR in libsumo.lane.getChangePermissions(id_, RIGHT),
        successors=tuple(successors),
        on_route=on_route,
    )


EDGE_M = 0.01  # SUMO refuses a lateral step that ends exactly on the edge of the road
ROUNDED_M = 0.05  # by which a lane's length may differ from that of its line without a word


class LateralRoom(NamedTuple):
    """Lateral room up to the edges of the drivable lanes.

    It counts from a vehicle's sides, or from a lane's middle.
    """

    left_m: float
    right_m: float


class RouteLane(NamedTuple):
    """A lane as a vehicle's route sees it; see `Roads.lane`."""

    way: Way  # from the start of the lane on
    room: LateralRoom  # from its middle to the edges of the lanes that lead on
    stretch: float  # length of its line / its length


class Placed(Protocol):
    """Lane and path place of a vehicle that SUMO does not drive."""

    lane: str
    along: Along


class Roads:
    """Roads of an episode's vehicles; answers are cached for the same net.

    Attributes:
      moved: the adversaries that SUMO does not drive.
    """

    moved: Mapping[str, Placed]

    def __init__(self) -> None:
        self._net = ""
        self._set_speed_mps = math.inf
        self.moved = {}
        self._routes: dict[str, tuple[str, ...]] = {}

    def enter(self, layout: Layout) -> None:
        """Begins an episode."""
        self._routes = {start.id: start.route for start in (layout.ego, *layout.vehicles)}
        self._uses_oncoming = {start.id for start in layout.vehicles if start.uses_oncoming}
        self.moved = {}
        if (layout.net, layout.set_speed_mps) != (self._net, self._set_speed_mps):  # of the same names, or other limits
            self._net, self._set_speed_mps = layout.net, layout.set_speed_mps
            self._lane, self._oncoming_m = cache(_route_lane), cache(_oncoming_m)

    def along(self, vehicle: str) -> Along:
        """Locates a vehicle on its path."""
        if (moved := self.moved.get(vehicle)) is not None:
            return moved.along
        _, way, _, station_m = self._on_lane(vehicle)
        return Along(way.path, station_m, libsumo.vehicle.getLateralLanePosition(vehicle), way.ends_m)

    def lane(self, vehicle: str, lane: str) -> RouteLane:
        """Returns a lane as a vehicle's route sees it."""
        return self._lane(self._routes[vehicle], lane)

    def way_ahead(self, vehicle: str, x_m: float, y_m: float) -> tuple[Floats, Floats]:
        """Returns x and y of a vehicle's way ahead, its centre first."""
        path, station_m, offset_m, _ = self.along(vehicle)
        ahead = path[:, path[STATION] > station_m]
        sin, cos = np.sin(ahead[HEADING]), np.cos(ahead[HEADING])
        x = np.concatenate(([x_m], ahead[X] - offset_m * sin))
        y = np.concatenate(([y_m], ahead[Y] + offset_m * cos))
        return x, y

    def place(self, vehicle: str, offset_m: float, width_m: float) -> tuple[LateralRoom, Along]:
        """Returns a vehicle's sideways room, and its place on its path.

        Of its edge, only lanes that its route continues from count: SUMO halts a vehicle at the end of any other. To
        their left come oncoming lanes, for a vehicle that uses them. `offset_m` is that of its centre from its lane's,
        positive to the left.
        """
        if (moved := self.moved.get(vehicle)) is None:
            lane, way, room, station_m = self._on_lane(vehicle)
            along = Along(way.path, station_m, offset_m, way.ends_m)
        else:
            lane, along, room = moved.lane, moved.along, self.lane(vehicle, moved.lane).room
        own = beside(room, offset_m, width_m)
        if vehicle not in self._uses_oncoming:
            return own, along
        return LateralRoom(own.left_m + self._oncoming_m(self._routes[vehicle], lane), own.right_m), along

    def _on_lane(self, vehicle: str) -> tuple[str, Way, LateralRoom, float]:
        """Lane, way, room and position of a vehicle that SUMO drives.

        SUMO counts in lengths of the lane, which are those of its edge; on a bend the outer lanes are drawn longer.
        """
        lane = libsumo.vehicle.getLaneID(vehicle)
        way, room, stretch = self._lane(self._routes[vehicle], lane)
        return lane, way, room, libsumo.vehicle.getLanePosition(vehicle) * stretch


def beside(room: LateralRoom, offset_m: float, width_m: float) -> LateralRoom:
    """Returns a body's room to its lanes' edges, negative beyond them."""
    spare = -width_m / 2 - EDGE_M
    return LateralRoom(room.left_m + spare - offset_m, room.right_m + spare + offset_m)


def _route_lane(route: tuple[str, ...], lane: str) -> RouteLane:
    return RouteLane(way_of(route, lane), _room(route, lane), _stretch(lane))


def _stretch(lane: str) -> float:
    """Returns a lane's drawn length over its stated one; 1 within rounding."""
    drawn_m = float(np.hypot(*np.diff(libsumo.lane.getShape(lane), axis=0).T).sum())
    length_m: float = libsumo.lane.getLength(lane)
    return drawn_m / length_m if abs(drawn_m - length_m) > ROUNDED_M else 1.0


def _room(route: tuple[str, ...], lane: str) -> LateralRoom:
    """Returns the room from a lane's middle along `route`.

    It reaches to the edges of the lanes beside it that lead on along `route`.
    """
    edge, _, index = lane.rpartition("_")
    widths = [_width_on_route(f"{edge}_{i}", route) for i in range(libsumo.edge.getLaneNumber(edge))]
    own, half_m = int(index), libsumo.lane.getWidth(lane) / 2
    right, left = takewhile(bool, reversed(widths[:own])), takewhile(bool, widths[own + 1 :])
    return LateralRoom(sum(left) + half_m, sum(right) + half_m)


JOINED_M = 0.5  # gap between the lanes of two directions up to which they are one carriageway


def _oncoming_m(route: tuple[str, ...], lane: str) -> float:
    """Returns the width of oncoming lanes left of a lane's edge, m.

    It is 0 inside junctions, where something lies between, and where a lane of the edge that `route` cannot use does.
    """
    edge = edge_of(lane)
    if edge.startswith(":"):
        return 0.0
    leftmost = _lanes_of(edge)[-1]
    if not leads_on(route, leftmost):
        return 0.0
    start, end = libsumo.edge.getFromJunction(edge), libsumo.edge.getToJunction(edge)
    own, half_m = np.array(libsumo.lane.getShape(leftmost)), libsumo.lane.getWidth(leftmost) / 2
    for other in libsumo.junction.getOutgoingEdges(end):
        lanes = [] if other.startswith(":") or libsumo.edge.getToJunction(other) != start else _lanes_of(other)[::-1]
        widths = [float(libsumo.lane.getWidth(id_)) for id_ in takewhile(car_may_use, lanes)]
        if not widths:
            continue
        line = shapely.LineString(libsumo.lane.getShape(lanes[0]))
        apart_m = float(np.median(shapely.distance(line, shapely.points((own[:-1] + own[1:]) / 2))))
        if apart_m - half_m - widths[0] / 2 <= JOINED_M:
            return sum(widths)
    return 0.0


def _width_on_route(lane: str, route: tuple[str, ...]) -> float:
    """Returns a lane's width, m; 0 if the route cannot use it.

    Cars may not use it, or it does not lead to the route's next edge.
    """
    return float(libsumo.lane.getWidth(lane)) if leads_on(route, lane) else 0.0


# SUMO's lane-change mode: strategic changes, none into a vehicle, and movements within a lane.
FOR_ITS_ROUTE = 0b01_10_00_00_00_01
EGO_DECEL_MPS2 = 4.5  # SUMO's default for passenger cars
LANE_CHANGE = "laneChangeModel."
# So that the commanded lateral speed is the one driven; its limits are those of `risk_sac.sim.control`.
# Choice: with SUMO's own 1 a third of its drivers stand at the end of an acceleration lane beside dense traffic.
ASSERTIVE, MERGING = f"{LANE_CHANGE}lcAssertive", "2"
STEERED = {"lcAccelLat": "100", "lcMaxSpeedLatStanding": "5", "lcMaxSpeedLatFactor": "1"}


def place(layout: Layout, ego: EgoConfig, settings: Mapping[str, float]) -> None:
    """Places the layout's vehicles; SUMO inserts them in its next step.

    Args:
      layout: of the episode.
      ego: its driver.
      settings: further ones of SUMO's driver of the ego: `tau`, or keys of SUMO's `vehicle.setParameter` for its
        lane-change model, and of `vehicletype.setParameter` for the rest.
    """
    _limit(layout.set_speed_mps)
    ego_type = f"ego_{ego.car_following}"
    libsumo.vehicletype.setActionStepLength(ego_type, ego.reaction_time_s)
    libsumo.vehicletype.setEmergencyDecel(ego_type, emergency_decel_mps2(layout.friction))
    libsumo.vehicletype.setLength(ego_type, layout.ego.shape.length_m)
    libsumo.vehicletype.setWidth(ego_type, layout.ego.shape.width_m)
    libsumo.vehicletype.setDecel(ego_type, min(EGO_DECEL_MPS2, layout.friction * GRAVITY_MPS2))
    for name, value in settings.items():
        if name == "tau":
            libsumo.vehicletype.setTau(ego_type, value)
        elif not name.startswith(LANE_CHANGE):
            libsumo.vehicletype.setParameter(ego_type, name, f"{value:g}")
    _insert(layout.ego, ego_type)
    if layout.set_speed_mps < math.inf:
        libsumo.vehicle.setLaneChangeMode(layout.ego.id, FOR_ITS_ROUTE)
    for name, value in settings.items():
        if name.startswith(LANE_CHANGE):
            libsumo.vehicle.setParameter(layout.ego.id, name, f"{value:g}")
    for start in layout.vehicles:
        _insert(start, _type("background", start, _class_of(start)))
    if layout.signal is not None:
        _set_signal(layout.signal, layout.signal_offset_s)


def _limit(speed_mps: float) -> None:
    """Limits the speed on all lanes, until the next episode is loaded."""
    if speed_mps < math.inf:
        for lane in libsumo.lane.getIDList():
            if libsumo.lane.getMaxSpeed(lane) > speed_mps:
                libsumo.lane.setMaxSpeed(lane, speed_mps)


def hurry(layout: Layout) -> None:
    """Makes vehicles keep start speeds above the limit after their insertion."""
    for start in (layout.ego, *layout.vehicles):
        limit_mps = libsumo.lane.getMaxSpeed(f"{start.route[0]}_{start.lane}")
        if start.speed_mps > limit_mps:
            libsumo.vehicle.setSpeedFactor(start.id, start.speed_mps / limit_mps)
            libsumo.vehicle.setPreviousSpeed(start.id, start.speed_mps)


def hand_over(start: VehicleStart) -> None:
    """Makes a vehicle drive as commanded, whatever is in its way."""
    libsumo.vehicle.setType(start.id, _type("adversary", start, _class_of(start)))
    for name, value in STEERED.items():  # a change of type leaves the lane-change model as it is
        libsumo.vehicle.setParameter(start.id, f"laneChangeModel.{name}", value)
    libsumo.vehicle.setSpeedMode(start.id, 0)
    libsumo.vehicle.setLaneChangeMode(start.id, 0)


def _class_of(start: VehicleStart) -> str:
    """Returns a SUMO class of a vehicle that its lane admits."""
    if car_may_use(f"{start.route[0]}_{start.lane}"):
        return CAR
    return ANYWHERE if start.role is Role.ADVERSARY else BODIES[start.body].sumo_class


def _type(driven: str, start: VehicleStart, class_: str) -> str:
    """Returns a body's type id; copies the car's type if not shipped."""
    size = () if start.size_m is None else (f"{start.size_m[0]:g}x{start.size_m[1]:g}",)
    id_ = "_".join((driven, start.body, *(() if class_ == CAR else (class_,)), *size))
    types = libsumo.vehicletype
    if id_ not in types.getIDList():
        body = start.shape
        types.copy(f"{driven}_car", id_)
        types.setLength(id_, body.length_m)
        types.setWidth(id_, body.width_m)
        types.setHeight(id_, body.height_m)
        types.setAccel(id_, body.driver.accel_mps2)
        types.setDecel(id_, body.driver.decel_mps2)
        types.setEmergencyDecel(id_, body.driver.emergency_mps2)
        if class_ != CAR:
            types.setVehicleClass(id_, class_)
    return id_


def _insert(start: VehicleStart, type_id: str) -> None:
    route = "_".join(("route", *start.route))
    if route not in libsumo.route.getIDList():
        libsumo.route.add(route, start.route)
    limit_mps: float = libsumo.lane.getMaxSpeed(f"{start.route[0]}_{start.lane}")
    libsumo.vehicle.add(
        start.id,
        route,
        typeID=type_id,
        departLane=str(start.lane),
        departPos=repr(start.position_m),
        departSpeed=repr(min(start.speed_mps, limit_mps)),  # SUMO refuses a faster start; see `hurry`
    )
    if needs_lane_change(start.route, f"{start.route[0]}_{start.lane}"):
        libsumo.vehicle.setParameter(start.id, ASSERTIVE, MERGING)
    if libsumo.vehicletype.getVehicleClass(type_id) == ANYWHERE:
        libsumo.vehicle.setLaneChangeMode(start.id, 0)  # to SUMO's driver sidewalks are lanes too
    if start.left_m != 0.0:  # SUMO's driver keeps to it
        edge, lane = start.route[0], start.lane
        x, y = libsumo.simulation.convert2D(edge, start.position_m, lane)
        way_rad = math.radians(90.0 - libsumo.lane.getAngle(f"{edge}_{lane}", start.position_m))
        x, y = x - start.left_m * math.sin(way_rad), y + start.left_m * math.cos(way_rad)
        libsumo.vehicle.setLateralAlignment(start.id, f"{start.left_m:g}")
        libsumo.vehicle.moveToXY(start.id, edge, lane, x, y, keepRoute=KEEP_ROUTE)


def _set_signal(signal: str, offset_s: float) -> None:
    """Puts a fixed-time signal at `offset_s` into its cycle."""
    (logic, *_) = libsumo.trafficlight.getAllProgramLogics(signal)
    durations = [phase.duration for phase in logic.phases]
    left = offset_s % sum(durations)
    for index, duration in enumerate(durations):
        if left < duration:
            libsumo.trafficlight.setPhase(signal, index)
            libsumo.trafficlight.setPhaseDuration(signal, duration - left)
            return
        left -= duration
