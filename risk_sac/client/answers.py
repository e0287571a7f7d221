"""What the service answers, as far as this client reads it; fields that it does not know are kept as they came."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Generic, Self, TypeVar

import httpx
from pydantic import BaseModel, ConfigDict, ValidationError

from risk_sac import series
from risk_sac.client.errors import UnexpectedAnswer
from risk_sac.config import EgoConfig
from risk_sac.failures.cases import Case

FINAL = frozenset({"succeeded", "failed", "cancelled"})  # states that nothing follows


class Record(BaseModel):
    """What all records share; `model_dump(mode="json")` gives back what the service said."""

    model_config = ConfigDict(frozen=True, extra="allow")

    @classmethod
    def of(cls, response: httpx.Response) -> Self:
        """The record in an answer.

        Raises:
          UnexpectedAnswer: there is none.
        """
        try:
            return cls.model_validate_json(response.content)
        except ValidationError as error:
            raise UnexpectedAnswer(response, f"a {cls.__name__}") from error


class Metrics(Record):
    """What a run has achieved; rates come with their 95 % interval."""

    episodes: int
    failures: int  # valid collisions
    ecr: float | None  # valid collisions / episodes
    ecr_low: float | None
    ecr_high: float | None
    distinct_failures: int
    raw_collisions: int  # all contacts of the ego
    preventable: int  # valid collisions that the careful driver would have prevented
    distinct_preventable: int
    pcr: float | None  # preventable / episodes
    pcr_low: float | None
    pcr_high: float | None
    unresponsive: int  # valid collisions in which the ego never braked for what it saw


class Run(Record):
    """One (family, method, seed) of a campaign."""

    id: str
    family: str
    method: str
    seed: int
    state: str
    reason: str | None
    episodes_done: int
    episodes_total: int
    failures: int


class Progress(Record):
    """How far a campaign is."""

    episodes_done: int
    episodes_total: int
    failures: int  # valid collisions
    raw_collisions: int  # all contacts of the ego
    distinct_failures: int
    preventable: int
    distinct_preventable: int
    window_ecr: float | None
    window_pcr: float | None
    dual_variable: float | None  # λ
    eta_s: float | None


class CampaignSummary(Record):
    """A campaign as it appears in a list."""

    id: str
    label: str
    state: str
    reason: str | None  # why it failed or waits
    created_at: datetime
    progress: Progress

    @property
    def ended(self) -> bool:
        """Whether nothing will change any more."""
        return self.state in FINAL


class Campaign(CampaignSummary):
    """A campaign with its runs, in the order they are queued, and what was posted."""

    runs: list[Run]
    spec: dict[str, Any]


class RunResult(Record):
    """What one run found."""

    id: str
    family: str
    method: str
    seed: int
    state: str
    reason: str | None
    metrics: Metrics | None  # of the search; None before the first episode
    evaluation: Metrics | None  # of the frozen policy
    spec_digest: str
    digest: str | None  # of the results; None until the run succeeded
    versions: Mapping[str, str]
    busy_s: float
    verified: int = 0  # distinct failures that were the same each time they were replayed
    flaky: int = 0


class Total(Record):
    """All runs of one family and method that have begun."""

    family: str
    method: str
    runs: int
    episodes: int
    invalid: int = 0  # episodes in which the ego failed to drive; no rate counts them
    raw_collisions: int
    failures: int
    ecr: float | None  # mean over the runs
    ecr_low: float | None  # 95 % interval
    ecr_high: float | None
    efficiency: float | None
    cost_rate: float | None
    dispersion: float | None
    distinct_failures: int
    steps_per_distinct_failure: float | None
    preventable: int
    distinct_preventable: int
    pcr: float | None  # mean over the runs
    pcr_low: float | None
    pcr_high: float | None
    unresponsive: int
    signatures: Mapping[str, int]  # signature -> valid failures
    conflicts_by_second: list[int]  # valid failures by the second after the release in which they began
    contacts_by_second: list[int]  # the same by the second of the contact


class Results(Record):
    """What a campaign found so far."""

    campaign_id: str
    state: str
    complete: bool  # whether these are the final results
    runs: list[RunResult]
    totals: list[Total]


class Judgement(Record):
    """How a contact came about, and who would have prevented it."""

    conflict_type: str  # cut_in | leader | pedestrian | crossing_vehicle
    conflict_s: float | None  # when the conflict began, since the adversaries' release
    hidden: bool  # whether the ego knew nothing of the striker then
    broke: tuple[str, ...]  # what the striker broke, such as red_light
    grade: str | None  # careful | ideal | unavoidable; None where the contact is not valid
    signature: str  # the class of failures it belongs to, in words


class Collision(Record):
    """The ego's contact with another actor."""

    time_s: float | None  # since the adversaries' release
    other_id: str
    other_kind: str  # vehicle | pedestrian
    other_role: str  # adversary | background
    ego_zone: str  # front | left | right | rear
    other_zone: str
    ego_speed_mps: float | None
    other_speed_mps: float | None
    verdicts: Mapping[str, bool]  # validity rule -> passed
    judgement: Judgement | None  # None in what is older than judgements


class Episode(Record):
    """One episode."""

    id: str
    run_id: str
    index: int  # 0-based within the run
    phase: str  # train | evaluate
    outcome: str
    reason: str
    steps: int
    collision: Collision | None
    funnel: dict[str, int] | None  # of the run's phase, this episode included
    repetition: dict[str, int] | None = None  # times and same: how often it was replayed, and came to the same


class Series(series.Series, Record):
    """Arrays over the steps of an episode; each name ends with its unit, and each field says its shape."""


class Failure(Episode):
    """A contact of the ego with its full time series."""

    series: Series | None
    series_problem: str | None  # why there is none


class Regression(Record):
    """The distinct failures of a campaign against another ego."""

    id: str
    campaign_id: str
    ego: EgoConfig
    state: str  # queued | succeeded | failed
    reason: str | None  # why it failed
    passed: bool | None  # whether all are fixed
    cases: tuple[Case, ...]


T = TypeVar("T")


class Page(Record, Generic[T]):
    """A part of a list."""

    items: list[T]
    next: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened to a campaign."""

    id: str  # opaque; the stream goes on after it
    name: str  # episode | failure (instead of it) | state
    data: dict[str, Any]

    @property
    def last(self) -> bool:
        """Whether the campaign has ended with it."""
        return self.name == "state" and self.data.get("run_id") is None and self.data.get("state") in FINAL
