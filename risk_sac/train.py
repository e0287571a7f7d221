"""Algorithm 1 of RISK-SAC: one run from its settings to its results.

Source: RISK-SAC, Algorithm 1; each line is tagged where it happens. Lines 9-16 live one level down, in
`risk_sac.agents.learner`, because the reward is formed when a batch is sampled.
"""

import logging
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Protocol

import numpy as np
import torch

from risk_sac.agents.learner import Learner
from risk_sac.agents.random import RandomAgent
from risk_sac.agents.replay import Transition
from risk_sac.agents.scripted import ScriptedAgent
from risk_sac.config import METHODS, RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from risk_sac.metrics import MetricsAccumulator, results_digest
from risk_sac.problem import Problem
from risk_sac.risk.reward import training_reward
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.risk.ttc import TTC_CAP_S
from risk_sac.run_folder import checkpoint
from risk_sac.run_folder.crashes import CrashGuard
from risk_sac.run_folder.durable import sha256
from risk_sac.run_folder.episode_json import records_from_json, records_to_json
from risk_sac.run_folder.results import FAILURES, series_name
from risk_sac.run_folder.series import write_series
from risk_sac.scene_optimizer import BotorchOptimizer, SceneOptimizer, SobolOptimizer
from risk_sac.types import Collision, EpisodeRecord, Outcome, RunMetrics, SeriesFile

logger = logging.getLogger(__name__)

CHECKPOINT = "checkpoint"
SIM_CRASH = "sim_crash"  # reason of a rejection
CONTROLS: dict[str, type[RandomAgent | ScriptedAgent]] = {
    "scripted": ScriptedAgent,
    "random": RandomAgent,
    "none": RandomAgent,
}
PACKAGES = ("risk-sac", "libsumo", "torch", "botorch", "gpytorch", "rtamt", "numpy")


class Observer(Protocol):
    """Who wants to know how a run goes, and may end it."""

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """After each episode; `series` is its file below `failures/` if the ego touched something.

        A resumed run first tells of the episodes in its checkpoint again: whoever listened before may have been
        gone when the last of them were told.
        """

    def should_stop(self) -> bool:
        """Polled between episodes."""


@dataclass(frozen=True, slots=True)
class RunSummary:
    """What a run leaves behind."""

    metrics: RunMetrics  # of the search
    evaluation: RunMetrics | None  # of the frozen policy, if the budget has evaluation episodes
    digest: str  # of all records: the same spec gives the same digest
    finished: bool  # False when the observer ended it
    versions: Mapping[str, str]
    device: str  # where the networks lived
    wall_s: float  # of this process; excludes what was done before a resume
    cpu_s: float  # the same in processor time, which a busy machine does not lengthen


def train(spec: RunSpec, folder: Path, observer: Observer) -> RunSummary:
    """Executes a run, or goes on with one whose checkpoint lies in `folder`.

    Args:
      spec: what to run.
      folder: gets the checkpoint and, below `failures/`, the time series of every contact.
      observer: told of each episode.

    Raises:
      ConfigError: the spec poses no problem that can be run.
      CheckpointError: the checkpoint is of another run.
      OSError: the folder cannot be written.
    """
    started, started_cpu = time.monotonic(), time.process_time()
    folder.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)  # runs are what is parallel
    run = Run(spec, folder)
    try:
        for record, metrics in run.resume():
            observer.episode(record, metrics, run.series.get(record.index))
        total = spec.budget.episodes + spec.budget.evaluation_episodes
        with CrashGuard(folder) as guard:
            while len(run.records) < total and not observer.should_stop():
                record = run.episode(len(run.records), guard)  # Alg. 1, l. 3
                observer.episode(record, run.metrics_after(record), run.series.get(record.index))
                if len(run.records) % spec.learner.checkpoint_every == 0:
                    run.save()
            run.save()
    finally:
        run.close()
    return run.summary(
        finished=len(run.records) == total,
        wall_s=time.monotonic() - started,
        cpu_s=time.process_time() - started_cpu,
    )


