"""Bodies of the responses. Numbers that are not finite are null: JSON has no other word for them."""

import math
from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict

from risk_sac.config import CampaignSpec, FamilyName, Method, MethodName, Odd
from risk_sac.types import Outcome
from service.campaigns import State


def _null_unless_finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


Real = Annotated[float | None, BeforeValidator(_null_unless_finite)]


class Body(BaseModel):
    """What all responses share."""

    model_config = ConfigDict(frozen=True, from_attributes=True, use_attribute_docstrings=True)


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
    """Valid collisions that resemble no earlier one: another actor, other zones of contact or outcome features."""
    steps_per_distinct_failure: Real
    """Environment steps per distinct failure; null without one."""


class Run(Body):
    """One (family, method, seed) of a campaign."""

    id: str
    family: FamilyName
    method: MethodName
    seed: int
    state: State
    reason: str | None
    """Why it failed."""
    started_at: datetime | None
    finished_at: datetime | None
    episodes_done: int
    episodes_total: int
    failures: int
    raw_collisions: int
    rejected: int
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
    window_ecr: Real
    """ECR over each run's newest 100 episodes: mean over the runs at work, or over all once none is."""
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


class Collision(Body):
    """The ego's first contact, with what is needed to judge it."""

    time_s: Real
    other_id: str
    other_kind: str
    other_role: str
    contact_x_m: Real
    """Contact point ahead of the ego's centre."""
    contact_y_m: Real
    """Contact point to the ego's left."""
    ego_zone: str
    other_zone: str
    ego_speed_mps: Real
    other_speed_mps: Real
    relative_speed_mps: Real
    lateral_offset_m: Real
    min_ttc_s: Real
    min_rss_margin_m: Real
    visible_for_s: Real
    """How long the ego had seen the other before contact."""
    ego_peak_braking_mps2: Real
    min_robustness: Real
    simulator_agrees: bool
    verdicts: Mapping[str, bool]
    """Validity rule → passed."""


class Episode(Body):
    """One episode."""

    id: str
    run_id: str
    index: int
    """0-based within the run, rejected scenes included."""
    phase: str
    """train | evaluate"""
    seed: int
    scene: Mapping[str, Real]
    outcome: Outcome
    reason: str
    """Rule that rejected the scene, or validity rules that the contact failed."""
    steps: int
    risk_return: Real
    shaped_return: Real
    mean_cost: Real
    min_ttc_s: Real
    """Null when nothing was ever on a collision course."""
    min_robustness: Real
    objective: Real
    dual_variable: Real
    temperature: Real
    environment_steps: int
    collision: Collision | None
    wall_s: float


class EpisodePage(Body):
    """Episodes in the order of their arrival."""

    items: list[Episode]
    next: str | None
    """Pass as `cursor` to continue; null at the end."""


Reals = list[Real]
RealRows = list[list[Real]]


class Series(Body):
    """Time series of an episode: `T` steps, `n` actors (the ego first), `M` requirements, `a` actions.

    Entries of an actor that is absent are null.
    """

    time_s: Reals
    """T."""
    ids: list[str]
    """n."""
    kind: list[str]
    """n; vehicle | pedestrian."""
    role: list[str]
    """n; ego | adversary | background."""
    length_m: Reals
    """n."""
    width_m: Reals
    """n."""
    x_m: RealRows
    """T x n, centre of the body."""
    y_m: RealRows
    """T x n."""
    heading_rad: RealRows
    """T x n; 0 = east, counter-clockwise."""
    speed_mps: RealRows
    """T x n."""
    lateral_mps: RealRows
    """T x n; positive to the left."""
    accel_mps2: RealRows
    """T x n."""
    visible: list[list[bool | None]]
    """T x n; to the ego's sensor. Null for the ego itself, here and in what follows."""
    distance_m: RealRows
    """T x n, to the ego."""
    ttc_s: RealRows
    """T x n; null where not on a collision course."""
    rss_longitudinal_m: RealRows
    """T x n, margin; negative where violated."""
    rss_lateral_m: RealRows
    """T x n, margin; negative where violated."""
    requirements: list[str]
    """M."""
    robustness: RealRows
    """T x M, scaled; negative where violated."""
    soft_min: Reals
    """T."""
    actions: RealRows
    """T x a, of the adversaries, normalised: what led to the step."""
    signal: list[str]
    """T; colour ahead of the ego: none | green | yellow | red."""


class Failure(Episode):
    """A contact of the ego with its full time series."""

    series: Series | None
    """Null when the record is lost; `series_problem` says why."""
    series_problem: str | None


class RunResult(Body):
    """What one run found."""

    id: str
    family: FamilyName
    method: MethodName
    seed: int
    state: State
    reason: str | None
    metrics: Metrics | None
    """Of the search; null before the first episode."""
    evaluation: Metrics | None
    """Of the frozen policy; null until, or unless, the budget has evaluation episodes."""
    spec_digest: str
    """Equal for runs that must give equal results."""
    digest: str | None
    """SHA-256 of the results; null until the run succeeded."""
    versions: Mapping[str, str]
    """Software that produced the results."""
    busy_s: float
    """Wall time spent, interrupted attempts included."""


class Total(Body):
    """All runs of one family and method that have begun."""

    family: FamilyName
    method: MethodName
    runs: int
    episodes: int
    rejected: int
    raw_collisions: int
    failures: int
    environment_steps: int
    ecr: Real
    """Mean over the runs."""
    ecr_low: Real
    """95 % interval: Wilson for one run, bootstrap over the seeds for more."""
    ecr_high: Real
    efficiency: Real
    """Mean over the runs."""
    cost_rate: Real
    """Mean over the runs."""
    dispersion: Real
    """Mean over the runs that have one."""
    distinct_failures: int
    """Sum over the runs; what two runs found alike counts twice."""
    steps_per_distinct_failure: Real


class Results(Body):
    """What a campaign found so far."""

    campaign_id: str
    state: State
    complete: bool
    """Whether these are the final results."""
    runs: list[RunResult]
    totals: list[Total]


class SceneParameter(Body):
    """One dimension of a family's scene space."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str


class Family(Body):
    """A scenario family: what is searched, and where."""

    name: FamilyName
    summary: str
    horizon_steps: int
    """Length of an episode in control steps of 0.1 s."""
    parameters: list[SceneParameter]
    adversaries: list[str]
    odd: Odd
    """Default operational design domain; a campaign's own narrows it."""


class Families(Body):
    """All scenario families."""

    items: list[Family]


class NamedMethod(Method):
    """A search method."""

    name: MethodName


class Methods(Body):
    """All search methods."""

    items: list[NamedMethod]


class Health(Body):
    """The server is up and campaigns make progress."""

    status: Literal["ok"] = "ok"


class FieldProblem(Body):
    """What is wrong with one field."""

    field: str
    """Dotted path as it was written, such as `budget.episodes`."""
    message: str
    got: str
    """The offending value as JSON, shortened."""
    wanted: str


class Problem(Body):
    """Problem details (RFC 9457)."""

    type: str
    title: str
    status: int
    detail: str
    instance: str
    errors: list[FieldProblem]
    """Empty when no field is to blame."""
