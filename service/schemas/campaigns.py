"""Campaigns and their runs, and how far they are."""

from collections.abc import Mapping
from datetime import datetime

from risk_sac.config import CampaignSpec, FamilyName, MethodName
from service.schemas.base import Body, Real
from service.store.states import State


class Metrics(Body):
    """What a run has achieved; rates come with their 95 % interval."""

    episodes: int
    """Finished, rejected scenes included."""
    rejected: int
    """Scenes that were physically infeasible and not simulated."""
    raw_collisions: int
    """Episodes in which the ego touched something."""
    failures: int
    """Valid collisions."""
    environment_steps: int
    ecr: Real
    """Effective collision rate: valid collisions / episodes."""
    ecr_low: Real
    ecr_high: Real
    window_ecr: Real
    """ECR over the newest 100 episodes."""
    pcr: Real
    """Preventable collision rate: valid collisions that the careful driver would have prevented / episodes."""
    pcr_low: Real
    pcr_high: Real
    window_pcr: Real
    """PCR over the newest 100 episodes."""
    efficiency: Real
    """Exploration efficiency ES in [0, 1]; 1 means a failure at once."""
    cost_rate: Real
    """Mean realism cost per step, in [0, 1]."""
    dispersion: Real
    """Outcome feature dispersion of the failures, in [0, 1]; null with fewer than two."""
    dual_variable: Real
    """λ."""
    temperature: Real
    """α."""
    distinct_failures: int
    """Valid collisions that resemble no earlier one: another signature, or other outcome features."""
    steps_per_distinct_failure: Real
    """Environment steps per distinct failure; null without one."""
    preventable: int
    """Valid collisions that the careful driver would have prevented, repetitions included."""
    distinct_preventable: int
    """The distinct ones among them: the last step of the funnel contacts → valid → distinct → preventable."""
    artefacts: int
    """Contacts that the simulator or the control made."""
    unresponsive: int
    """Valid collisions with a visible collision course of 1.5 s or more during which the ego never braked."""
    signatures: Mapping[str, int]
    """Signature → valid collisions, in the order in which they were first met."""
    conflicts_by_second: list[int]
    """Valid collisions by the second after the adversaries' release in which the conflict began."""
    contacts_by_second: list[int]
    """The same by the second of the contact."""


class Run(Body):
    """One (family, method, seed) of a campaign."""

    id: str
    family: FamilyName
    method: MethodName
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
    """How far a campaign is."""

    episodes_done: int
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
    """ECR over each run's newest 100 episodes: mean over the runs at work, or over all once none is."""
    window_pcr: Real
    """PCR, averaged the same way."""
    dual_variable: Real
    """λ, averaged the same way."""
    temperature: Real
    """α, averaged the same way."""
    eta_s: Real
    """Seconds until the campaign ends at its present pace; null before there is one, 0 at the end."""


class CampaignSummary(Body):
    """A campaign as it appears in a list."""

    id: str
    label: str
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
