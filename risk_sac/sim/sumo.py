"""The one simulation that libsumo can run in a process."""

import gc
import math
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from weakref import ref

import libsumo
import numpy as np

from risk_sac.config import EgoConfig
from risk_sac.errors import SimulationError
from risk_sac.scenario.layout import Layout
from risk_sac.sim.drivers import Drivers, stand_in_lanes
from risk_sac.sim.ego import EVERYTHING, Belief, Perception, Senses
from risk_sac.sim.paths import STATION, Along
from risk_sac.sim.pilot import MovedVehicle, OncomingVehicle, Pilot, leaves
from risk_sac.sim.reading import Reader, Reading
from risk_sac.sim.roads import LateralRoom, Roads, beside, hand_over, hurry, place
from risk_sac.sim.solid import VehicleCommand, Walker
from risk_sac.sim.story.cast import NO_LEADS, Drift, Lead
from risk_sac.sim.story.traffic import StoryTraffic
from risk_sac.world.types import STEP_S, WIDTH, Floats, Frame, Role


class Holder:
    """Lock that lets one owner at a time use libsumo.

    An owner that was garbage-collected, or that belongs to the parent process, no longer counts.
    """

    def __init__(self) -> None:
        self._owner: ref[object] | None = None
        self._process = 0

    def load(self, owner: object, options: Sequence[str]) -> None:
        """Starts a simulation for an owner, or its next one.

        Raises:
          SimulationError: the process already runs a simulation for something else.
        """
        if libsumo.isLoaded() and self.is_held_by(owner) and self._process == os.getpid():
            libsumo.load(list(options))
            return
        if self._is_taken(owner):
            gc.collect()  # an owner without references may still be part of a cycle
        if self._is_taken(owner):
            raise SimulationError(
                "this process already runs the simulation of another environment, and libsumo can run only one; close "
                "that environment first, or run each in a process of its own, as gymnasium.vector.AsyncVectorEnv does"
            )
        if libsumo.isLoaded():
            libsumo.close()
        self._owner, self._process = ref(owner), os.getpid()
        libsumo.start(["sumo", *options])

    def is_held_by(self, owner: object) -> bool:
        """Whether the latest simulation of this process is the owner's."""
        return self._owner is not None and self._owner() is owner

    def close(self, owner: object) -> None:
        """Ends the simulation if it is the owner's."""
        if self.is_held_by(owner):
            self._owner = None
            if libsumo.isLoaded():
                libsumo.close()

    def _is_taken(self, owner: object) -> bool:
        if self._owner is None:
            return bool(libsumo.isLoaded())  # by code outside this package
        return self._process == os.getpid() and self._owner() not in (None, owner)


LIBSUMO = Holder()

_PLAIN = re.compile(r"[^,;$%]*")


@cache  # one link for each file
def plain_name(file: str) -> str:
    """Returns the file's path, or a link's whose name SUMO accepts."""
    if _PLAIN.fullmatch(file):
        return file
    folder = Path(_links().name)
    link = folder / f"{len(list(folder.iterdir()))}.xml"
    link.symlink_to(Path(file).absolute())
    return str(link)


@cache
def _links() -> "tempfile.TemporaryDirectory[str]":
    """A folder that is removed when the process ends."""
    usual = tempfile.gettempdir()
    return tempfile.TemporaryDirectory(prefix="risk-sac-", dir=usual if _PLAIN.fullmatch(usual) else "/tmp")


