"""What a campaign found so far, summed per family and method. Pure.

Live figures of runs that go on; `service.views.reports` compares those that have finished. Mean ECR and PCR and their
intervals are those of the report.
"""

from collections.abc import Sequence

from risk_sac.metrics import pooled_bins, pooled_counts, pooled_signatures
from risk_sac.report.cells import METRICS, estimate
from risk_sac.types import RunMetrics
from service.schemas import Results, RunResult, Total
from service.store.records import StoredCampaign, StoredRun


def results(campaign: StoredCampaign) -> Results:
    """Results so far; complete once the campaign has ended."""
    return Results(
        campaign_id=campaign.id,
        state=campaign.state,
        complete=campaign.state.final,
        runs=[RunResult.model_validate(run) for run in campaign.runs],
        totals=totals(campaign.runs),
    )


_ECR, _PCR = (next(metric for metric in METRICS if metric.name == name) for name in ("ecr", "pcr"))


def totals(runs: Sequence[StoredRun]) -> list[Total]:
    """One total per family and method, of the runs that have begun, in the order of the runs."""
    groups: dict[tuple[str, str], list[RunMetrics]] = {}
    for run in runs:
        if run.metrics is not None:
            groups.setdefault((run.family, run.method), []).append(run.metrics)
    return [_total(family, method, group) for (family, method), group in groups.items()]


def _total(family: str, method: str, group: Sequence[RunMetrics]) -> Total:
    ecr, pcr = estimate(_ECR, group), estimate(_PCR, group)
    counts = pooled_counts(group)
    distinct, failures = counts["distinct_failures"], counts["failures"]
    dispersions = [metrics.dispersion for metrics in group if metrics.dispersion is not None]
    return Total.model_validate(
        counts
        | {
            "family": family,
            "method": method,
            "runs": len(group),
            "ecr": ecr.mean,
            "ecr_low": ecr.low,
            "ecr_high": ecr.high,
            "pcr": pcr.mean,
            "pcr_low": pcr.low,
            "pcr_high": pcr.high,
            "efficiency": _mean([metrics.efficiency for metrics in group]),
            "cost_rate": _mean([metrics.cost_rate for metrics in group]),
            "dispersion": _mean(dispersions) if dispersions else None,
            "steps_per_distinct_failure": counts["environment_steps"] / distinct if distinct else None,
            "unresponsive_share": counts["unresponsive"] / failures if failures else None,
            "signatures": pooled_signatures(group),
            "conflicts_by_second": pooled_bins([metrics.conflicts_by_second for metrics in group]),
            "contacts_by_second": pooled_bins([metrics.contacts_by_second for metrics in group]),
        }
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
