"""An episode in SUMO behind a few verbs: reset, release, apply, step, close.

libsumo runs one simulation per process, see `risk_sac.sim.holder`. Only this package and the checker of uploaded
networks call it. Pedestrians are points of our own dynamics that SUMO does not know, see `risk_sac.sim.lookout`.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files

import libsumo

from risk_sac.config import EgoConfig
from risk_sac.errors import SimulationError
from risk_sac.scenario.layout import Layout
from risk_sac.sim.commands import VehicleCommand, Walker
from risk_sac.sim.drivers import Drivers
from risk_sac.sim.ego import EVERYTHING, Belief, Perception, Senses
from risk_sac.sim.holder import LIBSUMO
from risk_sac.sim.paths import Along
from risk_sac.sim.pilot import MovedEgo, Pilot
from risk_sac.sim.placing import hand_over, place
from risk_sac.sim.reading import Reader, Reading
from risk_sac.sim.roads import Roads, Room
from risk_sac.sim.staging import plain_name
from risk_sac.types import STEP_S, Floats, Frame, Role

NETS = files("sumo_nets")
LISTED_WITHIN_S = 0.3
OPTIONS = (
    f"--step-length {STEP_S} --lateral-resolution 0.8 --default.speeddev 0 --insertion-checks none "
    "--collision.action warn --collision.mingap-factor 0 --collision.check-junctions "
    "--time-to-teleport -1 --no-step-log --no-warnings --duration-log.disable"
).split()


class SumoSimulation:
    """One libsumo simulation, reused across episodes."""

    # The state of an episode, set by `reset`.
    _layout: Layout
    _reader: Reader
    _drivers: Drivers
    _reading: Reading
    _belief: Belief
    _reflex_mps2: float
    _moved: MovedEgo | None

    def __init__(
        self,
        ego: EgoConfig,
        senses: Senses | None = None,
        pilot: Pilot | None = None,
        settings: Mapping[str, float] | None = None,
    ) -> None:
        """Starts nothing yet.

        Without senses the ego perceives everything. A pilot drives it in place of SUMO's models from `hand_over_ego`
        on. The settings are those of `place`.
        """
        self._ego, self._settings = ego, settings or {}
        self._senses = senses or Perception(0.0, EVERYTHING)
        self._pilot = pilot
        self._walkers: dict[str, Walker] = {}
        self._roads = Roads()

    def reset(self, layout: Layout, seed: int) -> Frame:
        """Sets up an episode and returns its first frame; the same seed and commands give the same episode.

        SUMO drives all vehicles until `release`. Adversaries keep the speed they start with, or drive slower where
        SUMO's models want that.

        Raises:
          SimulationError: SUMO refused the layout, or this process runs another simulation.
        """
        net, types = (plain_name(str(NETS / name)) for name in (layout.net, "vtypes.add.xml"))
        options = ["-n", net, "-a", types, "--seed", str(seed), *OPTIONS]
        try:
            LIBSUMO.load(self, options)
            place(layout, self._ego, self._settings)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO refused the layout of {layout.net}: {error}") from error
        absent = {start.id for start in (layout.ego, *layout.vehicles)} - set(libsumo.vehicle.getIDList())
        if absent:
            raise SimulationError(f"SUMO did not insert {sorted(absent)}")
        self._layout = layout
        self._walkers = {p.id: Walker(p.x_m, p.y_m, p.heading_rad, p.speed_mps) for p in layout.pedestrians}
        self._roads.enter(layout)
        self._reader = Reader(layout, self._walkers)
        self._drivers = Drivers(layout, self._ego.reaction_time_s, self._roads)
        self._reflex_mps2 = 0.0
        self._moved = None
        self._seed = seed
        self._senses.reset()
        self._belief = self._look()
        self._hide()
        return self._reading.frame

    def hand_over_ego(self) -> None:
        """Hands the ego to its pilot, if it has one; raises `EgoFailed` if that cannot drive."""
        if self._pilot is None:
            return
        frame = self._reading.frame
        motion = self._pilot.begin(self._layout, self._seed, frame)
        self._drivers.release_ego()
        size_m = float(frame.length_m[0]), float(frame.width_m[0])
        self._moved = MovedEgo(self._layout.ego.id, motion, size_m, self._roads)

    def release(self) -> None:
        """Hands the adversary vehicles over to commands; only they lose SUMO's safety checks."""
        for start in self._layout.vehicles:
            if start.role is Role.ADVERSARY and start.id in self._reading.row:
                hand_over(start)
                self._drivers.release(start.id)

    def apply(self, vehicles: Mapping[str, VehicleCommand], walkers: Mapping[str, Walker]) -> None:
        """Commands the adversaries' next step; vehicles that left the net are skipped."""
        for id_, (speed_mps, lateral_mps) in vehicles.items():
            if id_ in self._reading.row:
                libsumo.vehicle.setSpeed(id_, speed_mps)
                libsumo.vehicle.changeSublane(id_, lateral_mps * STEP_S)
        self._walkers.update(walkers)

    def brake(self, braking_mps2: float) -> None:
        """Makes the ego brake by at least `braking_mps2` in the next step."""
        self._reflex_mps2 = braking_mps2

    @property
    def ego_arrived(self) -> bool:
        """Whether the ego's pilot drove it to its route's end, where the episode ends."""
        return self._moved is not None and self._moved.arrived

    @property
    def running(self) -> bool:
        """Whether libsumo runs this simulation: it was reset, and neither closed nor replaced since."""
        return LIBSUMO.is_held_by(self)

    def step(self) -> Frame:
        """Advances 0.1 s.

        Raises:
          SimulationError: libsumo failed, or SUMO removed the ego at its route's end.
          EgoFailed: its pilot cannot drive on.
        """
        try:
            if self._moved is not None and self._pilot is not None:
                motion = self._pilot.drive(self._reading.frame, self._belief, self._moved.along)
                self._moved.move(motion)
            self._drivers.tell(self._reading, self._belief, self._reflex_mps2, self._moved)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO failed during a step: {error}") from error
        if libsumo.simulation.getArrivedNumber():
            gone = set(libsumo.simulation.getArrivedIDList())
            if self._layout.ego.id in gone:
                raise SimulationError("the ego left the net before the horizon; lengthen its route")
            self._reader.forget(gone)
        if self._moved is not None:
            self._moved.settle()
            self._belief = self._look()
            return self._reading.frame
        before, self._belief = self._belief, self._look()
        if before.known.tobytes() != self._belief.known.tobytes():
            self._hide()
        return self._reading.frame

    def signal_heads(self) -> bytes:
        """The letters of all signals, one after the other."""
        states = map(libsumo.trafficlight.getRedYellowGreenState, sorted(libsumo.trafficlight.getIDList()))
        return "".join(states).encode()

    def _look(self) -> Belief:
        """Reads a frame, and lets the ego perceive it."""
        self._reading = self._reader.read(self._walkers, None if self._moved is None else self._moved.told)
        return self._senses.look(self._reading.frame)

    def _hide(self) -> None:
        """Hides the vehicles that the ego does not know from its models; the lane-change model cannot ignore any."""
        ego, vehicles = self._layout.ego.id, self._reading.vehicles
        ignored = " ".join(id_ for id_, known in zip(vehicles, self._belief.known, strict=False) if not known)
        libsumo.vehicle.setParameter(ego, "carFollowModel.ignoreIDs", ignored)
        libsumo.vehicle.setParameter(ego, "junctionModel.ignoreIDs", ignored)

    def walk_on(self) -> None:
        """Moves every pedestrian on at its velocity for one step."""
        for id_, w in self._walkers.items():
            distance = w.speed_mps * STEP_S
            x_m, y_m = w.x_m + distance * math.cos(w.heading_rad), w.y_m + distance * math.sin(w.heading_rad)
            self._walkers[id_] = replace(w, x_m=x_m, y_m=y_m)

    def halt_walkers(self) -> None:
        """Lets every pedestrian stand where it is."""
        self._walkers = {id_: replace(w, speed_mps=0.0, accel_mps2=0.0) for id_, w in self._walkers.items()}

    def intended_accel(self) -> dict[str, float]:
        """See `Drivers.intended_accel`."""
        return self._drivers.intended_accel(self._reading)

    def along(self, vehicle: str) -> Along:
        """Locates a vehicle on its path."""
        if self._moved is not None and vehicle == self._layout.ego.id:
            return self._moved.along
        return self._roads.along(vehicle)

    def ego_path(self) -> tuple[Floats, Floats]:
        """The ego's way ahead: x and y of points, its centre first."""
        frame = self._reading.frame
        return self._roads.way_ahead(self._layout.ego.id, float(frame.x_m[0]), float(frame.y_m[0]))

    def place(self, vehicle: str) -> tuple[Room, Along] | None:
        """Returns a vehicle's lateral room and its place on its path.

        Returns None once it left the net.
        """
        row = self._reading.row.get(vehicle)
        if row is None:
            return None
        return self._roads.place(vehicle, self._reading.offset_m[row], float(self._reading.frame.width_m[row]))

    def lists_collision(self, other: str) -> bool | None:
        """Whether SUMO lists a collision of the ego with a vehicle, now or within `LISTED_WITHIN_S`.

        Ends the episode: the simulation is past the contact afterwards. SUMO tests rectangles along their lanes, so it
        is a little late or early where a body is turned. None if a pilot drives the ego, whose place we tell SUMO.
        """
        if self._moved is not None:
            return None
        for _ in range(round(LISTED_WITHIN_S / STEP_S)):
            if self._listed(other):
                return True
            libsumo.simulationStep()
        return self._listed(other)

    def _listed(self, other: str) -> bool:
        pair = {self._layout.ego.id, other}
        return any({c.collider, c.victim} == pair for c in libsumo.simulation.getCollisions())

    def close(self) -> None:
        """Ends the simulation; `reset` may be called again."""
        LIBSUMO.close(self)
        self._walkers = {}
