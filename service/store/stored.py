"""What the store hands out: frozen snapshots of campaigns, runs and episodes, each made of its row."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache, lru_cache
from typing import Any, Generic, Self, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import from_json

from risk_sac.config import IID_METHODS, CampaignSpec, FamilyName, RunSpec
from risk_sac.metrics import Funnel
from risk_sac.records import EpisodeRecord, RunMetrics
from risk_sac.run_folder.verified import Repetition
from service.errors import OutdatedError
from service.store.states import State, TriageState
from service.store.tables import Base, CampaignRow, ChangeRow, EpisodeRow, RunRow, TriageRow


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRun:
    """One run of a campaign. Times are seconds since the epoch."""

    number: int  # in the order of the queue, over all campaigns
    campaign_id: str
    id: str  # family-method-seed, unique within the campaign
    family: FamilyName
    method: str
    seed: int
    spec_digest: str
    state: State
    reason: str | None  # why it failed, waits again or is paused
    started_at: float | None
    finished_at: float | None
    episodes_total: int  # search and evaluation
    episodes_done: int
    rejected: int
    raw_collisions: int
    failures: int
    distinct_failures: int  # these and what follows are sums of search and evaluation, as the run counted them
    preventable: int
    distinct_preventable: int
    busy_s: float  # wall time spent so far, earlier attempts included
    attempts: int  # workers that were started for it
    metrics: RunMetrics | None
    evaluation: RunMetrics | None
    digest: str | None  # of the results; None until it succeeded
    versions: Mapping[str, str]
    repetitions: Mapping[int, Repetition]  # of its distinct failures, by index of the episode; none if not replayed

    @classmethod
    def from_row(cls, row: RunRow, campaign_id: str) -> Self:
        """The snapshot of a run; `row.campaign` is not asked for the id, since that costs as much as all else of it."""
        read = {
            "campaign_id": campaign_id,
            "state": State(row.state),
            "metrics": None if row.metrics is None else RunMetrics.model_validate_json(row.metrics),
            "evaluation": None if row.evaluation is None else RunMetrics.model_validate_json(row.evaluation),
            "versions": from_json(row.versions),
            "repetitions": _repetitions(row),
        }
        return cls(**_columns(cls, row) | read)

    @property
    def iid(self) -> bool:
        """Whether it belongs to an i.i.d. phase: what it counts is never added to what searches found."""
        return self.method in IID_METHODS

    @property
    def verified(self) -> int:
        """Distinct failures that repeat."""
        return sum(repetition.verified for repetition in self.repetitions.values())

    @property
    def flaky(self) -> int:
        """Distinct failures that do not."""
        return len(self.repetitions) - self.verified


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredCampaign:
    """A campaign with its runs in the order they are queued."""

    number: int
    id: str
    project: str
    label: str
    spec_json: str  # as it was posted, with all defaults
    state: State
    reason: str | None
    created_at: float
    started_at: float | None
    finished_at: float | None
    revision: str  # another one whenever anything of the campaign, its runs or episodes is
    runs: tuple[StoredRun, ...]

    @classmethod
    def from_row(cls, row: CampaignRow, revision: str, alone: RunRow | None = None) -> Self:
        """The snapshot of a campaign and its runs, or of one of them alone."""
        runs = tuple(StoredRun.from_row(run, row.id) for run in (row.runs if alone is None else (alone,)))
        read = {"state": State(row.state), "spec_json": row.spec, "revision": revision, "runs": runs}
        return cls(**_columns(cls, row) | read)

    @property
    def families(self) -> list[str]:
        """Of its runs, as they were posted."""
        return list(dict.fromkeys(run.family for run in self.runs))

    @property
    def methods(self) -> list[str]:
        """Of its runs, as they were posted."""
        return list(dict.fromkeys(run.method for run in self.searches))

    @property
    def searches(self) -> tuple[StoredRun, ...]:
        """Its runs without those of the i.i.d. phase."""
        return tuple(run for run in self.runs if not run.iid)

    @property
    def ego(self) -> dict[str, Any]:
        """Its settings as they were posted, which this version need not know."""
        ego: dict[str, Any] = from_json(self.spec_json)["ego"]
        return ego

    @property
    def spec(self) -> CampaignSpec:
        """What was posted; read only when somebody asks, which a list does not.

        Raises:
          OutdatedError: an earlier version took what this one refuses.
        """
        try:
            return _read_spec(self.spec_json)
        except ValidationError as error:
            first = error.errors()[0]
            field = ".".join(map(str, first["loc"]))
            raise OutdatedError(f"an earlier version took {field}, which this one refuses: {first['msg']}") from error

    def run_spec(self, run: StoredRun) -> RunSpec:
        """What a worker needs to know to execute one of the runs."""
        alone = {"families": (run.family,), "methods": (run.method,), "seeds": (run.seed,)}
        if run.iid:
            return next(spec for spec in self.spec.drawn() if spec.id == run.id)
        (spec,) = self.spec.model_copy(update=alone).searches()
        return spec

    def paused(self, reason: str) -> "StoredCampaign":
        """The same campaign, paused for a reason that could not be written down yet."""
        runs = tuple(_paused(run, reason) for run in self.runs)
        return replace(self, state=State.PAUSED, reason=reason, runs=runs)


def _repetitions(row: RunRow) -> Mapping[int, Repetition]:
    return _read_repetitions(row.repetitions) if row.repetitions else {}


_read_repetitions = lru_cache(maxsize=256)(TypeAdapter(dict[int, Repetition]).validate_json)
_read_spec = lru_cache(maxsize=64)(CampaignSpec.model_validate_json)


def _paused(run: StoredRun, reason: str) -> StoredRun:
    return replace(run, state=State.PAUSED, reason=reason) if run.state is State.RUNNING else run


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredEpisode:
    """One stored episode."""

    number: int  # in the order of arrival, over all campaigns
    run_id: str
    record: EpisodeRecord
    series: str | None  # file name of its full time series
    series_sha256: str | None  # of that file, as it was written
    wall_s: float
    funnel: Funnel | None  # of the run's phase, this episode included; None if it is older than that
    sequence: int  # among all events of the campaign, from 1
    repetition: Repetition | None  # of a distinct failure that was replayed

    @classmethod
    def from_row(cls, row: EpisodeRow) -> Self:
        """The snapshot of an episode."""
        read = {
            "run_id": row.run.id,
            "record": EpisodeRecord.model_validate_json(row.record),
            "funnel": None if row.funnel is None else Funnel.model_validate_json(row.funnel),
            "repetition": _repetitions(row.run).get(row.index),
        }
        return cls(**_columns(cls, row) | read)

    @property
    def id(self) -> str:
        """Unique within the campaign, and the same whenever the same campaign is run again."""
        return self.record.id_in(self.run_id)


@dataclass(frozen=True, slots=True)
class PlainEpisode:
    """An episode of very many, whose record is not validated: that costs most of reading it."""

    number: int  # in the order of arrival, over all campaigns
    run_number: int
    phase: str
    index: int
    outcome: str
    record: Mapping[str, Any]  # JSON; a number that is not finite is a string, see `risk_sac.records.Record`


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredTriage:
    """What people made of a contact."""

    state: TriageState
    comment: str
    changed_at: float  # seconds since the epoch

    @classmethod
    def from_row(cls, row: TriageRow) -> Self:
        """The snapshot of a triage."""
        return cls(**_columns(cls, row) | {"state": TriageState(row.state)})


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredChange:
    """A campaign, or one of its runs, came into another state."""

    sequence: int  # among all events of the campaign, from 1
    run_id: str | None  # None: the campaign itself
    state: State
    reason: str | None
    at: float  # seconds since the epoch

    @classmethod
    def from_row(cls, row: ChangeRow) -> Self:
        """The snapshot of a change."""
        return cls(**_columns(cls, row) | {"state": State(row.state)})

    @property
    def ends_campaign(self) -> bool:
        """Whether this is the end of the campaign, which nothing follows."""
        return self.run_id is None and self.state.final


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """What a project takes of the service."""

    queued_runs: int
    cpu_s: float  # worker time within the last 24 hours


T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Page(Generic[T]):
    """A part of a list; `last` is the number to continue after, None at the end."""

    items: tuple[T, ...]
    last: int | None


def _columns(record: type, row: Base) -> dict[str, Any]:
    """The columns of a row that are fields of its record, as they are."""
    return {name: getattr(row, name) for name in _shared(record, type(row))}


@cache
def _shared(record: Any, row: type[Base]) -> tuple[str, ...]:
    return tuple(field.name for field in fields(record) if field.name in row.__mapper__.columns)
