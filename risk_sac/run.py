"""What a run is between two episodes: its parts, its episodes so far, and how they are kept on disk.

Source: RISK-SAC, Algorithm 1, l. 1-2.
"""

import logging
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from risk_sac.agents.follower import ScriptFollower
from risk_sac.agents.learner import Learner
from risk_sac.agents.random import RandomAgent
from risk_sac.agents.scripted import ScriptedAgent
from risk_sac.config import METHODS, RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.metrics import MetricsAccumulator, results_digest
from risk_sac.problem import Problem
from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.risk.reward import TrainingReward
from risk_sac.run_folder import checkpoint
from risk_sac.run_folder.durable import sha256
from risk_sac.run_folder.episode_json import records_from_json, records_to_json
from risk_sac.run_folder.results import FAILURES, series_name
from risk_sac.run_folder.series import write_series
from risk_sac.scene_optimizer import ArchiveOptimizer, BotorchOptimizer, Encounter, SceneOptimizer, SobolOptimizer
from risk_sac.scene_optimizer.base import NOBODY
from risk_sac.types import Floats

logger = logging.getLogger(__name__)

CHECKPOINT = "checkpoint"
PACKAGES = ("risk-sac", "libsumo", "torch", "botorch", "gpytorch", "rtamt", "numpy")
Actor = Learner | RandomAgent | ScriptedAgent | ScriptFollower
CONTROLS: Mapping[str, type[RandomAgent | ScriptedAgent]] = {
    "scripted": ScriptedAgent,
    "random": RandomAgent,
    "none": RandomAgent,
}
OPTIMIZERS: Mapping[str, type[BotorchOptimizer | ArchiveOptimizer | SobolOptimizer]] = {
    "botorch": BotorchOptimizer,
    "archive": ArchiveOptimizer,
    "sobol": SobolOptimizer,
}


class Pair(NamedTuple):
    """Who makes an episode."""

    optimizer: SceneOptimizer  # proposes the scene, and the genes of scripts where the actor follows some
    actor: Actor


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
    episode_cpu_s: tuple[float, ...]  # processor time from the beginning, a resume or none, to the end of each episode