NETS = files("sumo_nets")
LISTED_WITHIN_S = 0.3
END_S = 0.3  # before the end of its route, at which a story is over for the ego
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
    _moved: MovedVehicle | None
    _oncoming: dict[str, OncomingVehicle]  # adversaries outside their own lanes
    _in_lanes: frozenset[str]  # static bodies that SUMO knows too
    _story: StoryTraffic | None
    _leads: Mapping[str, Lead]  # of the next step

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
        """Starts an episode that seed and commands determine; returns its first frame.

        SUMO drives all vehicles until `release`. Adversaries keep the speed they start with, or drive slower where
        SUMO's models want that.

        Raises:
          SimulationError: SUMO refused the layout, or this process runs another simulation.
        """
        self._story, self._leads = None if layout.story is None else StoryTraffic(layout, layout.story), NO_LEADS
        net, types = (plain_name(str(NETS / name)) for name in (layout.net, "vtypes.add.xml"))
        options = ["-n", net, "-a", types, "--seed", str(seed), *OPTIONS]
        try:
            LIBSUMO.load(self, options)
            place(layout, self._ego, self._settings)
            if self._story is not None:
                self._story.insert()
            self._in_lanes = stand_in_lanes(layout.statics)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO refused the layout of {layout.net}: {error}") from error
        absent = {start.id for start in (layout.ego, *layout.vehicles)} - set(libsumo.vehicle.getIDList())
        if absent:
            raise SimulationError(f"SUMO did not insert {sorted(absent)}")
        self._layout = layout
        self._walkers = {p.id: Walker(p.x_m, p.y_m, p.heading_rad, p.speed_mps) for p in layout.pedestrians}
        if self._story is not None:
            hurry(layout)
            self._story.take_over()
            self._walkers |= self._story.walkers
        self._roads.enter(layout)
        self._reader = Reader(layout, self._walkers)
        self._drivers = Drivers(layout, self._ego.reaction_time_s, self._roads)
        self._reflex_mps2 = 0.0
        self._moved, self._oncoming = None, {}
        self._roads.moved = self._oncoming
        self._uses_oncoming = {start.id for start in layout.vehicles if start.uses_oncoming}
        self._seed = seed
        self._senses.reset()
        self._belief = self._look()
        self._hide()
        return self._reading.frame

    def hand_over_ego(self) -> None:
        """Hands the ego to its pilot, if any; raises `EgoFailed` on failure."""
        if self._pilot is None:
            return
        frame = self._reading.frame
        motion = self._pilot.begin(self._layout, self._seed, frame)
        self._drivers.release_ego()
        size_m = float(frame.length_m[0]), float(frame.width_m[0])
        self._moved = MovedVehicle(self._layout.ego.id, motion, size_m, self._roads)

    def release(self) -> None:
        """Hands the adversary vehicles to commands; only they lose SUMO's safety checks."""
        for start in self._layout.vehicles:
            if start.role is Role.ADVERSARY and start.id in self._reading.row:
                hand_over(start)
                self._drivers.release(start.id)

    def apply(
        self,
        vehicles: Mapping[str, VehicleCommand],
        walkers: Mapping[str, Walker],
        leads: Mapping[str, Lead] = NO_LEADS,
    ) -> None:
        """Commands the adversaries' next step; vehicles that left the net are skipped.

        Args:
          vehicles: commands of those that drive.
          walkers: next states of those that walk.
          leads: what leads actors of the story away from it.
        """
        self._leads = leads
        for id_, command in vehicles.items():
            if id_ not in self._reading.row:
                continue
            if id_ in self._uses_oncoming and self._is_beside_own_lanes(id_, command):
                self._oncoming[id_].drive(command)
                continue
            libsumo.vehicle.setSpeed(id_, command.speed_mps)
            libsumo.vehicle.changeSublane(id_, command.lateral_mps * STEP_S)
        self._walkers.update(walkers)

    def _is_beside_own_lanes(self, vehicle: str, command: VehicleCommand) -> bool:
        """Whether an adversary leaves its lanes; SUMO loses or regains control."""
        row, moved = self._reading.row[vehicle], self._oncoming.get(vehicle)
        frame, offset_m = self._reading.frame, self._reading.offset_m[row]
        lane = libsumo.vehicle.getLaneID(vehicle) if moved is None else moved.lane
        own = beside(self._roads.lane(vehicle, lane).room, offset_m, frame.state.item(WIDTH, row))
        if moved is None and leaves(own, command):
            self._oncoming[vehicle] = OncomingVehicle(vehicle, frame.state[:, row], self._roads)
        elif moved is not None and moved.is_back(own) and not leaves(own, command):
            del self._oncoming[vehicle]
        return vehicle in self._oncoming

    def brake(self, braking_mps2: float) -> None:
        """Makes the ego brake by at least `braking_mps2` in the next step."""
        self._reflex_mps2 = braking_mps2

    @property
    def ego_arrived(self) -> bool:
        """Whether the ego drove to its route's end, where the episode ends."""
        if self._moved is not None:
            return self._moved.arrived
        if self._story is None:
            return False
        path, station_m, *_ = self._roads.along(self._layout.ego.id)
        way = self._roads.lane(self._layout.ego.id, libsumo.vehicle.getLaneID(self._layout.ego.id)).way
        return way.complete and bool(path[STATION, -1] - station_m < END_S * self._reading.frame.ego_speed_mps)

    @property
    def story_over(self) -> bool:
        """Whether the scenario's story ends the episode."""
        return self._story is not None and self._story.stopped

    @property
    def deviations(self) -> Mapping[str, Drift]:
        """Largest deviation of each actor from its story, if it left it."""
        return {} if self._story is None else self._story.furthest

    @property
    def running(self) -> bool:
        """Whether libsumo runs this simulation, neither closed nor replaced since its reset."""
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
            beside = [id_ for id_, vehicle in self._oncoming.items() if not vehicle.inside]
            gone: set[str] = set()
            if self._story is not None:
                beside += self._story.beside
                gone |= self._play(self._story)
            self._drivers.tell(self._reading, self._belief, self._reflex_mps2, self._moved, beside)
            libsumo.simulationStep()
        except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
            raise SimulationError(f"SUMO failed during a step: {error}") from error
        if libsumo.simulation.getArrivedNumber():
            gone |= set(libsumo.simulation.getArrivedIDList()).intersection(self._reading.row)
            if self._layout.ego.id in gone:
                raise SimulationError("the ego left the net before the horizon; lengthen its route")
        if gone:
            self._reader.forget(gone)
        if self._story is not None:
            self._story.settle()
        for vehicle in self._oncoming.values():
            vehicle.settle()
        if self._moved is not None:
            self._moved.settle()
            self._belief = self._look()
            return self._reading.frame
        before, self._belief = self._belief, self._look()
        if before.known.tobytes() != self._belief.known.tobytes():
            self._hide()
        return self._reading.frame

    def _play(self, story: StoryTraffic) -> frozenset[str]:
        """Plays the story's next step; returns the actors that leave."""
        gone = story.advance(self._leads)
        self._leads = NO_LEADS
        self._walkers = {id_: w for id_, w in self._walkers.items() if id_ not in gone} | story.walkers
        self._reader.turn_adversaries(story.deviated)
        return gone

    def signal_heads(self) -> bytes:
        """The letters of all signals, one after the other."""
        states = map(libsumo.trafficlight.getRedYellowGreenState, sorted(libsumo.trafficlight.getIDList()))
        return "".join(states).encode()

    def _look(self) -> Belief:
        """Reads a frame, and lets the ego perceive it."""
        moved = {id_: vehicle.placed for id_, vehicle in self._oncoming.items()}
        if self._moved is not None:
            moved[self._layout.ego.id] = self._moved.placed
        if self._story is not None:
            moved |= self._story.placed
        self._reading = self._reader.read(self._walkers, moved)
        frame = self._reading.frame
        belief = self._senses.look(frame)
        if self._story is not None:
            self._story.observe(frame)
            if hidden := self._story.unsensed:
                belief = belief._replace(known=belief.known & ~np.isin(frame.ids, sorted(hidden)))
        return belief

    def _hide(self) -> None:
        """Hides unknown vehicles from the ego's models, except the lane-change model."""
        ego, in_sumo = self._layout.ego.id, self._in_lanes.union(self._reading.vehicles)
        known = zip(self._reading.frame.ids, self._belief.known, strict=True)
        ignored = " ".join(id_ for id_, it_knows in known if id_ in in_sumo and not it_knows)
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

    def place(self, vehicle: str) -> tuple[LateralRoom, Along] | None:
        """Returns a vehicle's lateral room and its place on its path.

        Returns None once it left the net.
        """
        row = self._reading.row.get(vehicle)
        if row is None:
            return None
        return self._roads.place(vehicle, self._reading.offset_m[row], self._reading.frame.state.item(WIDTH, row))

    def lists_collision(self, other: str) -> bool | None:
        """Whether SUMO lists the ego's collision with a vehicle, within `LISTED_WITHIN_S`.

        Ends the episode: the simulation is past the contact afterwards. SUMO tests rectangles along their lanes, so it
        is a little late or early where a body is turned. None of static bodies, and if we tell SUMO the place of
        either.
        """
        in_story = self._story is not None and other in self._story.placed
        if self._moved is not None or in_story or other in self._oncoming or other not in self._reading.row:
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
