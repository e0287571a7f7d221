"""The environment as the loop of Algorithm 1 sees it: whatever ends an episode unplayed is one exception."""

import logging
from typing import Any

from risk_sac.egos.guard import CRASH
from risk_sac.env import Observation, RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.records import Outcome
from risk_sac.run_folder.crashes import CrashGuard
from risk_sac.searchers import Actor
from risk_sac.types import Scene

logger = logging.getLogger(__name__)

SIM_CRASH = "sim_crash"  # reason of a rejection


class Unplayable(Exception):
    """An episode could not be played to its end, or at all; its record gets this outcome and reason."""

    def __init__(self, outcome: Outcome, reason: str, *, begun: bool = True) -> None:
        super().__init__(f"{outcome}: {reason}")
        self.outcome, self.reason, self.begun = outcome, reason, begun


class GuardedEnv:
    """Environment of a run that leaves out crashing episodes and truncates those of no further use."""

    def __init__(self, env: RiskSacEnv, guard: CrashGuard) -> None:
        self._env, self._guard = env, guard

    def begin(self, index: int) -> None:
        """Notes for the crash guard that an episode begins, before its scene is chosen."""
        self._index, self._playable = index, self._guard.begin(index)

    def reset(self, seed: int, scene: Scene, actor: Actor) -> tuple[Observation, dict[str, Any]]:
        """Starts the episode; see `RiskSacEnv.reset`.

        Raises:
          Unplayable: simulator or ego crashed in the episode before, C_hard rejects the scene, or the ego failed.
        """
        self._actor, self._steps = actor, 0
        if not self._playable:
            by_ego = self._guard.by_ego(self._index)
            why = (Outcome.INVALID, CRASH) if by_ego else (Outcome.REJECTED, SIM_CRASH)
            raise Unplayable(*why, begun=False)
        try:
            return self._env.reset(seed=seed, options={"scene": scene})
        except InfeasibleScene as infeasible:
            raise Unplayable(Outcome.REJECTED, infeasible.reason) from infeasible
        except EgoFailed as failed:
            raise self._invalid(failed) from failed

    def step(self, action: Observation) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Plays one control step; see `RiskSacEnv.step`.

        Also truncates once the actor can stop early, if the ego can violate nothing but by a contact.

        Raises:
          Unplayable: the ego failed.
        """
        self._guard.step(self._steps)
        self._steps += 1
        try:
            observation, reward, terminated, truncated, info = self._env.step(action)
        except EgoFailed as failed:
            raise self._invalid(failed) from failed
        stops = self._actor.can_stop_early and self._env.problem.contact_alone_counts
        return observation, reward, terminated, truncated or stops, info

    def _invalid(self, failed: EgoFailed) -> Unplayable:
        logger.warning("episode %d is invalid: %s", self._index, failed)
        return Unplayable(Outcome.INVALID, failed.reason)