class RunState:
    """The parts that a run's episodes are played with, and the episodes so far.

    Attributes:
      spec: what to run.
      problem: what to falsify.
      env: the closed loop.
      scene_size: coordinates of a proposed point that say the scene; those behind are the genes of scripts.
      agent: the method's, which drives the adversaries once it is warm, and learns.
      reward: what the agent is trained on, and the scenes are scored by.
      records: of the episodes so far.
      series: by episode, where the ego touched something.
    """

    def __init__(self, spec: RunSpec, folder: Path) -> None:
        """Begins a run anew; `resume` goes on with what lies in the folder."""
        self._cpu_began_s = time.process_time()
        method = METHODS[spec.method]
        self.spec = spec
        self.problem = Problem.from_spec(spec)
        self.env = RiskSacEnv(self.problem, spec.learner.reward, controlled=method.agent != "none")
        self.agent: Actor  # Alg. 1, l. 2
        if method.agent in CONTROLS:
            self.agent = CONTROLS[method.agent](self.env.action_size, spec.seed)
        elif method.agent == "scripts":
            self.agent = ScriptFollower(self.problem.family)
        else:
            sizes = self.env.observation_size, self.env.action_size
            self.agent = Learner(*sizes, method, spec.learner, spec.seed)
        self.scene_size = self.problem.space.dimension
        self._own = self._pair(self.agent, OPTIMIZERS[method.scenes])  # Alg. 1, l. 1
        self._guide = self._pair(ScriptFollower(self.problem.family), ArchiveOptimizer) if method.learns else None
        self.reward = TrainingReward(method, spec.learner)
        self.records: list[EpisodeRecord] = []
        self.series: dict[int, SeriesFile] = {}
        self._episode_cpu_s: list[float] = []
        self._folder = folder
        self._saved = 0  # records in the newest checkpoint
        self._search = MetricsAccumulator(self.problem.family.horizon_steps)
        self._evaluation = MetricsAccumulator(self.problem.family.horizon_steps)

    @property
    def finished(self) -> bool:
        """Whether its budget is spent."""
        budget = self.spec.budget
        return not self.learning and len(self.records) - self._search.episodes >= budget.evaluation_episodes

    @property
    def learning(self) -> bool:
        """Whether the next episode is one of the search; in the evaluation the policy is frozen."""
        budget, played = self.spec.budget, self._search.episodes
        spent = bool(played) and budget.cpu_s is not None and self._episode_cpu_s[played - 1] >= budget.cpu_s
        return played < budget.episodes and not spent

    def pair(self) -> Pair:
        """Who makes the next episode: the method's own sampler and agent, or what guides a learner.

        Choice: a learner's memory is filled by an archive search that goes on until it has found failures enough, and
        not by uniform actions, which hardly find any. All learners are warmed alike.
        """
        if self._guide is None or not self.learning:
            return self._own
        warm_start = self.spec.learner.warm_start
        count = self._search.episodes
        if count < warm_start.episodes and self._search.failures < warm_start.failures:
            return self._guide
        share = METHODS[self.spec.method].scripts_share
        return self._guide if math.floor(share * (count + 1)) > math.floor(share * count) else self._own

    def told(self, pair: Pair, point: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
        """Tells who proposes scenes what came of the episode; f_e by the proposer's account."""
        if pair is not self._own:
            self._own.optimizer.tell(point[: self.scene_size], mean_return, encounter)
        return pair.optimizer.tell(point, mean_return, encounter)

    @property
    def environment_steps(self) -> int:
        """Of all episodes so far."""
        return self.records[-1].environment_steps if self.records else 0

    def add(self, record: EpisodeRecord) -> RunMetrics:
        """Takes up the episode that `env` has just played, writes its contact's time series, and counts it.

        Returns:
          The metrics of its phase.
        """
        if record.collision is not None:
            file = self._folder / FAILURES / series_name(record.index)
            self.series[record.index] = write_series(file, self.env.trace.series())
        self.records.append(record)
        self._episode_cpu_s.append(time.process_time() - self._cpu_began_s)
        return self._count(record)

    def save(self) -> None:
        """Writes the checkpoint, if there is something new; only ever called between episodes."""
        if self._saved == len(self.records):
            return
        state = {
            "records": records_to_json(self.records),
            "episode_cpu_s": self._episode_cpu_s,
            "series": {index: file.sha256 for index, file in self.series.items()},
            "optimizer": self._own.optimizer.state(),
            "agent": self.agent.state(),
            "guide": self._guide.optimizer.state() if self._guide else None,
        }
        checkpoint.save(self._folder / CHECKPOINT, state, self.spec.digest)
        self._saved = len(self.records)

    def resume(self) -> list[tuple[EpisodeRecord, RunMetrics]]:
        """Goes on from the folder's newest good checkpoint, if there is one; its episodes with the metrics after each.

        Without one the run begins anew; either way it comes to the same results.
        """
        state = checkpoint.load_newest(self._folder / CHECKPOINT, self.spec.digest)
        if state is None:
            return []
        self.records = records_from_json(state["records"])
        self.series = _series(self._folder, self.records, state.get("series", {}))  # older checkpoints have none
        self._own.optimizer.load(state["optimizer"])
        if self._guide:
            self._guide.optimizer.load(state["guide"])
        self.agent.load(state["agent"])
        self._episode_cpu_s = list(state["episode_cpu_s"])
        self._cpu_began_s = time.process_time() - self._episode_cpu_s[-1]
        self._saved = len(self.records)
        logger.info("resumed after %d episodes", len(self.records))
        return [(record, self._count(record)) for record in self.records]

    def summary(self, *, wall_s: float, cpu_s: float) -> RunSummary:
        """What the run has achieved so far, and the time that it took this process."""
        return RunSummary(
            metrics=self._search.metrics(),
            evaluation=self._evaluation.metrics() if self.spec.budget.evaluation_episodes else None,
            digest=results_digest(self.records),
            finished=self.finished,
            versions={name: version(name) for name in PACKAGES},
            device=self.agent.device,
            wall_s=wall_s,
            cpu_s=cpu_s,
            episode_cpu_s=tuple(self._episode_cpu_s),
        )

    def close(self) -> None:
        """Ends the simulation."""
        self.env.close()

    def _pair(self, actor: Actor, optimizer: type[BotorchOptimizer | ArchiveOptimizer | SobolOptimizer]) -> Pair:
        return Pair(optimizer(self.scene_size + actor.genes, self.spec.learner.scenes, self.spec.seed), actor)

    def _count(self, record: EpisodeRecord) -> RunMetrics:
        return (self._search if record.phase == "train" else self._evaluation).add(record)


def _series(folder: Path, records: list[EpisodeRecord], digests: Mapping[int, str]) -> dict[int, SeriesFile]:
    """The series of the records, with the digests they were written with, whatever became of the files since."""
    found = {}
    for record in records:
        if record.collision is None:
            continue
        file = folder / FAILURES / series_name(record.index)
        actual = sha256(file)
        digest = digests.get(record.index, actual)
        if actual is None or actual != digest:
            logger.warning("the time series %s is damaged or gone; only a new run can record it again", file)
        if digest is not None:
            found[record.index] = SeriesFile(file.name, digest)
    return found
