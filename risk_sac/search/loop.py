"""Runs episodes by Algorithm 1, and rejects those that cannot be played."""

import logging
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch

from risk_sac.config import RunSpec
from risk_sac.egos.guard import CRASH
from risk_sac.env.env import Observation, RiskSacEnv
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.records import DrivenBy, Ending, EpisodeRecord, Outcome, RequirementResult, RunMetrics, SeriesFile
from risk_sac.risk.rss import TTC_CAP_S
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.run_folder.checkpoint import CrashGuard
from risk_sac.search.agents.replay import Transition
from risk_sac.search.run import RunOutcome, RunState
from risk_sac.search.scene_optimizer import NO_ENCOUNTER, Encounter
from risk_sac.search.searchers import Actor
from risk_sac.world.types import Floats, Scene

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


class Observer(Protocol):
    """Receives each episode; may stop the run."""

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Receives an episode; `series` is its file below `failures/` if the ego touched something.

        A resumed run first repeats the episodes of its checkpoint, because the last of them may have been missed.
        """

    def should_stop(self) -> bool:
        """Polled between episodes."""


def execute_run(spec: RunSpec, folder: Path, observer: Observer) -> RunOutcome:
    """Executes a run, or continues the one whose checkpoint lies in `folder`.

    Args:
      spec: what to run.
      folder: gets the checkpoint and, below `failures/`, the time series of every contact.
      observer: receives each episode.

    Raises:
      ConfigError: the spec poses no problem that can be run, or its ego failed in too many episodes in a row.
      CheckpointError: the checkpoint is of another run.
      OSError: the folder cannot be written.
    """
    started, started_cpu = time.monotonic(), time.process_time()
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # runs are what is parallel
    with closing(RunState(spec, folder)) as run:
        for record, metrics in run.resume():
            observer.episode(record, metrics, run.series.get(record.index))
        with CrashGuard(folder) as guard:
            env = GuardedEnv(run.env, guard)
            while not run.finished and not observer.should_stop():
                record = episode(run, env)  # Alg. 1, l. 3
                metrics = run.add(record)
                observer.episode(record, metrics, run.series.get(record.index))
                run.refuse_dead_ego()
                if len(run.records) % spec.learner.checkpoint_every == 0:
                    run.save()
            run.save()
    return run.summary(wall_s=time.monotonic() - started, cpu_s=time.process_time() - started_cpu)


def episode(run: RunState, env: GuardedEnv) -> EpisodeRecord:
    """Plays the next episode: Algorithm 1, lines 4 to 22.

    In the evaluation phase the policy is frozen. Choice: scenes keep coming from the method's own sampler then, since
    it is the pair of sampler and policy that generates scenarios.
    """
    agent, learning, tally = run.searchers.agent, run.learning, EpisodeSums()
    seed = episode_seed(run.spec.stream, len(run.records))
    env.begin(len(run.records))
    actor = run.searchers.next(learning=learning).actor
    point = run.searchers.ask()  # Alg. 1, l. 4
    driven_by = run.searchers.driven_by(learning=learning)
    scene, genes = run.searchers.split(point)
    run.searchers.begin(genes)
    try:
        observation, info = env.reset(seed, scene, actor)  # Alg. 1, l. 5
        for _ in range(run.problem.family.horizon_steps):  # Alg. 1, l. 6
            action = actor.act(observation, explore=learning)  # Alg. 1, l. 7
            robustness = info["robustness"]
            next_observation, risk_reward, terminated, truncated, info = env.step(action)  # Alg. 1, l. 8
            cost, next_robustness = info["cost"], info["robustness"]
            reward = run.reward(risk_reward, cost, robustness, next_robustness, float(terminated), agent.dual_variable)
            tally.add(risk_reward, cost, reward)  # Alg. 1, l. 9-10
            if learning:
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
                        accumulated_reward=tally.shaped_return,
                    ),
                    own=actor is agent,
                )
                actor.update()  # Alg. 1, l. 13-16
            observation = next_observation
            if terminated or truncated:  # Alg. 1, l. 17-19
                break
    except Unplayable as unplayable:
        run.searchers.tell(point, None)
        return _record(run, seed, scene, tally, driven_by, unplayable=unplayable)
    kept = run.env.requirement_results()
    encounter = Encounter(
        collision=info.get("collision"),
        violations=run.env.violations(kept),
        margins={name: each.robustness for name, each in kept.items() if each.counts == "failure"},
        encounters_s=run.env.trace.encounters_s(run.problem.family.adversaries),
        avoided_by=run.env.avoided_by() or {},
    )
    objective = run.searchers.tell(point, tally.shaped_return / tally.steps, encounter)  # Alg. 1, l. 21-22
    return _record(run, seed, scene, tally, driven_by, genes=genes, objective=objective, kept=kept, encounter=encounter)


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


def _record(
    run: RunState,
    seed: int,
    scene: Scene,
    tally: EpisodeSums,
    driven_by: DrivenBy | None,
    *,
    unplayable: Unplayable | None = None,
    genes: Floats | None = None,
    objective: float | None = None,
    kept: Mapping[str, RequirementResult] | None = None,
    encounter: Encounter = NO_ENCOUNTER,
) -> EpisodeRecord:
    ending = Ending.of(encounter.collision, encounter.violations)
    if unplayable is not None:
        ending = Ending(unplayable.outcome, unplayable.reason, ())
    begun = unplayable is None or unplayable.begun  # else the environment's trace is of the episode before
    return EpisodeRecord(
        index=len(run.records),
        phase=run.phase,
        seed=seed,
        scene=scene.values,
        **ending._asdict(),
        steps=tally.steps,
        risk_return=tally.risk_return,
        shaped_return=tally.shaped_return,
        mean_cost=tally.cost / tally.steps if tally.steps else 0.0,
        min_ttc_s=run.env.trace.min_ttc_s if begun else TTC_CAP_S,
        min_robustness=run.env.trace.min_robustness if begun else ROBUSTNESS_CLIP,
        dual_variable=run.searchers.agent.dual_variable,
        temperature=run.searchers.agent.temperature,
        environment_steps=run.environment_steps + tally.steps,
        objective=objective,
        driven_by=driven_by,
        script=None if genes is None else tuple(genes.tolist()) or None,
        requirements=kept or {},
        violations=encounter.violations,
        collision=encounter.collision,
        start_danger=run.env.start_danger if begun else None,
        defect_reached_s=run.env.defect_reached_s if tally.steps else None,
        deviations=run.env.deviations if unplayable is None else {},
        avoided_by=encounter.avoided_by or None,
    )


def episode_seed(run_seed: int, index: int) -> int:
    """Returns the seed of one episode; all methods share it, so that they meet the same background traffic."""
    return int(np.random.SeedSequence((run_seed, index)).generate_state(1)[0] >> 1)
