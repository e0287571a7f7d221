"""Runs a search until it detects a planted defect or ends its budget."""

import logging
import multiprocessing
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from risk_sac.config import Budget, EgoConfig, MethodName, RunMethod, RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.egos.defects.catalogue import DEFECTS, version_of
from risk_sac.egos.registry import pinned
from risk_sac.env.problem import check_installed
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.failures.play import candidates, detected
from risk_sac.records import EpisodeRecord, Record, RunMetrics, SeriesFile
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import FAILURES
from risk_sac.search.loop import execute_run

ANSWER = "detection.json"
MOST_EPISODES = 20_000  # bounds the episodes, since refused scenes cost no steps


class Detection(Record):
    """Outcome of a run against an ego with defects.

    Times are environment steps up to the end of an episode.
    """

    defects: tuple[str, ...]
    family: str
    method: RunMethod
    seed: int
    budget_steps: int
    """What the run might have spent."""
    steps: int
    """What it has spent."""
    episodes: int
    reached: int | None
    """Until a defect first changed a command; null if none did, or SUMO drives the ego."""
    triggered: int | None
    """Until a requirement was first validly violated; null if none was."""
    detected: int | None
    """Until a failure first showed the defect, see `failures.play`; null if none did."""
    refuted: int
    """Candidates that the ego without the defects has too."""
    kind: str
    """Of the failure that detected it; empty without one."""
    episode: EpisodeRecord | None
    """In which that happened; its time series is in the folder."""

    def within(self, steps: int) -> Self:
        """Returns the outcome of the same run with a smaller budget; what it has spent stays."""
        times = {name: getattr(self, name) for name in ("reached", "triggered", "detected")}
        changed = {name: None if at is None or at > steps else at for name, at in times.items()}
        if changed["detected"] is None:
            changed |= {"kind": "", "episode": None}
        return self.model_copy(update=changed | {"budget_steps": steps})


