"""Story actors in SUMO: vehicles that it places as told, and walkers.

SUMO maps such a vehicle onto the lane that it is on, so that its drivers follow it. Where the whole body is beside the
lanes, SUMO keeps it where it is, on no lane.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import libsumo

from risk_sac.scenario.bodies import body_of
from risk_sac.scenario.layout import Layout, Reach, StoryActor, StoryPlan
from risk_sac.scenario.travel_line import Pose
from risk_sac.sim.reading import PlacedState
from risk_sac.sim.solid import Walker
from risk_sac.sim.story.actions import doing_of, set_variable
from risk_sac.sim.story.board import Running, Storyboard
from risk_sac.sim.story.cast import NO_LEADS, ON_STORY, Drift, Lead, Mover, Present
from risk_sac.sim.story.stage import Stage
from risk_sac.world.types import ACCEL, HEADING, SPEED, STEP_S, Frame, X, Y

TIME_DIGITS = 6  # of a time, which is a multiple of the step


class StoryMotion(NamedTuple):
    """Momentary motion of a story's actor; its place is its body's middle."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float  # along its line
    lateral_mps: float
    accel_mps2: float
    left_m: float  # of its line
    sensed: bool = True  # by the ego


class StoryEngine:
    """Story of one episode.

    Call `observe` with each frame and, in between, `advance`. The same plan and frames give the same story.
    """

    def __init__(self, plan: StoryPlan, others: Mapping[str, Present]) -> None:
        """Places all actors at time 0, and does the story's initial actions.

        Args:
          plan: of the episode.
          others: the actors that the story does not move, at time 0.
        """
        self._plan = plan
        self._stage = stage = Stage(plan)
        stage.look(others)
        self._running = Running(stage)
        for init in plan.story.init:
            if init.do.kind == "variable":
                set_variable(init.do, stage)
            else:
                self._running.begin(init.actor, doing_of(init.do))
        self._board = Storyboard(plan.story, stage, self._running)
        self._steps = 0

    @property
    def time_s(self) -> float:
        """Since the story's start."""
        return self._stage.time_s

    @property
    def stopped(self) -> bool:
        """Whether the story's stop trigger fired."""
        return self._board.stopped

    @property
    def states(self) -> Mapping[str, str]:
        """State of each element, by the names that lead to it."""
        return self._board.states

    @property
    def unmet(self) -> frozenset[str]:
        """Actions that could not be done, in words."""
        return frozenset(self._stage.unmet)

    @property
    def played(self) -> Mapping[str, StoryMotion]:
        """Actors of the story that are there now."""
        return {name: _played(mover) for name, mover in self._stage.movers.items() if not mover.gone}

    def observe(self, others: Mapping[str, Present]) -> None:
        """Takes in the other actors now, and evaluates the triggers."""
        self._stage.look(others)
        self._board.evaluate()

    def advance(self, leads: Mapping[str, Lead] = NO_LEADS) -> Mapping[str, StoryMotion]:
        """Moves the story's actors by a step, and returns where they are.

        Args:
          leads: what leads actors away from the story.
        """
        stage = self._stage
        self._running.step()
        for name, mover in stage.movers.items():
            if mover.gone:
                continue
            lead = leads.get(name)
            mover.move(mover.drift if lead is None else lead(mover, stage.room(mover)))
            stage.onto_way(mover)
        self._steps += 1
        stage.time_s = round(self._steps * STEP_S, TIME_DIGITS)
        return self.played

    @property
    def deviated(self) -> frozenset[str]:
        """Actors that are not where their story has them."""
        return frozenset(name for name, mover in self._stage.movers.items() if mover.deviates)

    @property
    def furthest(self) -> Mapping[str, Drift]:
        """Largest deviation of each actor from its story, if it left it."""
        return {name: mover.furthest for name, mover in self._stage.movers.items() if mover.furthest != ON_STORY}


def _played(mover: Mover) -> StoryMotion:
    present = mover.present
    middle = Pose(*present.middle, present.heading_rad)
    speeds = mover.speed_mps, mover.lateral_mps, mover.accel_mps2
    return StoryMotion(*middle, *speeds, mover.left_m, all(mover.visible))


ANYWHERE = 2  # SUMO's word for a place that need not be on the vehicle's route
NO_CHECKS, NO_LANE_CHANGE = 0, 0


