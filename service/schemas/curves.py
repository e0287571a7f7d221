"""How the runs of a campaign have gone, episode by episode."""

from risk_sac.config import FamilyName, MethodName
from risk_sac.records import Real, Record, State


class RunCurves(Record):
    """The search of one run: each list has an entry per point. Failures that were refused since do not count."""

    run_id: str
    family: FamilyName
    method: MethodName
    seed: int
    state: State
    episodes: list[int]
    """How many episodes of the search there were; evenly spread, the newest included."""
    window_ecr: list[Real]
    """ECR over the newest 100 episodes by then."""
    window_pcr: list[Real]
    """PCR over the newest 100 episodes by then."""
    distinct: list[int]
    """Distinct failures so far."""
    preventable: list[int]
    """Failures so far that the careful driver would have prevented, repetitions included."""
    distinct_preventable: list[int]
    """The distinct ones among them."""
    dual_variable: list[Real]
    """λ after the last episode."""
    mean_cost: list[Real]
    """Realism cost per step of the episodes since the point before; null where none of them was simulated."""


class Curves(Record):
    """Curves of all runs of a campaign, in the order they are queued."""

    runs: list[RunCurves]
