"""libsumo behind four verbs: reset, apply, step, close. The only module that imports it.

libsumo holds one simulation per process, so a worker process runs one episode at a time. SUMO's
conventions (front bumper, compass degrees, string ids) end here.

Pedestrians are points of our own dynamics. SUMO is told about one by a person that stands in for it
while the ego can see it and it is on the roadway or on a crossing: SUMO has no switch that hides a
person, so there is none while it is hidden.
"""

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from importlib.resources import files

import libsumo
import numpy as np

from risk_sac.config import EgoConfig
from risk_sac.errors import SimulationError
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.types import STEP_S, Frame, Kind, Role, Signal

logger = logging.getLogger(__name__)

NETS = files("sumo_nets")
PEDESTRIAN_SIZE_M = 0.5
EDGE_M = 0.01  # SUMO refuses a lateral step that ends exactly on the edge of the road
GRAVITY_MPS2 = 9.81
EGO_DECEL_MPS2, EGO_EMERGENCY_DECEL_MPS2 = 4.5, 9.0  # SUMO's defaults for passenger cars
COLOURS = {"r": Signal.RED, "u": Signal.RED, "y": Signal.YELLOW, "g": Signal.GREEN}
OPTIONS = (
    f"--step-length {STEP_S} --lateral-resolution 0.8 --default.speeddev 0 --insertion-checks none "
    "--collision.action warn --collision.mingap-factor 0 --collision.check-junctions "
    "--time-to-teleport -1 --no-step-log --no-warnings --duration-log.disable"
).split()


@dataclass(slots=True)
class Walker:
    """A pedestrian's state; the command of a step is its next state."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    accel_mps2: float = 0.0


class Ground(IntEnum):
    """Where a pedestrian stands, as moveToXY's keepRoute; drivers yield at a crossing, elsewhere they avoid contact."""

    CROSSING = 2
    ROADWAY = 6


@dataclass(frozen=True, slots=True)
class VehicleCommand:
    """What an adversary vehicle does during the next step."""

    speed_mps: float
    lateral_mps: float


@dataclass(frozen=True, slots=True)
class Room:
    """Lateral room of a vehicle on its road, from its sides to the edges of the drivable lanes."""

    left_m: float
    right_m: float