class StoryTraffic:
    """The actors of one episode's story.

    Attributes:
      placed: states of the story's vehicles, in SUMO's terms.
      walkers: the story's free actors.
      beside: its vehicles that SUMO has on no lane.
    """

    def __init__(self, layout: Layout, plan: StoryPlan) -> None:
        """Begins the story; none of its vehicles is in SUMO yet."""
        self._plan = plan
        self._engine = StoryEngine(plan, {name: present_of(start) for name, start in plan.others.items()})
        driving = (layout.ego, *layout.vehicles)
        self._lengths_m = {start.id: start.shape.length_m for start in driving if start.id in plan.actors}
        self._free = frozenset(plan.actors) - self._lengths_m.keys()
        self.beside: list[str] = []
        self._take(self._engine.played)

    def _take(self, played: Mapping[str, StoryMotion]) -> None:
        self._played = played
        self.walkers = {
            name: Walker(p.x_m, p.y_m, p.heading_rad, p.speed_mps, p.accel_mps2)
            for name, p in played.items()
            if name in self._free
        }
        self.placed = {name: self._placed(name, p) for name, p in played.items() if name not in self._free}

    def _placed(self, name: str, p: StoryMotion) -> PlacedState:
        half_m = self._lengths_m[name] / 2
        x_m, y_m = p.x_m + half_m * math.cos(p.heading_rad), p.y_m + half_m * math.sin(p.heading_rad)
        angle = 90.0 - math.degrees(p.heading_rad)
        return PlacedState(x_m, y_m, angle, p.speed_mps, p.lateral_mps, p.accel_mps2, p.left_m, None)

    def insert(self) -> None:
        """Makes SUMO insert its vehicles where the story has them."""
        for name in self.placed:
            self._put(name)

    def take_over(self) -> None:
        """Takes the vehicles from SUMO's drivers, once they are inserted."""
        for name in self.placed:
            libsumo.vehicle.setSpeedMode(name, NO_CHECKS)
            libsumo.vehicle.setLaneChangeMode(name, NO_LANE_CHANGE)
            self._correct_speed(name)

    def _put(self, name: str) -> None:
        placed = self.placed[name]
        libsumo.vehicle.moveToXY(name, "", -1, placed.front_x_m, placed.front_y_m, placed.angle_deg, ANYWHERE)

    def _correct_speed(self, name: str) -> None:
        """Tells SUMO the speed, which it derives from positions on lanes."""
        speed_mps = max(self.placed[name].speed_mps, 0.0)
        libsumo.vehicle.setPreviousSpeed(name, speed_mps)
        libsumo.vehicle.setSpeed(name, speed_mps)

    def advance(self, leads: Mapping[str, Lead] = NO_LEADS) -> frozenset[str]:
        """Plays the story's next step, and makes SUMO put its vehicles there.

        Returns:
          The actors that left the scenario.
        """
        before = self._played.keys()
        self._take(self._engine.advance(leads))
        gone = frozenset(before - self._played.keys())
        for name in gone & self._lengths_m.keys():
            libsumo.vehicle.remove(name)
        for name in self.placed:
            self._put(name)
        return gone

    def settle(self) -> None:
        """Corrects what SUMO made of the vehicles in its step."""
        self.beside = []
        for name in self.placed:
            self._correct_speed(name)
            if not libsumo.vehicle.getLaneID(name):
                self.beside.append(name)

    def observe(self, frame: Frame) -> None:
        """Evaluates the story's triggers in a frame."""
        others = {}
        for column, name in enumerate(frame.ids):
            if name in self._plan.actors:
                continue
            start, body = self._plan.others.get(name), body_of(int(frame.body[column]))
            reach = Reach(body.length_m, body.width_m) if start is None else start.reach
            x_m, y_m, heading, speed, accel = (float(frame.state[row, column]) for row in (X, Y, HEADING, SPEED, ACCEL))
            back_m = -reach.ahead_m
            pose = Pose(x_m + back_m * math.cos(heading), y_m + back_m * math.sin(heading), heading)
            others[name] = Present.moving(pose, speed, accel, reach)
        self._engine.observe(others)

    @property
    def stopped(self) -> bool:
        """Whether the story ends the episode."""
        return self._engine.stopped

    @property
    def deviated(self) -> frozenset[str]:
        """Actors that are not where their story has them."""
        return self._engine.deviated

    @property
    def furthest(self) -> Mapping[str, Drift]:
        """Largest deviation of each actor from its story, if it left it."""
        return self._engine.furthest

    @property
    def unsensed(self) -> frozenset[str]:
        """Actors that the ego cannot perceive."""
        return frozenset(name for name, p in self._played.items() if not p.sensed)


def present_of(start: StoryActor) -> Present:
    """An actor at its start."""
    return Present.moving(start.pose, start.speed_mps, 0.0, start.reach)
