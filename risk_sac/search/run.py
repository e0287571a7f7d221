"""Run state between two episodes, and its checkpoint."""

import hashlib
import logging
import os
import struct
from array import array
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from risk_sac.config import RunSpec, method_of
from risk_sac.egos.guard import DEAD_AFTER
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import ConfigError
from risk_sac.metrics import MetricsAccumulator, ResultsDigest
from risk_sac.records import DrivenBy, EpisodeRecord, Outcome, Phase, RunMetrics, SeriesFile, stored
from risk_sac.risk.reward import TrainingReward
from risk_sac.run_folder import checkpoint
from risk_sac.run_folder.durable import sha256
from risk_sac.run_folder.results import EPISODES, FAILURES, records_from_lines, series_name
from risk_sac.run_folder.series import write_series
from risk_sac.search.agents.snapshot import PolicySnapshot
from risk_sac.search.playing import PlayedEpisode, Proposal
from risk_sac.search.searchers import Searchers
from risk_sac.verdicts.judge import DEFINITIONS
from risk_sac.world.jit import cpu_s

logger = logging.getLogger(__name__)

CHECKPOINT = "checkpoint"
PLAYED = "played.bin"
ROW = struct.Struct("<d32s")  # of `played.bin`, for each episode: processor time, s, and SHA-256 of its series
LATEST = 200  # number of latest records in which the episodes of a dead ego are looked for
PACKAGES = ("risk-sac", "libsumo", "torch", "botorch", "gpytorch", "rtamt", "numpy")


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """Results of a run."""

    metrics: RunMetrics  # of the search, or of the i.i.d. phase that the run is
    evaluation: RunMetrics | None  # of the frozen policy, if the budget has evaluation episodes
    digest: str  # of all records: the same spec gives the same digest
    finished: bool  # False when the observer ended it
    versions: Mapping[str, str]
    device: str
    processes: int  # that played its episodes, at most so many at a time
    wall_s: float  # of this process; excludes what was done before a resume
    cpu_s: float  # the same in processor time, which a busy machine does not lengthen
    episode_cpu_s: tuple[float, ...]  # from the run's start to each episode's end, resumes included, compilation not


