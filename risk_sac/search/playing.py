"""Plays one proposed episode; needs no torch where a script drives.

A proposal and what was played of it are plain values, so that either may pass to another process.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from risk_sac.egos.guard import CRASH
from risk_sac.env.env import Observation, RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.records import DrivenBy, Outcome, Phase, RequirementResult, StoryDeviation
from risk_sac.risk.reward import TrainingReward
from risk_sac.risk.rss import TTC_CAP_S
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.run_folder.crash_guard import CrashGuard
from risk_sac.run_folder.series import pack_series
from risk_sac.search.agents.snapshot import PolicySnapshot
from risk_sac.search.agents.transition import Transition
from risk_sac.search.encounter import NO_ENCOUNTER, Encounter
from risk_sac.world.jit import cpu_s
from risk_sac.world.types import Floats, Scene, Vector

logger = logging.getLogger(__name__)

SIM_CRASH = "sim_crash"  # reason of a rejection


class EpisodeActor(Protocol):
    """Drives all adversaries of an episode, and learns from it."""

    @property
    def dual_variable(self) -> float:
        """λ of Eq. 2."""

    @property
    def can_stop_early(self) -> bool:
        """Whether the rest of the episode is not worth playing."""

    def begin(self, genes: Floats) -> None:
        """Begins an episode with the genes of its scripts, if any."""

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Returns the joint action."""

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Remembers a step; `own` where it was the actor."""

    def update(self) -> object:
        """Learns, if it is an episode of the search."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """An episode that is to be played."""

    index: int
    phase: Phase
    learning: bool  # whether it belongs to the search
    seed: int
    point: Floats  # the scene and the genes, in the unit cube
    scene: Scene
    genes: Floats
    driven_by: DrivenBy | None
    guided: bool  # whether the guide's searcher has proposed it, see `Searchers`
    origin: Mapping[str, Any] | None = None  # see `SceneOptimizer.origin`; None: nothing else is asked for meanwhile
    policy: PolicySnapshot | None = None  # that it is played with; None: this process plays it, or nothing learns

    def state(self) -> dict[str, Any]:
        """Returns plain values that, with the policy, restore the proposal.

        The point has the scene and the genes.
        """
        return {
            "index": self.index,
            "phase": self.phase,
            "learning": self.learning,
            "seed": self.seed,
            "point": self.point,
            "driven_by": self.driven_by and self.driven_by.value,
            "guided": self.guided,
            "origin": None if self.origin is None else dict(self.origin),
        }


@dataclass(slots=True)
class EpisodeSums:
    """Sums over one episode."""

    steps: int = 0
    risk_return: float = 0.0
    shaped_return: float = 0.0
    cost: float = 0.0

    def add(self, risk_reward: float, cost: float, shaped: float) -> None:
        """Counts one step; `shaped` is R' under the λ of the moment."""
        self.steps += 1
        self.risk_return += risk_reward
        self.cost += cost
        self.shaped_return += shaped


class Unplayable(Exception):
    """Error of an episode that could not be played to its end."""

    def __init__(self, outcome: Outcome, reason: str, *, begun: bool = True) -> None:
        super().__init__(f"{outcome}: {reason}")
        self.outcome, self.reason, self.begun = outcome, reason, begun


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedEpisode:
    """Outcome of playing a proposal."""

    sums: EpisodeSums
    unplayable: tuple[Outcome, str] | None = None  # why it was not played to its end
    encounter: Encounter = NO_ENCOUNTER
    requirements: Mapping[str, RequirementResult] = field(default_factory=dict)
    min_ttc_s: float = TTC_CAP_S
    min_robustness: float = ROBUSTNESS_CLIP
    start_danger: str | None = None
    defect_reached_s: float | None = None
    deviations: Mapping[str, StoryDeviation] = field(default_factory=dict)
    series: bytes | None = None  # an .npz, where a requirement that counts was violated
    cpu_s: float = 0.0  # of the process that played it, without compilation
    transitions: Sequence[Transition] = ()  # its steps, where another process has played it for a learner


