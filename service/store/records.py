"""What the store hands out: frozen snapshots of campaigns, runs and episodes."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Generic, TypeVar

from risk_sac.config import CampaignSpec, RunSpec
from risk_sac.metrics import Funnel
from risk_sac.types import EpisodeRecord, RunMetrics
from service.store.states import State


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRun:
    """One run of a campaign. Times are seconds since the epoch."""

    number: int  # in the order of the queue, over all campaigns
    campaign_id: str
    id: str  # family-method-seed, unique within the campaign
    family: str
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

    @property
    def spec(self) -> CampaignSpec:
        """What was posted; read only when somebody asks, which a list does not."""
        return _read_spec(self.spec_json)

    def run_spec(self, run: StoredRun) -> RunSpec:
        """What a worker needs to know to execute one of the runs."""
        alone = {"families": (run.family,), "methods": (run.method,), "seeds": (run.seed,)}
        (spec,) = self.spec.model_copy(update=alone).runs()
        return spec

    def paused(self, reason: str) -> "StoredCampaign":
        """The same campaign, paused for a reason that could not be written down yet."""
        runs = tuple(_paused(run, reason) for run in self.runs)
        return replace(self, state=State.PAUSED, reason=reason, runs=runs)


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

    @property
    def id(self) -> str:
        """Unique within the campaign, and the same whenever the same campaign is run again."""
        return f"{self.run_id}-{self.record.phase}-{self.record.index}"


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredChange:
    """A campaign, or one of its runs, came into another state."""

    sequence: int  # among all events of the campaign, from 1
    run_id: str | None  # None: the campaign itself
    state: State
    reason: str | None
    at: float  # seconds since the epoch


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
