"""Stored campaigns, runs and failures, and their states. Pure.

queued ──> running ──> succeeded | failed
   │ ^        │ └────> cancelling ──> cancelled (or the end it had already reached)
   │ ├────────┤        its worker died or the server stopped: it will resume from its checkpoint
   │ └─ paused <┘      the disk refused: it goes on when there is room
   └─────────────────> cancelled | failed
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Generic, Self, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json

from risk_sac.config import IID_METHODS, CampaignSpec, RunSpec
from risk_sac.metrics import pooled_headline, pooled_published
from risk_sac.records import CampaignHead, Episode, EpisodeRecord, Repetition, Run, RunMetrics, RunResult, State
from service.errors import OutdatedError, TransitionError
from service.store.tables import Base, CampaignRow, EpisodeRow, RunRow

TRANSITIONS: dict[State, frozenset[State]] = {
    State.QUEUED: frozenset({State.RUNNING, State.PAUSED, State.CANCELLED, State.FAILED}),
    State.RUNNING: frozenset({State.QUEUED, State.PAUSED, State.CANCELLING, State.SUCCEEDED, State.FAILED}),
    State.PAUSED: frozenset({State.QUEUED, State.RUNNING, State.CANCELLING, State.CANCELLED, State.FAILED}),
    State.CANCELLING: frozenset({State.CANCELLED, State.SUCCEEDED, State.FAILED}),
    State.CANCELLED: frozenset(),
    State.SUCCEEDED: frozenset(),
    State.FAILED: frozenset(),
}
# What a run comes back as when the server that had it in hand is gone, or the disk that refused it has room again.
RESUMED = {State.RUNNING: State.QUEUED, State.PAUSED: State.QUEUED, State.CANCELLING: State.CANCELLED}


def advance(current: State, new: State) -> State:
    """`new`; TransitionError unless it may follow `current`."""
    if new not in TRANSITIONS[current]:
        allowed = ", ".join(sorted(TRANSITIONS[current])) or "nothing"
        raise TransitionError(f"state is {current}; got {new}, wanted {allowed}")
    return new


def campaign_state(current: State, runs: Collection[State]) -> State:
    """Returns the state of a campaign by those of its runs.

    A campaign ends with its last run. One failed run fails it; a cancelled campaign ends as cancelled unless every run
    had already succeeded.
    """
    if current.final:
        return current
    if all(run.final for run in runs):
        return _verdict(current, runs)
    if current is State.CANCELLING:
        return current
    if State.PAUSED in runs:
        return State.PAUSED
    started = any(run is not State.QUEUED for run in runs)
    return State.RUNNING if started else State.QUEUED


def _verdict(current: State, runs: Collection[State]) -> State:
    if all(run is State.SUCCEEDED for run in runs):
        return State.SUCCEEDED
    if current is State.CANCELLING:
        return State.CANCELLED
    return State.FAILED if State.FAILED in runs else State.CANCELLED


class StoredRun(Run, RunResult):
    """All that is stored of a run."""

    number: int
    """In the order of the queue, over all campaigns."""
    campaign_id: str
    repetitions: Mapping[int, Repetition]
    """Of its distinct failures, by index of the episode; none if not replayed."""
    headline_candidates: int = 0
    implausible: int = 0
    pace_s: float | None = None
    """Wall time of an episode of late, s, without the start of the worker and compilation; None before the second."""

    @classmethod
    def from_row(cls, row: RunRow, campaign_id: str) -> Self:
        """Makes a run; `row.campaign.id` would double the cost."""
        repetitions = _repetitions(row)
        verified = sum(repetition.verified for repetition in repetitions.values())
        read = {
            "campaign_id": campaign_id,
            "metrics": None if row.metrics is None else RunMetrics.model_validate_json(row.metrics),
            "evaluation": None if row.evaluation is None else RunMetrics.model_validate_json(row.evaluation),
            "versions": from_json(row.versions),
            "repetitions": repetitions,
            "verified": verified,
            "flaky": len(repetitions) - verified,
        }
        return cls.model_validate(_columns(row) | read)

    @property
    def iid(self) -> bool:
        """Whether it is of an i.i.d. phase, counted apart from searches."""
        return self.method in IID_METHODS


class StoredCampaign(CampaignHead):
    """A campaign with its runs in the order they are queued."""

    number: int
    project: str
    spec_json: str
    """As it was posted, with all defaults."""
    revision: str
    """Another one whenever anything of the campaign, its runs or episodes is."""
    runs: tuple[StoredRun, ...]

    @classmethod
    def from_row(cls, row: CampaignRow, revision: str, alone: RunRow | None = None) -> Self:
        """The campaign and its runs, or one of them alone."""
        runs = tuple(StoredRun.from_row(run, row.id) for run in (row.runs if alone is None else (alone,)))
        tags = tuple(filter(None, (row.tags or "").split(",")))
        read = {"spec_json": row.spec, "revision": revision, "runs": runs, "tags": tags}
        return cls.model_validate(_columns(row) | read)

    @property
    def families(self) -> list[str]:
        """Families of its runs, as they were posted."""
        return list(dict.fromkeys(run.family for run in self.runs))

    @property
    def methods(self) -> list[str]:
        """Methods of its runs, as they were posted."""
        return list(dict.fromkeys(run.method for run in self.searches))

    @property
    def searches(self) -> tuple[StoredRun, ...]:
        """Its runs without those of the i.i.d. phase."""
        return tuple(run for run in self.runs if not run.iid)

    @property
    def headline(self) -> int | None:
        """Distinct headline failures of search and evaluation, pooled over all runs."""
        return pooled_headline(self._phases())

    @property
    def headline_published(self) -> int | None:
        """Of the headline failures, those that R157, FSM or RSS prevents."""
        return pooled_published(self._phases())

    def _phases(self) -> Iterator[RunMetrics]:
        return (phase for run in self.searches for phase in (run.metrics, run.evaluation) if phase is not None)

    @property
    def ego(self) -> dict[str, Any]:
        """Its settings as they were posted, which this version need not know."""
        ego: dict[str, Any] = from_json(self.spec_json)["ego"]
        return ego

    @property
    def spec(self) -> CampaignSpec:
        """Posted spec, read on demand; OutdatedError if this version refuses it."""
        try:
            return _read_spec(self.spec_json)
        except ValidationError as error:
            first = error.errors()[0]
            field = ".".join(map(str, first["loc"]))
            raise OutdatedError(f"an earlier version took {field}, which this one refuses: {first['msg']}") from error

    def run_spec(self, run: StoredRun) -> RunSpec:
        """Returns the spec that a worker executes."""
        alone = {"families": (run.family,), "methods": (run.method,), "seeds": (run.seed,)}
        if run.iid:
            return next(spec for spec in self.spec.drawn() if spec.id == run.id)
        (spec,) = self.spec.model_copy(update=alone).searches()
        return spec

    def paused(self, reason: str) -> "StoredCampaign":
        """Returns the campaign as paused, for a reason not yet stored."""
        paused = {"state": State.PAUSED, "reason": reason}
        runs = (run.model_copy(update=paused) if run.state is State.RUNNING else run for run in self.runs)
        return self.model_copy(update=paused | {"runs": tuple(runs)})


def read_episode(row: EpisodeRow) -> Episode:
    """The episode of a row."""
    run = row.run
    added = {
        "id": f"{run.id}-{row.phase}-{row.index}",
        "run_id": run.id,
        "wall_s": row.wall_s,
        "funnel": None if row.funnel is None else from_json(row.funnel),
        "repetition": _repetitions(run).get(row.index),
    }
    return Episode.model_validate(from_json(row.record) | added)


def _repetitions(row: RunRow) -> Mapping[int, Repetition]:
    return _read_repetitions(row.repetitions) if row.repetitions else {}


_read_repetitions = lru_cache(maxsize=256)(TypeAdapter(dict[int, Repetition]).validate_json)
_read_spec = lru_cache(maxsize=64)(CampaignSpec.model_validate_json)


@dataclass(frozen=True, slots=True)
class StoredFailure:
    """Failure with the file of its full time series."""

    episode: Episode
    series: str | None  # name of the file
    series_sha256: str | None  # of the file as it was written


@dataclass(frozen=True, slots=True)
class StoredRecord:
    """Record of an episode, and its place in the database."""

    number: int  # in the order of arrival, over all campaigns
    run_number: int
    record: EpisodeRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """Usage of the service by a project."""

    queued_runs: int
    cpu_s: float  # worker time within the last 24 hours


T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredPage(Generic[T]):
    """Part of a list; continues after number `last`, None at the end."""

    items: tuple[T, ...]
    last: int | None


def _columns(row: Base) -> dict[str, Any]:
    return {name: getattr(row, name) for name in row.__mapper__.columns.keys()}  # noqa: SIM118
