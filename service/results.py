"""What a campaign found, summed per family and method. Pure."""

from collections.abc import Sequence

from risk_sac.metrics import bootstrap_interval
from risk_sac.types import RunMetrics
from service.records import Campaign, Run
from service.schemas import Results, RunResult, Total


def results(campaign: Campaign) -> Results:
    """Results so far; complete once the campaign has ended."""
    return Results(
        campaign_id=campaign.id,
        state=campaign.state,
        complete=campaign.state.final,
        runs=[RunResult.model_validate(run) for run in campaign.runs],
        totals=totals(campaign.runs),
    )


def totals(runs: Sequence[Run]) -> list[Total]:
    """One total per family and method, of the runs that have begun, in the order of the runs."""
    groups: dict[tuple[str, str], list[RunMetrics]] = {}
    for run in runs:
        if run.metrics is not None:
            groups.setdefault((run.family, run.method), []).append(run.metrics)
    return [_total(family, method, group) for (family, method), group in groups.items()]


def interval(group: Sequence[RunMetrics]) -> tuple[float, float]:
    """95 % interval of the mean ECR: Wilson for one run, percentile bootstrap over the seeds for more."""
    if len(group) == 1:
        return group[0].ecr_low, group[0].ecr_high
    return bootstrap_interval([metrics.ecr for metrics in group], seed=0)


def _total(family: str, method: str, group: Sequence[RunMetrics]) -> Total:
    low, high = interval(group)
    steps = sum(metrics.environment_steps for metrics in group)
    distinct = sum(metrics.distinct_failures for metrics in group)
    dispersions = [metrics.dispersion for metrics in group if metrics.dispersion is not None]
    return Total.model_validate(
        {
            "family": family,
            "method": method,
            "runs": len(group),
            "episodes": sum(metrics.episodes for metrics in group),
            "rejected": sum(metrics.rejected for metrics in group),
            "raw_collisions": sum(metrics.raw_collisions for metrics in group),
            "failures": sum(metrics.failures for metrics in group),
            "environment_steps": steps,
            "ecr": _mean([metrics.ecr for metrics in group]),
            "ecr_low": low,
            "ecr_high": high,
            "efficiency": _mean([metrics.efficiency for metrics in group]),
            "cost_rate": _mean([metrics.cost_rate for metrics in group]),
            "dispersion": _mean(dispersions) if dispersions else None,
            "distinct_failures": distinct,
            "steps_per_distinct_failure": steps / distinct if distinct else None,
        }
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
