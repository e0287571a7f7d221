"""Campaigns and their runs, and how far they are."""

from datetime import datetime

from risk_sac.config import CampaignSpec, FamilyName, RunMethod
from risk_sac.records import RunMetrics
from service.schemas.base import Body, Real, Shown
from service.store.states import State


class Metrics(RunMetrics, Shown):
    """What a run has achieved; rates come with their 95 % interval."""


class Run(Body):
    """One (family, method, seed) of a campaign, or of its i.i.d. phase, whose methods begin with `iid-`."""

    id: str
    family: FamilyName
    method: RunMethod
    seed: int
    state: State
    reason: str | None
    """Why it failed, is paused, or waits again."""
    attempts: int
    """Workers that were started for it; more than one where some were lost."""
    started_at: datetime | None
    finished_at: datetime | None
    episodes_done: int
    episodes_total: int
    failures: int
    raw_collisions: int
    rejected: int
    distinct_failures: int
    preventable: int
    distinct_preventable: int
    metrics: Metrics | None
    """Null before the first episode."""


class Progress(Body):
    """How far a campaign is, and what its searches have found."""

    episodes_done: int
    """Of the i.i.d. phase too, if there is one; what follows the totals is of the searches alone."""
    episodes_total: int
    failures: int
    """Valid collisions."""
    raw_collisions: int
    """All contacts of the ego."""
    rejected: int
    distinct_failures: int
    """Sum over the runs; what two runs found alike counts twice."""
    preventable: int
    """Valid collisions that the careful driver would have prevented, repetitions included."""
    distinct_preventable: int
    """The distinct ones among them; sum over the runs."""
    window_ecr: Real
    """ECR over each run's newest 100 episodes: mean over the runs at work, or over all once none is. Controls, which do
    not learn, are left out of it, unless the campaign has nothing else; its results have each method by itself."""
    window_pcr: Real
    """PCR, averaged the same way."""
    dual_variable: Real
    """λ, averaged the same way."""
    temperature: Real
    """α, averaged the same way."""
    eta_s: Real
    """Seconds until the campaign ends at its present pace; null before there is one, 0 at the end."""


class Driver(Body):
    """Who drives the ego. These are no enums: what an earlier version knew can still be listed."""

    profile: str
    car_following: str
    driver: str | None = None
    """Name of a registered ego; null: SUMO's models drive, as `profile` and `car_following` say."""


class CampaignSummary(Body):
    """A campaign as it appears in a list."""

    id: str
    label: str
    families: list[str]
    methods: list[str]
    ego: Driver
    """The rest of its settings is in the campaign's `spec`."""
    state: State
    reason: str | None
    """Why it failed."""
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    progress: Progress


class Campaign(CampaignSummary):
    """A campaign with its runs, in the order they are queued, and what was posted."""

    runs: list[Run]
    spec: CampaignSpec


class CampaignPage(Body):
    """Campaigns, newest first."""

    items: list[CampaignSummary]
    next: str | None
    """Pass as `cursor` to continue; null at the end."""