class SumoSimulation:
    """One libsumo simulation, reused across episodes."""

    def __init__(self, ego: EgoConfig) -> None:
        self._ego = ego
        self._started = False
        self._walkers: dict[str, Walker] = {}
        self._lanes: dict[tuple[tuple[str, ...], str], tuple[float, float, float]] = {}

    def reset(self, layout: Layout, seed: int, *, controlled: bool = True) -> Frame:
        """Sets up an episode and returns its first frame.

        Args:
          layout: where everybody starts.
          seed: SUMO's seed; the same seed and commands give the same episode.
          controlled: whether adversary vehicles wait for commands; otherwise SUMO drives them.

        Raises:
          SimulationError: SUMO refused the layout.
        """
        options = ["-n", str(NETS / layout.net), "-a", str(NETS / "vtypes.add.xml"), "--seed", str(seed), *OPTIONS]
        try:
            self._load(options)
            self._place(layout, controlled)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO refused the layout of {layout.net}: {error}") from error
        absent = {start.id for start in (layout.ego, *layout.vehicles)} - set(libsumo.vehicle.getIDList())
        if absent:
            raise SimulationError(f"SUMO did not insert {sorted(absent)}")
        self._vehicles = [start.id for start in (layout.ego, *layout.vehicles)]
        self._roles = {start.id: start.role for start in (layout.ego, *layout.vehicles)}
        self._roles |= {start.id: start.role for start in layout.pedestrians}
        for start in layout.vehicles:
            if controlled and start.role is Role.ADVERSARY:
                # Only adversaries lose SUMO's safety checks; anyone else would drive through traffic.
                libsumo.vehicle.setSpeedMode(start.id, 0)
                libsumo.vehicle.setLaneChangeMode(start.id, 0)
        self._previous: dict[str, tuple[float, float]] = {}
        self._routes = {start.id: start.route for start in (layout.ego, *layout.vehicles)}
        self._lanes.clear()  # another net may use the same names
        self._describe_actors()
        return self._read()

    def _load(self, options: list[str]) -> None:
        if not self._started:
            libsumo.start(["sumo", *options])
            self._started = True
            return
        if libsumo.person.getIDCount():
            for person in libsumo.person.getIDList():
                libsumo.person.remove(person)
            libsumo.simulationStep()  # a moved person left behind crashed the next episode on some nets
        libsumo.load(options)

    def _place(self, layout: Layout, controlled: bool) -> None:
        ego_type = f"ego_{self._ego.car_following}"
        grip = layout.friction * GRAVITY_MPS2
        libsumo.vehicletype.setActionStepLength(ego_type, self._ego.reaction_time_s)
        libsumo.vehicletype.setEmergencyDecel(ego_type, min(EGO_EMERGENCY_DECEL_MPS2, grip))
        libsumo.vehicletype.setDecel(ego_type, min(EGO_DECEL_MPS2, grip))
        self._insert(layout.ego, ego_type)
        for start in layout.vehicles:
            self._insert(start, "adversary" if controlled and start.role is Role.ADVERSARY else "background")
        self._walkers = {p.id: Walker(p.x_m, p.y_m, p.heading_rad, p.speed_mps) for p in layout.pedestrians}
        self._layout = layout
        self._hidden: frozenset[str] = frozenset()
        self._persons: dict[str, tuple[str, Ground]] = {}  # pedestrian -> its person in SUMO and where that stands
        self._persons_added = 0
        self._signal = layout.signal
        if layout.signal is not None:
            _set_signal(layout.signal, layout.signal_offset_s)

    @staticmethod
    def _insert(start: VehicleStart, type_id: str) -> None:
        route = "_".join(("route", *start.route))
        if route not in libsumo.route.getIDList():
            libsumo.route.add(route, start.route)
        libsumo.vehicle.add(
            start.id,
            route,
            typeID=type_id,
            departLane=str(start.lane),
            departPos=repr(start.position_m),
            departSpeed=repr(start.speed_mps),
        )

    def _describe_actors(self) -> None:
        """Caches what stays the same until a vehicle leaves the net."""
        self._ids = (*self._vehicles, *self._walkers)
        walking = len(self._walkers)
        driving = len(self._vehicles)
        self._kind = np.array([Kind.VEHICLE] * driving + [Kind.PEDESTRIAN] * walking, dtype=np.int8)
        self._role = np.array([self._roles[id_] for id_ in self._ids], dtype=np.int8)
        get = libsumo.vehicle
        self._length = np.array([get.getLength(v) for v in self._vehicles] + [PEDESTRIAN_SIZE_M] * walking)
        self._half_lengths = [get.getLength(v) / 2 for v in self._vehicles]
        self._width = np.array([get.getWidth(v) for v in self._vehicles] + [PEDESTRIAN_SIZE_M] * walking)

    def apply(self, vehicles: Mapping[str, VehicleCommand], walkers: Mapping[str, Walker]) -> None:
        """Hands the adversaries their commands for the next step; vehicles that left the net are skipped."""
        present = self._vehicles
        for id_, command in vehicles.items():
            if id_ in present:
                libsumo.vehicle.setSpeed(id_, command.speed_mps)
                libsumo.vehicle.changeSublane(id_, command.lateral_mps * STEP_S)
        self._walkers.update(walkers)

    def hide(self, hidden: frozenset[str]) -> None:
        """Makes the ego blind to these actors, and only to these.

        Its car-following and junction models, that is: SUMO's lane-change model has no list of vehicles to ignore.
        """
        if hidden == self._hidden:
            return
        vehicles = " ".join(sorted(id_ for id_ in hidden if id_ not in self._walkers))
        ego = self._vehicles[0]
        libsumo.vehicle.setParameter(ego, "carFollowModel.ignoreIDs", vehicles)
        libsumo.vehicle.setParameter(ego, "junctionModel.ignoreIDs", vehicles)
        self._hidden = hidden

    def step(self) -> Frame:
        """Advances 0.1 s.

        Raises:
          SimulationError: libsumo failed, or the ego left the net.
        """
        try:
            for id_, walker in self._walkers.items():
                self._show(id_, walker)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO failed during a step: {error}") from error
        if libsumo.simulation.getArrivedNumber():
            gone = set(libsumo.simulation.getArrivedIDList())
            if self._vehicles[0] in gone:
                raise SimulationError("the ego left the net before the horizon; lengthen its route")
            self._vehicles = [id_ for id_ in self._vehicles if id_ not in gone]
            self._describe_actors()
        return self._read()

    def _show(self, id_: str, walker: Walker) -> None:
        """Moves the person that stands in for a pedestrian, or removes it where SUMO must not know of it.

        A person that changes ground is replaced by a fresh one: SUMO crashes when moveToXY takes a person
        from a crossing to a car lane or a walking area (eclipse-sumo/sumo#17257), from a sidewalk it does not.
        So is one that SUMO moved to a lane without registering it on that lane's edge: drivers look at
        registered persons only, and would be blind to it.
        """
        ground = None if id_ in self._hidden else self._ground(walker)
        person, stands_on = self._persons.get(id_, ("", None))
        if person and (ground is not stands_on or not _registered(person)):
            libsumo.person.remove(person)
            del self._persons[id_]
            stands_on = None
        if ground is None:
            return
        if stands_on is None:
            self._persons_added += 1
            person = f"{id_}#{self._persons_added}"  # re-using an id within one step fails
            edge = self._layout.ego.route[0]
            libsumo.person.add(person, edge, 1.0, typeID="pedestrian")
            libsumo.person.appendWalkingStage(person, [edge], 2.0)
            self._persons[id_] = person, ground
        libsumo.person.moveToXY(person, "", walker.x_m, walker.y_m, _compass(walker.heading_rad), keepRoute=ground)

    def _ground(self, walker: Walker) -> Ground | None:
        """None off the road: nobody drives there, and SUMO's walking areas are where moveToXY crashes."""
        for area in self._layout.crossings:
            if area.contains(walker.x_m, walker.y_m):
                return Ground.CROSSING
        for area in self._layout.roadway:
            if area.contains(walker.x_m, walker.y_m):
                return Ground.ROADWAY
        return None

    def room(self, vehicle: str) -> Room | None:
        """How far `vehicle` may move sideways; None once it left the net.

        The lanes that its route goes on from end at a wall: SUMO halts a vehicle dead at the end of any other.
        """
        if vehicle not in self._vehicles:
            return None
        get = libsumo.vehicle
        right_lanes, left_lanes, lane_width = self._lane(self._routes[vehicle], get.getLaneID(vehicle))
        offset = get.getLateralLanePosition(vehicle)
        spare = (lane_width - get.getWidth(vehicle)) / 2 - EDGE_M
        return Room(left_m=left_lanes + spare - offset, right_m=right_lanes + spare + offset)

    def _lane(self, route: tuple[str, ...], lane: str) -> tuple[float, float, float]:
        """Width of the lanes right and left of `lane` that lead on along `route`, and its own."""
        if (route, lane) not in self._lanes:
            edge, _, index = lane.rpartition("_")
            widths = [_width_on_route(f"{edge}_{i}", route) for i in range(libsumo.edge.getLaneNumber(edge))]
            own = int(index)
            self._lanes[route, lane] = (sum(widths[:own]), sum(widths[own + 1 :]), libsumo.lane.getWidth(lane))
        return self._lanes[route, lane]

    def close(self) -> None:
        """Ends the simulation; `reset` may be called again."""
        if self._started:
            libsumo.close()
            self._started = False
            self._walkers = {}

    def _read(self) -> Frame:
        get_position, get_angle = libsumo.vehicle.getPosition, libsumo.vehicle.getAngle
        get_speed, get_lateral = libsumo.vehicle.getSpeed, libsumo.vehicle.getLateralSpeed
        get_accel = libsumo.vehicle.getAcceleration
        rows: list[float] = []  # flat: numpy converts nested sequences at half the speed
        previous = self._previous
        for id_, half in zip(self._vehicles, self._half_lengths, strict=True):
            x, y = get_position(id_)
            heading = math.radians(90.0 - get_angle(id_))
            cos, sin = math.cos(heading), math.sin(heading)
            speed = get_speed(id_)
            if id_ in previous:  # the velocity that was driven: SUMO's angle lags behind a lateral move
                before = previous[id_]
                vx, vy = (x - before[0]) / STEP_S, (y - before[1]) / STEP_S
            else:
                vx, vy = speed * cos, speed * sin
            previous[id_] = (x, y)
            rows += (x - half * cos, y - half * sin, heading, vx, vy, speed, get_lateral(id_), get_accel(id_))
        for w in self._walkers.values():
            vx, vy = w.speed_mps * math.cos(w.heading_rad), w.speed_mps * math.sin(w.heading_rad)
            rows += (w.x_m, w.y_m, w.heading_rad, vx, vy, w.speed_mps, 0.0, w.accel_mps2)
        x_m, y_m, heading_rad, vx_mps, vy_mps, speed_mps, lateral_mps, accel_mps2 = np.array(rows).reshape(-1, 8).T
        signal, stop_line_m = self._next_signal()
        return Frame(
            time_s=libsumo.simulation.getTime(),
            ids=self._ids,
            kind=self._kind,
            role=self._role,
            x_m=x_m,
            y_m=y_m,
            heading_rad=heading_rad,
            vx_mps=vx_mps,
            vy_mps=vy_mps,
            speed_mps=speed_mps,
            lateral_mps=lateral_mps,
            accel_mps2=accel_mps2,
            length_m=self._length,
            width_m=self._width,
            signal=signal,
            stop_line_m=stop_line_m,
            simulator_collisions=tuple(
                (_actor(c.collider), _actor(c.victim)) for c in libsumo.simulation.getCollisions()
            ),
            teleported=libsumo.simulation.getStartingTeleportIDList(),
        )

    def _next_signal(self) -> tuple[Signal, float]:
        if self._signal is None:
            return Signal.NONE, math.inf
        ahead = libsumo.vehicle.getNextTLS(self._vehicles[0])
        if not ahead:
            return Signal.NONE, math.inf
        _, _, distance_m, state = ahead[0]
        return COLOURS.get(state.lower(), Signal.NONE), distance_m


def _width_on_route(lane: str, route: tuple[str, ...]) -> float:
    """Width of a lane, m; 0 if vehicles may not use it or it does not lead to the route's next edge."""
    if libsumo.lane.getAllowed(lane) == ("pedestrian",):
        return 0.0
    edge = lane.rpartition("_")[0]
    if edge in route[:-1]:
        following = route[route.index(edge) + 1]
        if not any(link[0].rpartition("_")[0] == following for link in libsumo.lane.getLinks(lane)):
            return 0.0
    width: float = libsumo.lane.getWidth(lane)
    return width


def _actor(sumo_id: str) -> str:
    """The actor that a vehicle, or a person `pedestrian#3` that stands in for one, belongs to."""
    return sumo_id.partition("#")[0]


def _registered(person: str) -> bool:
    lane: str = libsumo.person.getLaneID(person)
    road: str = libsumo.person.getRoadID(person)
    return lane.rpartition("_")[0] == road


def _compass(heading_rad: float) -> float:
    return 90.0 - math.degrees(heading_rad)


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
