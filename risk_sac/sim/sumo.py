"""libsumo behind a few verbs: reset, release, apply, step, close. SUMO's conventions end here.

libsumo holds one simulation per process, so a worker process runs one episode at a time. Front bumpers, compass
degrees and string ids stay inside this package.

Pedestrians are points of our own dynamics, and SUMO knows nothing of them: `risk_sac.sim.lookout` says why, and
`risk_sac.sim.driver` tells its drivers what to stop for.
"""

import logging
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import NamedTuple

import libsumo
import numpy as np
from numpy.typing import NDArray

from risk_sac.config import EgoConfig
from risk_sac.errors import SimulationError
from risk_sac.jit import compiled
from risk_sac.scenario.layout import Area, Layout, VehicleStart
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.sim.driver import OWN_CHOICE_MPS, Driver
from risk_sac.sim.ego import MOTION, Belief
from risk_sac.sim.lookout import Lookout
from risk_sac.sim.paths import HEADING as PATH_HEADING
from risk_sac.sim.paths import STATION, Along, Paths
from risk_sac.sim.paths import X as PATH_X
from risk_sac.sim.paths import Y as PATH_Y
from risk_sac.types import (
    ACCEL,
    HEADING,
    LATERAL,
    LENGTH,
    OFFSET,
    SPEED,
    STEP_S,
    VX,
    VY,
    WIDTH,
    Bools,
    Floats,
    Frame,
    Kind,
    Role,
    Signal,
    X,
    Y,
)

logger = logging.getLogger(__name__)

NETS = files("sumo_nets")
PEDESTRIAN_SIZE_M = 0.5
EDGE_M = 0.01  # SUMO refuses a lateral step that ends exactly on the edge of the road
EGO_DECEL_MPS2, EGO_EMERGENCY_DECEL_MPS2 = 4.5, 9.0  # SUMO's defaults for passenger cars
# So that the commanded lateral speed is the one driven; its limits are those of `risk_sac.sim.control`.
STEERED = {"lcAccelLat": "100", "lcMaxSpeedLatStanding": "5", "lcMaxSpeedLatFactor": "1"}
LISTED_WITHIN_S = 0.3
SIDEWALK_M = 1.0  # whoever stands so near a crossing looks at its signal
CROSSING_LANE = re.compile(r":.*_c\d+_\d+")
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


class VehicleCommand(NamedTuple):
    """What an adversary vehicle does during the next step."""

    speed_mps: float
    lateral_mps: float


