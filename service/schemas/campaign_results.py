"""What a campaign found."""

from collections.abc import Mapping

from risk_sac.config import FamilyName, MethodName, RunMethod
from service.schemas.base import Body, Real
from service.schemas.campaigns import Metrics
from service.store.states import State


class RunResult(Body):
    """What one run found."""

    id: str
    family: FamilyName
    method: RunMethod
    seed: int
    state: State
    reason: str | None
    metrics: Metrics | None
    """Of the search, or of the i.i.d. phase that the run is; null before the first episode."""
    evaluation: Metrics | None
    """Of the frozen policy; null until, or unless, the budget has evaluation episodes."""
    spec_digest: str
    """Equal for runs that must give equal results."""
    digest: str | None
    """SHA-256 of the results; null until the run succeeded."""
    versions: Mapping[str, str]
    """Software that produced the results."""
    verified: int
    """Distinct failures that were the same each time they were replayed; none before the run has ended."""
    flaky: int
    """Those that were not."""
    busy_s: float
    """Wall time spent, interrupted attempts included."""


class Total(Body):
    """All runs of one family and method that have begun."""

    family: FamilyName
    method: MethodName
    runs: int
    episodes: int
    rejected: int
    invalid: int
    """Episodes in which the ego failed to drive; the rates leave them out."""
    raw_collisions: int
    failures: int
    environment_steps: int
    ecr: Real
    """Mean over the runs."""
    ecr_low: Real
    """95 % interval: Wilson for one run, bootstrap over the seeds for more."""
    ecr_high: Real
    pcr: Real
    """Mean over the runs."""
    pcr_low: Real
    """95 % interval, as that of the ECR."""
    pcr_high: Real
    efficiency: Real
    """Mean over the runs."""
    cost_rate: Real
    """Mean over the runs."""
    dispersion: Real
    """Mean over the runs that have one."""
    distinct_failures: int
    """Sum over the runs; what two runs found alike counts twice."""
    steps_per_distinct_failure: Real
    preventable: int
    """Sum over the runs, repetitions included."""
    distinct_preventable: int
    """Sum over the runs: the last step of the funnel contacts → valid → distinct → preventable."""
    artefacts: int
    unresponsive: int
    unresponsive_share: Real
    """Of the valid failures; null without one."""
    signatures: Mapping[str, int]
    """Signature → valid failures, summed over the runs."""
    conflicts_by_second: list[int]
    """Valid failures by the second after the adversaries' release in which the conflict began."""
    contacts_by_second: list[int]
    """The same by the second of the contact."""


class Results(Body):
    """What a campaign found so far."""

    campaign_id: str
    state: State
    complete: bool
    """Whether these are the final results."""
    runs: list[RunResult]
    totals: list[Total]
