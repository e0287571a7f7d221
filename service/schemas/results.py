"""What a campaign found."""

from collections.abc import Mapping

from risk_sac.config import FamilyName, MethodName
from service.campaigns import State
from service.schemas.base import Body, Real
from service.schemas.campaigns import Metrics


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
