"""Runs a search until it detects a planted defect or ends its budget."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from risk_sac.config import Budget, RunMethod, RunSpec
from risk_sac.failures.detected import candidates, detected
from risk_sac.loop import execute_run
from risk_sac.records import EpisodeRecord, Record, RunMetrics, SeriesFile
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import FAILURES

ANSWER = "detection.json"
MOST_EPISODES = 20_000  # scenes that are refused cost no steps


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
    """Until a failure first showed the defect, see `failures.detected`; null if none did."""
    refuted: int
    """Candidates that the ego without the defects has too."""
    signature: str
    """Of the failure that detected it; empty without one."""
    episode: EpisodeRecord | None
    """In which that happened; its time series is in the folder."""

    def within(self, steps: int) -> Self:
        """Returns the outcome of the same run with a smaller budget; what it has spent stays."""
        times = {name: getattr(self, name) for name in ("reached", "triggered", "detected")}
        changed = {name: None if at is None or at > steps else at for name, at in times.items()}
        if changed["detected"] is None:
            changed |= {"signature": "", "episode": None}
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
    spec = spec.model_copy(update={"budget": Budget(episodes=MOST_EPISODES)})
    seen = _Candidates(budget_steps, judged=before.episodes if before else 0)
    found, refuted, failure = None, before.refuted if before else 0, None
    while found is None:
        execute_run(spec, folder, seen)  # goes on where it stopped; libsumo is free in between
        if not seen.waiting:
            break
        while seen.waiting and found is None:
            record, series = seen.waiting.pop(0)
            failure = detected(spec, record, read_series(folder / FAILURES / series.name))
            found, refuted = (record, refuted) if failure else (None, refuted + 1)
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
        detected=None if found is None else found.environment_steps,
        refuted=refuted,
        signature="" if failure is None else failure.signature,
        episode=found,
    )


def _stored(folder: Path) -> Detection | None:
    answer = folder / ANSWER
    return Detection.model_validate_json(answer.read_bytes()) if answer.exists() else None


def _first(records: Iterable[EpisodeRecord]) -> int | None:
    return next((record.environment_steps for record in records), None)
