"""Plays the story of one episode, one step at a time.

It knows nothing of SUMO: it takes where all other actors are, and returns how its own move.
"""

from collections.abc import Mapping
from typing import NamedTuple

from risk_sac.scenario.layout import StoryPlan
from risk_sac.scenario.travel_line import Pose
from risk_sac.sim.story.actions import doing_of, set_variable
from risk_sac.sim.story.board import Running, Storyboard
from risk_sac.sim.story.cast import ON_STORY, Drift, Mover, Present
from risk_sac.sim.story.deviation import NO_LEADS, Lead
from risk_sac.sim.story.stage import Stage
from risk_sac.world.types import STEP_S

TIME_DIGITS = 6  # of a time, which is a multiple of the step


class StoryMotion(NamedTuple):
    """An actor of the story at one moment; its place is its body's middle."""

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
        """Moves all actors of the story by a step, and returns where they are.

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