class GuardedEnv:
    """Environment that leaves out crashing episodes and truncates those without further use."""

    def __init__(self, env: RiskSacEnv, guard: CrashGuard) -> None:
        self.env, self._guard = env, guard

    def begin(self, index: int) -> None:
        """Notes an episode for the crash guard before its scene is chosen."""
        self._index, self._playable = index, self._guard.begin(index)

    def reset(self, seed: int, scene: Scene, actor: EpisodeActor) -> tuple[Observation, dict[str, Any]]:
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
            return self.env.reset(seed=seed, options={"scene": scene})
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
            observation, reward, terminated, truncated, info = self.env.step(action)
        except EgoFailed as failed:
            raise self._invalid(failed) from failed
        stops = self._actor.can_stop_early and self.env.problem.contact_alone_counts
        return observation, reward, terminated, truncated or stops, info

    def _invalid(self, failed: EgoFailed) -> Unplayable:
        logger.warning("episode %d is invalid: %s", self._index, failed)
        return Unplayable(Outcome.INVALID, failed.reason)


def play(
    guarded: GuardedEnv, proposal: Proposal, actor: EpisodeActor, agent: EpisodeActor, reward: TrainingReward
) -> PlayedEpisode:
    """Plays a proposed episode that the guard knows: Alg. 1, l. 5-20.

    Args:
      guarded: environment of the run.
      proposal: what to play.
      actor: drives the adversaries.
      agent: observes each step, and has λ.
      reward: what it is trained on.
    """
    env, sums, began_s = guarded.env, EpisodeSums(), cpu_s()
    try:
        observation, info = guarded.reset(proposal.seed, proposal.scene, actor)  # Alg. 1, l. 5
        for _ in range(env.problem.family.horizon_steps):  # Alg. 1, l. 6
            action = actor.act(observation, explore=proposal.learning)  # Alg. 1, l. 7
            robustness = info["robustness"]
            next_observation, risk_reward, terminated, truncated, info = guarded.step(action)  # Alg. 1, l. 8
            cost, next_robustness = info["cost"], info["robustness"]
            shaped = reward(risk_reward, cost, robustness, next_robustness, float(terminated), agent.dual_variable)
            sums.add(risk_reward, cost, shaped)  # Alg. 1, l. 9-10
            if proposal.learning:
                agent.observe(  # Alg. 1, l. 11-12
                    Transition(
                        observation=observation,
                        action=action,
                        risk_reward=risk_reward,
                        cost=cost,
                        robustness=robustness,
                        next_robustness=next_robustness,
                        next_observation=next_observation,
                        terminated=terminated,
                        accumulated_reward=sums.shaped_return,
                    ),
                    own=actor is agent,
                )
                actor.update()  # Alg. 1, l. 13-16
            observation = next_observation
            if terminated or truncated:  # Alg. 1, l. 17-19
                break
    except Unplayable as unplayable:
        why = unplayable.outcome, unplayable.reason
        if not unplayable.begun:  # the environment's trace is of the episode before
            return PlayedEpisode(sums=sums, unplayable=why)
        return PlayedEpisode(sums=sums, unplayable=why, **_facts(env, sums), cpu_s=cpu_s() - began_s)
    results = env.requirement_results()
    encounter = Encounter(
        collision=info.get("collision"),
        violations=env.violations(results),
        margins={name: result.robustness for name, result in results.items() if result.counts == "failure"},
        encounters_s=env.trace.encounters_s(env.problem.family.adversaries),
        avoided_by=env.avoided_by() or {},
    )
    return PlayedEpisode(
        sums=sums,
        encounter=encounter,
        requirements=results,
        **_facts(env, sums),
        deviations=env.deviations,
        series=pack_series(env.trace.series()) if encounter.collision or encounter.violations else None,
        cpu_s=cpu_s() - began_s,
    )


def _facts(env: RiskSacEnv, sums: EpisodeSums) -> dict[str, Any]:
    """Returns what a record keeps of an episode that has begun."""
    return {
        "min_ttc_s": env.trace.min_ttc_s,
        "min_robustness": env.trace.min_robustness,
        "start_danger": env.start_danger,
        "defect_reached_s": env.defect_reached_s if sums.steps else None,
    }
