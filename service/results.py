"""What a campaign found so far, summed per family and method. Pure.

Live figures of runs that go on; `service.reports` compares those that have finished. The mean ECR and its interval are
those of the report.
"""

from collections.abc import Sequence

from risk_sac.report.cells import METRICS, estimate
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


_ECR = next(metric for metric in METRICS if metric.name == "ecr")


def totals(runs: Sequence[Run]) -> list[Total]:
    """One total per family and method, of the runs that have begun, in the order of the runs."""
    groups: dict[tuple[str, str], list[RunMetrics]] = {}
    for run in runs:
        if run.metrics is not None:
            groups.setdefault((run.family, run.method), []).append(run.metrics)
    return [_total(family, method, group) for (family, method), group in groups.items()]


def _total(family: str, method: str, group: Sequence[RunMetrics]) -> Total:
    ecr = estimate(_ECR, group)
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
            "ecr": ecr.mean,
            "ecr_low": ecr.low,
            "ecr_high": ecr.high,
            "efficiency": _mean([metrics.efficiency for metrics in group]),
            "cost_rate": _mean([metrics.cost_rate for metrics in group]),
            "dispersion": _mean(dispersions) if dispersions else None,
            "distinct_failures": distinct,
            "steps_per_distinct_failure": steps / distinct if distinct else None,
        }
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