class Room(NamedTuple):
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
        self._paths = Paths()
        self._net = ""

    def reset(self, layout: Layout, seed: int) -> Frame:
        """Sets up an episode and returns its first frame; SUMO drives everybody until `release`.

        It drives adversaries at the speed they start with, or slower where its models want that.

        Args:
          layout: where everybody starts.
          seed: SUMO's seed; the same seed and commands give the same episode.

        Raises:
          SimulationError: SUMO refused the layout.
        """
        options = ["-n", str(NETS / layout.net), "-a", str(NETS / "vtypes.add.xml"), "--seed", str(seed), *OPTIONS]
        try:
            self._load(options)
            self._place(layout)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO refused the layout of {layout.net}: {error}") from error
        absent = {start.id for start in (layout.ego, *layout.vehicles)} - set(libsumo.vehicle.getIDList())
        if absent:
            raise SimulationError(f"SUMO did not insert {sorted(absent)}")
        self._vehicles = [start.id for start in (layout.ego, *layout.vehicles)]
        self._roles = {start.id: start.role for start in (layout.ego, *layout.vehicles)}
        self._roles |= {start.id: start.role for start in layout.pedestrians}
        self._routes = {start.id: start.route for start in (layout.ego, *layout.vehicles)}
        if layout.net != self._net:  # another one may use the same names
            self._net = layout.net
            self._lanes.clear()
            self._paths.clear()
        self._describe_actors()
        self._told = np.full((len(self._ids), 7), np.nan)
        self._start_drivers()
        return self._read()

    def release(self) -> None:
        """Hands the adversary vehicles over: from now on they wait for commands.

        Only adversaries lose SUMO's safety checks; anyone else would drive through traffic.
        """
        for start in self._layout.vehicles:
            if start.role is Role.ADVERSARY and start.id in self._vehicles:
                libsumo.vehicle.setType(start.id, f"adversary_{start.body}")
                for name, value in STEERED.items():  # a change of type leaves the lane-change model as it is
                    libsumo.vehicle.setParameter(start.id, f"laneChangeModel.{name}", value)
                libsumo.vehicle.setSpeedMode(start.id, 0)
                libsumo.vehicle.setLaneChangeMode(start.id, 0)
                self._released[start.id] = self._drivers.pop(start.id)

    def _start_drivers(self) -> None:
        ego, *others = self._vehicles
        grip = self._layout.friction * GRAVITY_MPS2
        emergency = min(EGO_EMERGENCY_DECEL_MPS2, grip)
        cruise = {start.id: start.speed_mps for start in self._layout.vehicles if start.role is Role.ADVERSARY}
        self._drivers = {id_: Driver(id_, STEP_S, emergency, cruise.get(id_, OWN_CHOICE_MPS)) for id_ in others}
        self._released: dict[str, Driver] = {}
        self._ego_driver = Driver(ego, self._ego.reaction_time_s, emergency)

    def _load(self, options: list[str]) -> None:
        if not self._started:
            libsumo.start(["sumo", *options])
            self._started = True
            return
        libsumo.load(options)

    def _place(self, layout: Layout) -> None:
        ego_type = f"ego_{self._ego.car_following}"
        grip = layout.friction * GRAVITY_MPS2
        libsumo.vehicletype.setActionStepLength(ego_type, self._ego.reaction_time_s)
        libsumo.vehicletype.setEmergencyDecel(ego_type, min(EGO_EMERGENCY_DECEL_MPS2, grip))
        libsumo.vehicletype.setDecel(ego_type, min(EGO_DECEL_MPS2, grip))
        self._insert(layout.ego, ego_type)
        for start in layout.vehicles:
            self._insert(start, f"background_{start.body}")
        self._walkers = {p.id: Walker(p.x_m, p.y_m, p.heading_rad, p.speed_mps) for p in layout.pedestrians}
        self._layout = layout
        self._belief: Belief | None = None
        self._reflex_mps2 = 0.0
        self._signal = layout.signal
        self._walk_signals: list[tuple[Area, int]] = []
        if layout.signal is not None:
            _set_signal(layout.signal, layout.signal_offset_s)
            self._walk_signals = _walk_signals(layout.signal, layout.crossings)

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
        self._row = {id_: row for row, id_ in enumerate(self._vehicles)}
        self._attackers = [(row, v) for row, v in enumerate(self._vehicles) if self._roles[v] is Role.ADVERSARY]
        bodies = [(get.getLength(v), get.getWidth(v)) for v in self._vehicles]
        self._bodies = np.array(bodies + [(PEDESTRIAN_SIZE_M, PEDESTRIAN_SIZE_M)] * walking).T

    def apply(self, vehicles: Mapping[str, VehicleCommand], walkers: Mapping[str, Walker]) -> None:
        """Hands the adversaries their commands for the next step; vehicles that left the net are skipped."""
        for id_, (speed_mps, lateral_mps) in vehicles.items():
            if id_ in self._row:
                libsumo.vehicle.setSpeed(id_, speed_mps)
                libsumo.vehicle.changeSublane(id_, lateral_mps * STEP_S)
        self._walkers.update(walkers)

    def brake(self, braking_mps2: float) -> None:
        """Lets the ego brake at least so hard in the next step."""
        self._reflex_mps2 = braking_mps2

    def believe(self, belief: Belief) -> None:
        """Makes the ego blind to the hidden actors, and lets it reckon with those it remembers.

        Its car-following and junction models, that is: SUMO's lane-change model has no list of vehicles to ignore.
        """
        before, self._belief = self._belief, belief
        if before is not None and before.known.tobytes() == belief.known.tobytes():
            return
        vehicles = " ".join(id_ for id_, known in zip(self._vehicles, belief.known, strict=False) if not known)
        ego = self._vehicles[0]
        libsumo.vehicle.setParameter(ego, "carFollowModel.ignoreIDs", vehicles)
        libsumo.vehicle.setParameter(ego, "junctionModel.ignoreIDs", vehicles)

    def step(self) -> Frame:
        """Advances 0.1 s.

        Raises:
          SimulationError: libsumo failed, or the ego left the net.
        """
        try:
            self._tell_drivers()
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO failed during a step: {error}") from error
        if libsumo.simulation.getArrivedNumber():
            gone = set(libsumo.simulation.getArrivedIDList())
            if self._vehicles[0] in gone:
                raise SimulationError("the ego left the net before the horizon; lengthen its route")
            self._told = self._told[[id_ not in gone for id_ in self._ids]]
            self._vehicles = [id_ for id_ in self._vehicles if id_ not in gone]
            self._describe_actors()
        return self._read()

    def walk_on(self) -> None:
        """Moves every pedestrian on at its velocity for one step."""
        for id_, w in self._walkers.items():
            distance = w.speed_mps * STEP_S
            x_m, y_m = w.x_m + distance * math.cos(w.heading_rad), w.y_m + distance * math.sin(w.heading_rad)
            self._walkers[id_] = replace(w, x_m=x_m, y_m=y_m)

    def halt_walkers(self) -> None:
        """Lets every pedestrian stand where it is."""
        self._walkers = {id_: replace(w, speed_mps=0.0, accel_mps2=0.0) for id_, w in self._walkers.items()}

    def _tell_drivers(self) -> None:
        """Tells the ego of everybody it knows of, and the others that SUMO drives of the pedestrians near them."""
        look, ego = self._lookout, self._ego_driver
        speed, accel = self._speed_and_accel[0]
        if ego.due:
            ego.wanted_mps2 = self._decide(ego, 0, *self._as_believed())
        ego.tell(speed, accel)
        if self._reflex_mps2:
            ego.brake(speed, accel, self._reflex_mps2)
        if not self._walkers:
            return
        for row, id_ in enumerate(self._vehicles):
            driver = self._drivers.get(id_)
            if driver is not None and (look.near[row] or driver.telling):
                driver.wanted_mps2 = self._decide(driver, row, self._frame.state, look.pedestrians)
                driver.tell(*self._speed_and_accel[row])

    def _as_believed(self) -> tuple[Floats, Bools]:
        """All actors where the ego expects them, for of whom it does not see it knows no better; and whom it knows."""
        state, belief = self._frame.state, self._belief
        if belief is None:
            return state, np.ones(len(self._ids), dtype=np.bool_)
        remembered = np.isfinite(belief.expected[0])
        if remembered.any():
            state = state.copy()
            state[np.ix_(MOTION, remembered)] = belief.expected[:, remembered]
        return state, belief.known

    def _decide(self, driver: Driver, row: int, state: Floats, candidates: Bools) -> float | None:
        speed, along = self._speed_and_accel[row][0], self.along(self._vehicles[row])
        return driver.decide(row, speed, along, state, self._lookout.vehicle, candidates)

    def intended_accel(self) -> dict[str, float]:
        """What the drivers of the released vehicles would do if nobody commanded them, m/s².

        They keep the speed they started with, or go slower where SUMO's models or a pedestrian in their way want that.
        SUMO's wish is that of the step before, which is the newest it tells.
        """
        look = self._lookout
        found = {}
        for id_, driver in self._released.items():
            row = self._row.get(id_)
            if row is None:  # left the net
                continue
            speed, accel = self._speed_and_accel[row]
            models = (libsumo.vehicle.getSpeedWithoutTraCI(id_) - speed) / STEP_S + accel
            wanted = min(models, max(driver.cruise_mps - speed, 0.0) / STEP_S)
            told = None
            if self._walkers and look.near[row]:
                told = self._decide(driver, row, self._frame.state, look.pedestrians)
            found[id_] = wanted if told is None else min(wanted, told)
        return found

    def along(self, vehicle: str) -> Along:
        """Where a vehicle is on its path."""
        get = libsumo.vehicle
        path = self._paths.of(self._routes[vehicle], get.getLaneID(vehicle))
        return Along(path, get.getLanePosition(vehicle), get.getLateralLanePosition(vehicle))

    def ego_path(self) -> tuple[Floats, Floats]:
        """The ego's way ahead: x and y of points, its centre first."""
        ego = self._vehicles[0]
        path, station_m, offset_m = self.along(ego)
        ahead = path.points[:, path.points[STATION] > station_m]
        sin, cos = np.sin(ahead[PATH_HEADING]), np.cos(ahead[PATH_HEADING])
        x = np.concatenate((self._frame.x_m[:1], ahead[PATH_X] - offset_m * sin))
        y = np.concatenate((self._frame.y_m[:1], ahead[PATH_Y] + offset_m * cos))
        return x, y

    def lists_collision(self, other: str) -> bool:
        """Whether SUMO lists a collision of the ego with a vehicle, now or if it goes on for `LISTED_WITHIN_S`.

        SUMO tests rectangles that lie along their lanes, so it is a little late or early where a body is turned. It
        ends the episode: the simulation is past the contact afterwards.
        """
        pair = {self._vehicles[0], other}
        for _ in range(round(LISTED_WITHIN_S / STEP_S)):
            if any({c.collider, c.victim} == pair for c in libsumo.simulation.getCollisions()):
                return True
            libsumo.simulationStep()
        return any({c.collider, c.victim} == pair for c in libsumo.simulation.getCollisions())

    def place(self, vehicle: str) -> tuple[Room, Along] | None:
        """How far `vehicle` may move sideways, and where it is on its path; None once it left the net.

        The lanes that its route goes on from end at a wall: SUMO halts a vehicle dead at the end of any other.
        """
        row = self._row.get(vehicle)
        if row is None:
            return None
        get, route = libsumo.vehicle, self._routes[vehicle]
        lane = get.getLaneID(vehicle)
        right_lanes, left_lanes, lane_width = self._lane(route, lane)
        offset = self._offsets[row]
        spare = (lane_width - float(self._bodies[1, row])) / 2 - EDGE_M
        room = Room(left_lanes + spare - offset, right_lanes + spare + offset)
        return room, Along(self._paths.of(route, lane), get.getLanePosition(vehicle), offset)

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
        get_offset = libsumo.vehicle.getLateralLanePosition
        told: list[float] = []  # flat: numpy converts nested sequences at half the speed
        self._speed_and_accel, self._offsets = [], []
        for id_ in self._vehicles:
            x, y = get_position(id_)
            speed, accel, offset = get_speed(id_), get_accel(id_), get_offset(id_)
            told += (x, y, get_angle(id_), speed, get_lateral(id_), accel, offset)
            self._speed_and_accel.append((speed, accel))
            self._offsets.append(offset)
        for w in self._walkers.values():
            told += (w.x_m, w.y_m, w.heading_rad, w.speed_mps, 0.0, w.accel_mps2, 0.0)
        before, self._told = self._told, np.array(told).reshape(-1, 7)
        state = _state(self._told, before, self._bodies, len(self._vehicles))
        ahead = () if self._signal is None else libsumo.vehicle.getNextTLS(self._vehicles[0])
        self._frame = Frame(
            time_s=libsumo.simulation.getTime(),
            ids=self._ids,
            kind=self._kind,
            role=self._role,
            state=state,
            signal=COLOURS.get(ahead[0][3].lower(), Signal.NONE) if ahead else Signal.NONE,
            stop_line_m=ahead[0][2] if ahead else math.inf,
            link=self._links(ahead[0][3] if ahead else ""),
            simulator_collisions=tuple((c.collider, c.victim) for c in libsumo.simulation.getCollisions()),
            teleported=libsumo.simulation.getStartingTeleportIDList(),
        )
        self._lookout = Lookout(self._frame)
        return self._frame

    def _links(self, ego: str) -> NDArray[np.uint8]:
        """The letter of the signal ahead of the ego and of each adversary; a pedestrian's is that of its crossing."""
        links = np.zeros(len(self._ids), dtype=np.uint8)
        if self._signal is None:
            return links
        letters = [(0, ego)] if ego else []
        for row, id_ in self._attackers:
            ahead = libsumo.vehicle.getNextTLS(id_)
            if ahead:
                letters.append((row, ahead[0][3]))
        for row, walker in enumerate(self._walkers.values(), start=len(self._vehicles)):
            for area, index in self._walk_signals:
                if area.contains(walker.x_m, walker.y_m):
                    letters.append((row, libsumo.trafficlight.getRedYellowGreenState(self._signal)[index]))
        for row, letter in letters:
            links[row] = ord(letter)
        return links


