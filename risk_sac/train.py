"""Algorithm 1 of RISK-SAC: the loop, and one episode of it.

Source: RISK-SAC, Algorithm 1; each line is tagged where it happens. Lines 1-2 are in `risk_sac.run`, and lines 9-16
one level down, in `risk_sac.agents.learner`, because the reward is formed when a batch is sampled.
"""

import logging
import time
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import torch

from risk_sac.agents.replay import Transition
from risk_sac.config import RunSpec
from risk_sac.errors import EgoFailed, InfeasibleScene
from risk_sac.records import RECORDED, Collision, EpisodeRecord, Outcome, RunMetrics, SeriesFile
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.risk.ttc import TTC_CAP_S
from risk_sac.run import RunState, RunSummary
from risk_sac.run_folder.crashes import CrashGuard
from risk_sac.scene_optimizer import Encounter
from risk_sac.types import Floats

logger = logging.getLogger(__name__)

SIM_CRASH = "sim_crash"  # reason of a rejection


class Observer(Protocol):
    """Who wants to know how a run goes, and may end it."""

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """After each episode; `series` is its file below `failures/` if the ego touched something.

        A resumed run first tells of the episodes in its checkpoint again: whoever listened before may have been
        gone when the last of them were told.
        """

    def should_stop(self) -> bool:
        """Polled between episodes."""


def train(spec: RunSpec, folder: Path, observer: Observer) -> RunSummary:
    """Executes a run, or goes on with one whose checkpoint lies in `folder`.

    Args:
      spec: what to run.
      folder: gets the checkpoint and, below `failures/`, the time series of every contact.
      observer: told of each episode.

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
            while not run.finished and not observer.should_stop():
                record = episode(run, guard)  # Alg. 1, l. 3
                metrics = run.add(record)
                observer.episode(record, metrics, run.series.get(record.index))
                run.refuse_dead_ego()
                if len(run.records) % spec.learner.checkpoint_every == 0:
                    run.save()
            run.save()
    return run.summary(wall_s=time.monotonic() - started, cpu_s=time.process_time() - started_cpu)


def episode(run: RunState, guard: CrashGuard) -> EpisodeRecord:
    """The next episode of Algorithm 1, lines 4 to 22; in the evaluation phase the policy is frozen.

    An episode that crashes the simulator, as its guard knows, is treated like a rejected scene. So is one in which the
    ego failed, but it is no rejected one: it is invalid, and no rate counts it.

    Choice: scenes keep coming from the method's own sampler during evaluation, since it is the pair of
    sampler and policy that generates scenarios.
    """
    env, agent, learning, index = run.env, run.searchers.agent, run.learning, len(run.records)
    seed, playable = episode_seed(run.spec.stream, index), guard.begin(index)
    optimizer, actor = run.searchers.next(learning=learning)
    point = optimizer.ask()  # Alg. 1, l. 4
    scene_size = run.searchers.scene_size
    scene, genes = run.problem.space.from_unit(point[:scene_size]), point[scene_size:]
    tally = Tally()
    if not playable:
        run.searchers.tell(point, None)
        return _record(run, seed, scene.values, tally, rejected=SIM_CRASH)
    try:
        observation, info = env.reset(seed=seed, options={"scene": scene})  # Alg. 1, l. 5
    except InfeasibleScene as infeasible:
        run.searchers.tell(point, None)
        return _record(run, seed, scene.values, tally, rejected=infeasible.reason)
    except EgoFailed as failed:
        return _invalid(run, seed, scene.values, tally, point, failed)
    own = actor is agent
    actor.begin(genes)
    if not own:
        agent.begin(genes)
    for step in range(run.problem.family.horizon_steps):  # Alg. 1, l. 6
        guard.step(step)
        action = actor.act(observation, explore=learning)  # Alg. 1, l. 7
        robustness = info["robustness"]
        try:
            next_observation, risk_reward, terminated, truncated, info = env.step(action)  # Alg. 1, l. 8
        except EgoFailed as failed:
            return _invalid(run, seed, scene.values, tally, point, failed)
        parts = risk_reward, info["cost"], robustness, info["robustness"]
        tally.add(risk_reward, info["cost"], run.reward(*parts, float(terminated), agent.dual_variable))
        if learning:
            agent.observe(  # Alg. 1, l. 9-12
                Transition(
                    observation=observation,
                    action=action,
                    risk_reward=risk_reward,
                    cost=info["cost"],
                    robustness=robustness,
                    next_robustness=info["robustness"],
                    next_observation=next_observation,
                    terminated=terminated,
                    accumulated_reward=tally.shaped_return,
                ),
                own=own,
            )
            if own:
                agent.update()  # Alg. 1, l. 13-16
        observation = next_observation
        if terminated or truncated or actor.hopeless:  # Alg. 1, l. 17-19
            break
    collision = info.get("collision")
    encounter = Encounter(collision=collision, encounters_s=env.trace.encounters_s(run.problem.family.adversaries))
    objective = run.searchers.tell(point, tally.shaped_return / tally.steps, encounter)  # Alg. 1, l. 21-22
    script = tuple(genes.tolist()) or None
    return _record(run, seed, scene.values, tally, objective=objective, script=script, collision=collision)


@dataclass(slots=True)
class Tally:
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


def _invalid(
    run: RunState, seed: int, scene: Mapping[str, float], tally: Tally, point: Floats, failed: EgoFailed
) -> EpisodeRecord:
    """An episode that the ego did not drive to its end; what it might have come to, nobody knows."""
    logger.warning("episode %d is invalid: %s", len(run.records), failed)
    run.searchers.tell(point, None)
    return _record(run, seed, scene, tally, invalid=failed.reason)


def _record(
    run: RunState,
    seed: int,
    scene: Mapping[str, float],
    tally: Tally,
    *,
    objective: float | None = None,
    rejected: str = "",
    invalid: str = "",
    script: tuple[float, ...] | None = None,
    collision: Collision | None = None,
) -> EpisodeRecord:
    outcome, reason = (Outcome.INVALID, invalid) if invalid else _outcome(rejected, collision)
    crashed = rejected == SIM_CRASH
    return EpisodeRecord(
        index=len(run.records),
        phase=RECORDED[run.phase],
        seed=seed,
        scene=scene,
        outcome=outcome,
        reason=reason,
        steps=tally.steps,
        risk_return=tally.risk_return,
        shaped_return=tally.shaped_return,
        mean_cost=tally.cost / tally.steps if tally.steps else 0.0,
        min_ttc_s=TTC_CAP_S if crashed else run.env.trace.min_ttc_s,
        min_robustness=ROBUSTNESS_CLIP if crashed else run.env.trace.min_robustness,
        objective=objective,
        dual_variable=run.searchers.agent.dual_variable,
        temperature=run.searchers.agent.temperature,
        environment_steps=run.environment_steps + tally.steps,
        script=script,
        collision=collision,
    )


def _outcome(rejected: str, collision: Collision | None) -> tuple[Outcome, str]:
    """How an episode ended, and the rules that say so."""
    if rejected:
        return Outcome.REJECTED, rejected
    if collision is None:
        return Outcome.SAFE, ""
    return (Outcome.FAILURE if collision.valid else Outcome.DEGENERATE), ", ".join(collision.broken)


def episode_seed(run_seed: int, index: int) -> int:
    """Seed of one episode; the same for every search, so that methods meet the same background traffic."""
    return int(np.random.SeedSequence((run_seed, index)).generate_state(1)[0] >> 1)
