"""Results of a campaign so far, summed per family and method. Pure.

Live figures of runs that go on; `service.views.reports` compares those that have finished. Mean ECR and PCR and their
intervals are those of the report.
"""

from collections.abc import Sequence

from risk_sac.adjustments import adjustments
from risk_sac.benchmark.power import Played
from risk_sac.metrics import (
    METRICS,
    RATIOS,
    estimate,
    headline_driven_by,
    mean_over_runs,
    pcr_by_driver,
    pooled_bins,
    pooled_counts,
    pooled_headline,
    pooled_names,
    pooled_requirements,
)
from risk_sac.records import Adjustment, Counts, Results, RunMetrics, Total
from service.errors import OutdatedError
from service.store.stored import StoredCampaign, StoredRun


def results(campaign: StoredCampaign) -> Results:
    """Results so far; complete once the campaign has ended."""
    return Results(
        campaign_id=campaign.id,
        state=campaign.state,
        complete=campaign.state.final,
        headline=campaign.headline,
        adjustments=_adjustments(campaign),
        runs=campaign.runs,
        totals=totals(campaign.searches),
    )


def played(campaign: StoredCampaign) -> list[Played]:
    """Returns the counts of each search so far."""
    found = [(run, run.metrics or Counts()) for run in campaign.searches]
    return [Played(run.family, run.method, did.episodes, did.environment_steps, run.state.final) for run, did in found]


def _adjustments(campaign: StoredCampaign) -> tuple[Adjustment, ...]:
    try:
        return adjustments(campaign.spec)
    except OutdatedError:
        return ()


def totals(runs: Sequence[StoredRun]) -> list[Total]:
    """Returns one total per family and method of the runs that have begun, in run order."""
    groups: dict[tuple[str, str], list[RunMetrics]] = {}
    for run in runs:
        if run.metrics is not None:
            groups.setdefault((run.family, run.method), []).append(run.metrics)
    return [_total(family, method, group) for (family, method), group in groups.items()]


def _total(family: str, method: str, group: Sequence[RunMetrics]) -> Total:
    counts = pooled_counts(group)
    return Total.model_validate(
        dict(counts)
        | {ratio.name: ratio.formula(counts) for ratio in RATIOS}
        | _means(group)
        | {
            "family": family,
            "method": method,
            "runs": len(group),
            "headline": pooled_headline(group),
            "requirements": pooled_requirements(group),
            "pcr_by_driver": pcr_by_driver(group),
            "episodes_driven_by": pooled_names([metrics.episodes_driven_by for metrics in group]),
            "headline_driven_by": headline_driven_by(group),
            "by_severity": pooled_names([metrics.by_severity for metrics in group]),
            "by_fault": pooled_names([metrics.by_fault for metrics in group]),
            "signatures": pooled_names([metrics.signatures for metrics in group]),
            "conflicts_by_second": pooled_bins([metrics.conflicts_by_second for metrics in group]),
            "contacts_by_second": pooled_bins([metrics.contacts_by_second for metrics in group]),
        }
    )


def _means(group: Sequence[RunMetrics]) -> dict[str, float | None]:
    """Returns the mean metrics of a total, under the names of `RunMetrics`."""
    means: dict[str, float | None] = {}
    for metric in METRICS:
        if metric.field not in Total.model_fields:
            continue
        means[metric.field] = mean_over_runs(metric, group)
        if f"{metric.field}_low" in Total.model_fields:
            pooled = estimate(metric, group)
            means |= {f"{metric.field}_low": pooled.low, f"{metric.field}_high": pooled.high}
    return means