@compiled
def _state(told: Floats, before: Floats, bodies: Floats, vehicles: int) -> Floats:
    """The state of a frame.

    Args:
      told: `n x 7`, of each actor x, y, angle, speed, lateral speed, acceleration, and offset from its lane. SUMO's own
        of vehicles: front bumpers and compass degrees.
      before: the same in the step before, NaN where there was none.
      bodies: `2 x n`, length and width.
      vehicles: how many actors, the first of them, are vehicles.
    """
    n = len(told)
    state = np.empty((WIDTH + 1, n))
    for i in range(n):
        x, y, heading, speed, half = told[i, 0], told[i, 1], told[i, 2], told[i, 3], 0.0
        if i < vehicles:
            heading, half = math.radians(90.0 - heading), bodies[0, i] / 2
        cos, sin = math.cos(heading), math.sin(heading)
        state[VX, i], state[VY, i] = speed * cos, speed * sin
        if i < vehicles and not math.isnan(before[i, 0]):
            # The velocity that was driven: SUMO's angle lags behind a lateral move.
            state[VX, i], state[VY, i] = (x - before[i, 0]) / STEP_S, (y - before[i, 1]) / STEP_S
        state[X, i], state[Y, i], state[HEADING, i] = x - half * cos, y - half * sin, heading
        for k, row in enumerate((SPEED, LATERAL, ACCEL, OFFSET)):
            state[row, i] = told[i, 3 + k]
        state[LENGTH, i], state[WIDTH, i] = bodies[0, i], bodies[1, i]
    return state


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


def _walk_signals(signal: str, crossings: Sequence[Area]) -> list[tuple[Area, int]]:
    """The crossings that a signal controls, each grown onto the sidewalks, and the index of its letter."""
    found = []
    for index, links in enumerate(libsumo.trafficlight.getControlledLinks(signal)):
        for lane in {lane for link in links for lane in link if CROSSING_LANE.fullmatch(lane)}:
            x, y = np.mean(libsumo.lane.getShape(lane), axis=0)
            found += [(area.grown(SIDEWALK_M), index) for area in crossings if area.contains(x, y)]
    return found


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