class RunState:
    """Parts of a run, and its episodes so far.

    Records are appended to the folder's `episodes.jsonl`, and what a resumed run needs of each beside its record to
    `played.bin`. A checkpoint holds the length and digest of the former, so it does not grow with the episodes.

    Attributes:
      spec: what to run.
      problem: what to falsify.
      env: the closed loop.
      searchers: propose the scenes and drive the adversaries.
      reward: what the agent is trained on, and the scenes are scored by.
      episodes: how many there have been.
      latest: records of the latest ones; all are in the file.
      proposed: episodes that other processes play, in their order.
      series: time series by episode, where a requirement that counts was violated.
    """

    def __init__(self, spec: RunSpec, folder: Path) -> None:
        """Begins a run; `resume` continues the one in the folder."""
        self.spec = spec
        self.env = RiskSacEnv.of(spec)
        self.problem = self.env.problem
        self.searchers = Searchers(spec, self.problem, self.env.observation_size, self.env.action_size)
        self.reward = TrainingReward(method_of(spec.method), spec.learner)
        self.episodes = 0
        self.latest: deque[EpisodeRecord] = deque(maxlen=LATEST)
        self.proposed: deque[Proposal] = deque()
        self.series: dict[int, SeriesFile] = {}
        self._episode_cpu_s = array("d")
        self._folder = folder
        self._saved = 0  # episodes in the newest checkpoint
        self._written = 0  # bytes of `episodes.jsonl` that are of these records
        self._digest = hashlib.sha256()  # of those bytes
        self._results = ResultsDigest()
        self._search = MetricsAccumulator(self.problem.family.horizon_steps)
        self._evaluation = MetricsAccumulator(self.problem.family.horizon_steps)
        self._cpu_began_s = cpu_s()
        self.rollouts_cpu_s = 0.0

    @property
    def in_rounds(self) -> bool:
        """Says whether several episodes are asked for at a time."""
        return self.spec.budget.batch > 1 and method_of(self.spec.method).in_rounds

    @property
    def finished(self) -> bool:
        """Whether the budget is spent."""
        return self.spent and not self.proposed

    @property
    def spent(self) -> bool:
        """Whether all episodes of the budget are played or proposed."""
        return not self.learning and self.next_index - self._search_episodes >= self.spec.budget.evaluation_episodes

    @property
    def waits(self) -> bool:
        """Whether the next episode depends on one that is out."""
        learns_yet = self.searchers.learns and any(proposal.learning for proposal in self.proposed)
        return (learns_yet and not self.learning) or self.searchers.waits(len(self.proposed))

    @property
    def next_index(self) -> int:
        """Index of the next episode to propose."""
        return self.episodes + len(self.proposed)

    @property
    def _search_episodes(self) -> int:
        return self._search.episodes + sum(proposal.phase != "evaluation" for proposal in self.proposed)

    @property
    def learning(self) -> bool:
        """Whether the next episode is of the search, not the frozen evaluation."""
        budget, played, points = self.spec.budget, self._search_episodes, self.searchers.points
        most = budget.episodes if points is None else min(budget.episodes, points)
        if played < budget.least_episodes or budget.cpu_s is None:
            return played < most
        return played < most and self._episode_cpu_s[min(played, self.episodes) - 1] < budget.cpu_s

    @property
    def phase(self) -> Phase:
        """Phase of the next episode."""
        if self.spec.iid:
            return "iid"
        return "search" if self.learning else "evaluation"

    @property
    def environment_steps(self) -> int:
        """Steps of all episodes so far."""
        return self.latest[-1].environment_steps if self.latest else 0

    def add(self, record: EpisodeRecord, played: PlayedEpisode) -> RunMetrics:
        """Adds a played episode; writes its record and a violation's time series.

        Returns:
          The metrics of its phase.
        """
        if played.series is not None:
            file = self._folder / FAILURES / series_name(record.index)
            self.series[record.index] = write_series(file, played.series)
        if self.in_rounds:
            self.rollouts_cpu_s += played.cpu_s
        self._append(record)
        self.searchers.add(record)
        metrics = self._count(record)
        self._append_played(record, cpu_s() - self._cpu_began_s + self.rollouts_cpu_s)
        return metrics

    def refuse_dead_ego(self) -> None:
        """Ends a run whose ego failed in each of the latest episodes.

        A resumed run goes on from the latest checkpoint.

        Raises:
          ConfigError: with the reason of the latest failure.
        """
        driven = [record for record in self.latest if record.outcome is not Outcome.REJECTED]
        latest = driven[-DEAD_AFTER:]
        if len(latest) == DEAD_AFTER and all(record.outcome is Outcome.INVALID for record in latest):
            raise ConfigError(
                "ego.driver",
                f"{self.spec.ego.driver!r}, which failed in {DEAD_AFTER} episodes in a row, the last time with "
                f"{latest[-1].reason}",
                "one that drives",
            )

    def save(self) -> None:
        """Writes the checkpoint after a new episode; call between episodes only."""
        if self._saved == self.episodes:
            return
        for name in (EPISODES, PLAYED):
            with (self._folder / name).open("rb") as file:
                os.fsync(file.fileno())
        policies = {id(one.policy): one.policy for one in self.proposed if one.policy is not None}
        numbers = {known: number for number, known in enumerate(policies)}
        state = {
            "episodes_bytes": self._written,
            "episodes_sha256": self._digest.hexdigest(),
            "proposed": [{**one.state(), "policy": numbers.get(id(one.policy))} for one in self.proposed],
            "policies": [policy.state() for policy in policies.values()],
            **self.searchers.state(),
        }
        checkpoint.save(self._folder / CHECKPOINT, state, self.spec.digest)
        self._saved = self.episodes

    def resume(self) -> list[tuple[EpisodeRecord, RunMetrics]]:
        """Continues from the folder's newest intact checkpoint, or from the beginning.

        Either way the results are the same.

        Returns:
          The episodes of the checkpoint with the metrics after each.
        """
        state = checkpoint.load_newest(self._folder / CHECKPOINT, self.spec.digest)
        if state is None:
            return []
        content = _beginning(self._folder / EPISODES, state["episodes_bytes"])
        digest = hashlib.sha256(content)
        if digest.hexdigest() != state["episodes_sha256"]:
            logger.warning("%s is damaged or gone; the run starts from the beginning", self._folder / EPISODES)
            return []
        records = records_from_lines(content)
        played = self._read_played(state, len(records))
        if played is None:
            logger.warning("%s is damaged or gone; the run starts from the beginning", self._folder / PLAYED)
            return []
        self._written, self._digest = len(content), digest
        digests, self._episode_cpu_s = played
        self.series = _series(self._folder, records, digests)
        self.searchers.load(state, records)
        policies = [self.searchers.snapshot_of(policy) for policy in state["policies"]]
        self.proposed = deque(self._proposal(proposed, policies) for proposed in state["proposed"])
        self._cpu_began_s = cpu_s() - self._episode_cpu_s[-1]
        self._saved = len(records)
        logger.info("resumed after %d episodes", len(records))
        return [(record, self._count(record)) for record in records]

    def summary(self, *, wall_s: float, cpu_s: float, processes: int) -> RunOutcome:
        """Summarises the run so far; times and processes are of this invocation."""
        return RunOutcome(
            metrics=self._search.metrics(),
            evaluation=self._evaluation.metrics() if self.spec.budget.evaluation_episodes else None,
            digest=self._results.hexdigest(),
            finished=self.finished,
            versions={name: version(name) for name in PACKAGES} | {"definitions": str(DEFINITIONS)},
            device=self.searchers.agent.device,
            processes=processes,
            wall_s=wall_s,
            cpu_s=cpu_s,
            episode_cpu_s=tuple(self._episode_cpu_s),
        )

    def close(self) -> None:
        """Ends the simulation."""
        self.env.close()

    def _proposal(self, state: dict[str, Any], policies: Sequence[PolicySnapshot]) -> Proposal:
        """Returns a proposal as an earlier process has made it."""
        self.searchers.recall(guided=state["guided"])
        scene, genes = self.searchers.split(state["point"])
        driven_by = state["driven_by"] and DrivenBy(state["driven_by"])
        policy = None if state["policy"] is None else policies[state["policy"]]
        return Proposal(**{**state, "scene": scene, "genes": genes, "driven_by": driven_by, "policy": policy})

    def _append(self, record: EpisodeRecord) -> None:
        """Appends a record; cuts off what an interrupted run wrote there."""
        line = stored(record).encode() + b"\n"
        _overwrite(self._folder / EPISODES, self._written, line)
        self._written += len(line)
        self._digest.update(line)

    def _append_played(self, record: EpisodeRecord, spent_s: float) -> None:
        """Writes an episode's processor time, and the digest of its series."""
        series = self.series.get(record.index)
        digest = bytes(ROW.size - 8) if series is None else bytes.fromhex(series.sha256)
        _overwrite(self._folder / PLAYED, len(self._episode_cpu_s) * ROW.size, ROW.pack(spent_s, digest))
        self._episode_cpu_s.append(spent_s)

    def _read_played(self, state: Mapping[str, Any], episodes: int) -> "tuple[Mapping[int, str], array[float]] | None":
        """Reads what `_append_played` wrote of some episodes; None if incomplete."""
        if "episode_cpu_s" in state:  # of an earlier version, whose checkpoints held all
            known, none = state["series"], bytes(ROW.size - 8).hex()
            rows = [ROW.pack(s, bytes.fromhex(known.get(k, none))) for k, s in enumerate(state["episode_cpu_s"])]
            _overwrite(self._folder / PLAYED, 0, b"".join(rows))
        content = _beginning(self._folder / PLAYED, episodes * ROW.size)
        if len(content) < episodes * ROW.size:
            return None
        played = [*ROW.iter_unpack(content)]
        digests = {index: digest.hex() for index, (_, digest) in enumerate(played) if any(digest)}
        return digests, array("d", [spent_s for spent_s, _ in played])

    def _count(self, record: EpisodeRecord) -> RunMetrics:
        self.episodes += 1
        self.latest.append(record)
        self._results.add(record)
        return (self._evaluation if record.evaluating else self._search).add(record)


def _overwrite(file: Path, start: int, content: bytes) -> None:
    """Writes the end of a file from a position on."""
    with file.open("r+b" if start else "wb") as opened:
        opened.truncate(start)
        opened.seek(start)
        opened.write(content)


def _beginning(file: Path, length: int) -> bytes:
    """Reads up to `length` bytes of a file; none if missing."""
    try:
        with file.open("rb") as opened:
            return opened.read(length)
    except FileNotFoundError:
        return b""


def _series(folder: Path, records: list[EpisodeRecord], digests: Mapping[int, str]) -> dict[int, SeriesFile]:
    """Returns intact time series with their digests; logs damaged files."""
    series = {}
    for record in records:
        if record.worst_violation is None:
            continue
        file = folder / FAILURES / series_name(record.index)
        actual = sha256(file)
        digest = digests.get(record.index, actual)
        if actual is None or actual != digest:
            logger.warning("the time series %s is damaged or gone; only a new run can record it again", file)
        if digest is not None:
            series[record.index] = SeriesFile(file.name, digest)
    return series