@dataclass(slots=True)
class _Candidates:
    """Observer that stops a run at each candidate, and at the budget's end."""

    budget_steps: int
    judged: int
    """Episodes whose candidates an earlier call has refuted."""
    records: list[EpisodeRecord] = field(default_factory=list)
    waiting: list[tuple[EpisodeRecord, SeriesFile]] = field(default_factory=list)

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Takes an episode; those of a resumed run are repeated."""
        if record.index < len(self.records):
            return
        self.records.append(record)
        if record.index >= self.judged and series is not None and candidates(record):
            self.waiting.append((record, series))

    def should_stop(self) -> bool:
        """See `Observer.should_stop`."""
        return bool(self.waiting) or self.spent

    @property
    def spent(self) -> bool:
        """Whether the budget is spent."""
        return bool(self.records) and self.records[-1].environment_steps >= self.budget_steps


def answer_of(folder: Path, budget_steps: int) -> Detection | None:
    """Returns the outcome of a run with this budget.

    None if the run has not been called with so much.
    A run that detected early ends alike with any larger budget. It counts for that once it is called with it, as the
    runs beside it that detected nothing do; else those that detected would be the first to count.
    """
    stored = _stored(folder)
    return stored.within(budget_steps) if stored is not None and stored.budget_steps >= budget_steps else None


def first_detection(spec: RunSpec, folder: Path, budget_steps: int) -> Detection:
    """Returns how soon a run detects its ego's defects; from the folder if it says so already.

    Args:
      spec: of the run; its budget of episodes does not count.
      folder: of the run, kept up to the detection. A run that was interrupted or had a smaller budget goes on.
      budget_steps: environment steps after which it ends.
    """
    if known := answer_of(folder, budget_steps):
        return known
    before = _stored(folder)
    if before is not None and before.detected is not None:
        detection = before.model_copy(update={"budget_steps": budget_steps})
    else:
        detection = _play(spec, folder, budget_steps, before)
    replace_file(folder / ANSWER, detection.model_dump_json(indent=2).encode())
    return detection.within(budget_steps)


def _play(spec: RunSpec, folder: Path, budget_steps: int, before: Detection | None) -> Detection:
    spec = spec.model_copy(update={"budget": Budget(episodes=MOST_EPISODES, batch=spec.budget.batch)})
    seen = _Candidates(budget_steps, judged=before.episodes if before else 0)
    episode, refuted, failure = None, before.refuted if before else 0, None
    while episode is None:
        execute_run(spec, folder, seen)  # goes on where it stopped; libsumo is free in between
        if not seen.waiting:
            break
        while seen.waiting and episode is None:
            record, series = seen.waiting.pop(0)
            failure = detected(spec, record, read_series(folder / FAILURES / series.name))
            episode, refuted = (record, refuted) if failure else (None, refuted + 1)
        if seen.spent:
            break
    return Detection(
        defects=spec.ego.defects,
        family=spec.family,
        method=spec.method,
        seed=spec.seed,
        budget_steps=budget_steps,
        steps=seen.records[-1].environment_steps,
        episodes=len(seen.records),
        reached=_first(each for each in seen.records if each.defect_reached_s is not None),
        triggered=_first(each for each in seen.records if each.failed),
        detected=None if episode is None else episode.environment_steps,
        refuted=refuted,
        kind="" if failure is None else failure.kind,
        episode=episode,
    )


def _stored(folder: Path) -> Detection | None:
    answer = folder / ANSWER
    return Detection.model_validate_json(answer.read_bytes()) if answer.exists() else None


def _first(records: Iterable[EpisodeRecord]) -> int | None:
    return next((record.environment_steps for record in records), None)


logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """Methods and the defects on which they are compared."""

    methods: tuple[MethodName, ...]
    defects: tuple[str, ...]
    seeds: tuple[int, ...]
    budget_steps: int
    batch: int = 1
    """Episodes of a round; another batch needs another folder."""

    def __post_init__(self) -> None:
        """Refuses a method or defect that does not exist.

        Raises:
          ConfigError: naming it.
        """
        for method in self.methods:
            check_installed(method)
        for name in self.defects:
            pinned(ego_with(name))

    def specs(self) -> Iterator[RunSpec]:
        """Seeds outermost and methods innermost, so that early results compare methods."""
        for seed in self.seeds:
            for name in self.defects:
                for method in self.methods:
                    yield RunSpec(
                        family=DEFECTS[name].families[0],
                        method=method,
                        seed=seed,
                        budget=Budget(episodes=MOST_EPISODES, batch=self.batch),
                        ego=pinned(ego_with(name)),
                    )


def ego_with(defect: str) -> EgoConfig:
    """Returns a defect's base ego with the defect.

    A name that no defect has is refused when the ego is pinned.
    """
    base = DEFECTS[defect].base if defect in DEFECTS else "idm-aeb"
    return read_ego(f"{base}+{defect}")


def folder_of(spec: RunSpec, out: Path) -> Path:
    """Returns the folder of a run, which is another one for each version of its defects."""
    return out / "-".join((*spec.ego.defects, version_of(spec.ego), spec.id))


def ended(benchmark: Benchmark, out: Path) -> list[Detection]:
    """Returns the outcomes of the runs that have ended so far."""
    answers = (answer_of(folder_of(spec, out), benchmark.budget_steps) for spec in benchmark.specs())
    return [answer for answer in answers if answer is not None]


def play(benchmark: Benchmark, out: Path, jobs: int) -> Iterator[Detection]:
    """Plays the runs that have not ended so far, and yields their outcomes as they end.

    A run that fails is logged, and played again by the next call.

    Args:
      benchmark: what to play.
      out: folder of the runs; the same call goes on with what is in it.
      jobs: processes that work at a time.
    """
    if jobs < 1:
        raise ConfigError("jobs", f"{jobs}", "at least one process")
    runs = [(spec, folder_of(spec, out)) for spec in benchmark.specs()]
    waiting = [run for run in runs if answer_of(run[1], benchmark.budget_steps) is None]
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        try:
            pending = {pool.submit(first_detection, *run, benchmark.budget_steps): run[1] for run in waiting}
            for future in as_completed(pending):
                try:
                    yield future.result()
                except (RiskSacError, OSError) as error:
                    logger.warning("%s: %s", pending[future].name, error)
        except BaseException:  # of the rest nothing begins
            pool.shutdown(wait=False, cancel_futures=True)
            raise