class Run:
    """The state of a run between two episodes.

    Attributes:
      records: of its episodes so far.
      series: by episode, where the ego touched something.
    """

    def __init__(self, spec: RunSpec, folder: Path) -> None:
        self._spec = spec
        self._folder = folder
        self._method = METHODS[spec.method]
        self._problem = Problem.from_spec(spec)
        self._env = RiskSacEnv(self._problem, spec.learner.reward, controlled=self._method.agent != "none")
        observation_size, action_size = self._env.observation_size, self._env.action_size
        self._optimizer: SceneOptimizer  # Alg. 1, l. 1
        optimizer = BotorchOptimizer if self._method.scenes == "botorch" else SobolOptimizer
        self._optimizer = optimizer(self._problem.space.dimension, spec.learner.scenes, spec.seed)
        self._agent: Learner | RandomAgent | ScriptedAgent  # Alg. 1, l. 2
        if self._method.agent in CONTROLS:
            self._agent = CONTROLS[self._method.agent](action_size, spec.seed)
        else:
            self._agent = Learner(observation_size, action_size, self._method, spec.learner, spec.seed)
        self.records: list[EpisodeRecord] = []
        self.series: dict[int, SeriesFile] = {}
        self._saved = 0  # records in the newest checkpoint
        self._search = MetricsAccumulator(self._problem.family.horizon_steps)
        self._evaluation = MetricsAccumulator(self._problem.family.horizon_steps)

    def episode(self, index: int, guard: CrashGuard) -> EpisodeRecord:
        """One episode of Algorithm 1, lines 4 to 22; in the evaluation phase the policy is frozen.

        An episode that crashes the simulator, as its guard knows, is treated like a rejected scene.

        Choice: scenes keep coming from the method's own sampler during evaluation, since it is the pair of
        sampler and policy that generates scenarios.
        """
        learning = index < self._spec.budget.episodes
        seed = episode_seed(self._spec.seed, index)
        playable = guard.begin(index)
        point = self._optimizer.ask()  # Alg. 1, l. 4
        scene = self._problem.space.from_unit(point)
        tally = Tally()
        try:
            if not playable:
                raise InfeasibleScene("this episode crashes the simulator", reason=SIM_CRASH)
            observation, info = self._env.reset(seed=seed, options={"scene": scene})  # Alg. 1, l. 5
        except InfeasibleScene as infeasible:
            self._optimizer.tell(point, None)
            return self._record(index, seed, scene.values, tally, objective=None, rejected=infeasible.reason)
        robustness = info["robustness"]
        for step in range(self._problem.family.horizon_steps):  # Alg. 1, l. 6
            guard.step(step)
            action = self._agent.act(observation, explore=learning)  # Alg. 1, l. 7
            next_observation, reward, terminated, truncated, info = self._env.step(action)  # Alg. 1, l. 8
            tally.add(reward, info["cost"], self._shaped(reward, info, robustness, terminated))
            if learning:
                self._agent.observe(  # Alg. 1, l. 9-12
                    Transition(
                        observation=observation,
                        action=action,
                        risk_reward=reward,
                        cost=info["cost"],
                        robustness=robustness,
                        next_robustness=info["robustness"],
                        next_observation=next_observation,
                        terminated=terminated,
                        accumulated_reward=tally.shaped_return,
                    )
                )
                self._agent.update()  # Alg. 1, l. 13-16
            observation, robustness = next_observation, info["robustness"]
            if terminated or truncated:  # Alg. 1, l. 17-19
                break
        objective = self._optimizer.tell(point, tally.shaped_return / tally.steps)  # Alg. 1, l. 21-22
        collision = info.get("collision")
        if collision is not None:
            self.series[index] = write_series(self._folder / FAILURES / series_name(index), self._env.trace.series())
        return self._record(index, seed, scene.values, tally, objective, collision=collision)

    def _shaped(self, reward: float, info: Mapping[str, float], robustness: float, terminated: bool) -> float:
        """R' of this step under today's λ; what the scene optimiser and the record see."""
        config = self._spec.learner
        return training_reward(
            reward,
            info["cost"],
            robustness,
            info["robustness"],
            float(terminated),
            dual_variable=self._agent.dual_variable,
            shaped=self._method.shaping,
            zero_terminal_potential=config.reward.zero_terminal_potential,
            discount=config.agent.discount,
        )

    def _record(
        self,
        index: int,
        seed: int,
        scene: Mapping[str, float],
        tally: "Tally",
        objective: float | None,
        *,
        rejected: str = "",
        collision: Collision | None = None,
    ) -> EpisodeRecord:
        if rejected:
            outcome, reason = Outcome.REJECTED, rejected
        elif collision is None:
            outcome, reason = Outcome.SAFE, ""
        else:
            outcome = Outcome.FAILURE if collision.valid else Outcome.DEGENERATE
            reason = ", ".join(rule for rule, passed in collision.verdicts.items() if not passed)
        before = self.records[-1].environment_steps if self.records else 0
        record = EpisodeRecord(
            index=index,
            phase="train" if index < self._spec.budget.episodes else "evaluate",
            seed=seed,
            scene=scene,
            outcome=outcome,
            reason=reason,
            steps=tally.steps,
            risk_return=tally.risk_return,
            shaped_return=tally.shaped_return,
            mean_cost=tally.cost / tally.steps if tally.steps else 0.0,
            min_ttc_s=TTC_CAP_S if rejected == SIM_CRASH else self._env.min_ttc_s,
            min_robustness=ROBUSTNESS_CLIP if rejected == SIM_CRASH else self._env.min_robustness,
            objective=objective,
            dual_variable=self._agent.dual_variable,
            temperature=self._agent.temperature,
            environment_steps=before + tally.steps,
            collision=collision,
        )
        self.records.append(record)
        return record

    def metrics_after(self, record: EpisodeRecord) -> RunMetrics:
        """Counts a record, in its own phase."""
        return (self._search if record.phase == "train" else self._evaluation).add(record)

    def summary(self, *, finished: bool, wall_s: float, cpu_s: float) -> RunSummary:
        """What the run has achieved so far."""
        return RunSummary(
            metrics=self._search.metrics(),
            evaluation=self._evaluation.metrics() if self._spec.budget.evaluation_episodes else None,
            digest=results_digest(self.records),
            finished=finished,
            versions={name: version(name) for name in PACKAGES},
            device=self._agent.device,
            wall_s=wall_s,
            cpu_s=cpu_s,
        )

    def save(self) -> None:
        """Writes the checkpoint, if there is something new; only ever called between episodes."""
        if self._saved == len(self.records):
            return
        state = {
            "records": records_to_json(self.records),
            "series": {index: file.sha256 for index, file in self.series.items()},
            "optimizer": self._optimizer.state(),
            "agent": self._agent.state(),
        }
        checkpoint.save(self._folder / CHECKPOINT, state, self._spec.digest)
        self._saved = len(self.records)

    def resume(self) -> list[tuple[EpisodeRecord, RunMetrics]]:
        """Goes on from the folder's newest good checkpoint, if there is one; its episodes with the metrics after each.

        Without one the run begins anew; either way it comes to the same results.
        """
        state = checkpoint.load_newest(self._folder / CHECKPOINT, self._spec.digest)
        if state is None:
            return []
        self.records = records_from_json(state["records"])
        self.series = self._series(state.get("series", {}))  # checkpoints of earlier versions have none
        self._optimizer.load(state["optimizer"])
        self._agent.load(state["agent"])
        self._saved = len(self.records)
        logger.info("resumed after %d episodes", len(self.records))
        return [(record, self.metrics_after(record)) for record in self.records]

    def _series(self, digests: Mapping[int, str]) -> dict[int, SeriesFile]:
        """The series of the records, with the digests they were written with, whatever became of the files since."""
        found = {}
        for record in self.records:
            if record.collision is None:
                continue
            file = self._folder / FAILURES / series_name(record.index)
            actual = sha256(file)
            digest = digests.get(record.index, actual)
            if actual is None or actual != digest:
                logger.warning("the time series %s is damaged or gone; only a new run can record it again", file)
            if digest is not None:
                found[record.index] = SeriesFile(file.name, digest)
        return found

    def close(self) -> None:
        """Ends the simulation."""
        self._env.close()


@dataclass(slots=True)
class Tally:
    """Sums over one episode."""

    steps: int = 0
    risk_return: float = 0.0
    shaped_return: float = 0.0
    cost: float = 0.0

    def add(self, reward: float, cost: float, shaped: float) -> None:
        """Counts one step."""
        self.steps += 1
        self.risk_return += reward
        self.cost += cost
        self.shaped_return += shaped


def episode_seed(run_seed: int, index: int) -> int:
    """Seed of one episode; the same for every method, so that methods meet the same background traffic."""
    return int(np.random.SeedSequence((run_seed, index)).generate_state(1)[0] >> 1)
