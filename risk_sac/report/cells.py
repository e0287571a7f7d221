"""One cell of the comparison: a method in a family and phase, over all its seeds. Pure."""

from collections.abc import Mapping, Sequence
from typing import Any

from risk_sac.config import FamilyName, RunMethod
from risk_sac.metrics import (
    METRICS,
    RATIOS,
    Estimate,
    Metric,
    MetricName,
    estimate,
    headline_driven_by,
    pcr_by_driver,
    pooled_bins,
    pooled_counts,
    pooled_headline,
    pooled_names,
    pooled_requirements,
)
from risk_sac.records import Counts, DriverPcr, Phase, RequirementCounts
from risk_sac.report.runs import FinishedRun


def metrics_of(phase: Phase) -> tuple[Metric, ...]:
    """The metrics that a phase has."""
    return tuple(metric for metric in METRICS if phase == "search" or not metric.search_only)


class Cell(Counts):
    """Results of a method in a family and phase, over its finished runs."""

    family: FamilyName
    method: RunMethod
    phase: Phase
    seeds: tuple[int, ...]
    """Of the runs that are counted."""
    headline: int | None
    """Each kind once."""
    estimates: Mapping[MetricName, Estimate]
    """By the name of the metric."""
    steps_per_distinct_failure: float | None
    cpu_s_per_distinct_failure: float | None
    """Processor seconds of the whole runs; of the search only."""
    raw_rate: float
    """Contacts / episodes."""
    artefact_rate: float
    """Contacts that the simulator or the control made / episodes."""
    degenerate_rate: float
    """Contacts that are not valid / episodes."""
    rejected_rate: float
    """Infeasible scenes / episodes."""
    unresponsive_share: float | None
    """`unresponsive` / valid contacts."""
    pcr_by_driver: Mapping[str, DriverPcr]
    """Reference driver → its own PCR."""
    episodes_driven_by: Mapping[str, int]
    """What drove the adversaries → episodes."""
    headline_driven_by: Mapping[str, int]
    """What drove the first episode of a kind → headline failures."""
    by_severity: Mapping[str, int]
    """Severity → valid contacts."""
    by_fault: Mapping[str, int]
    """Fault → failures."""
    requirements: Mapping[str, RequirementCounts]
    """Requirement → its funnel."""
    signatures: Mapping[str, int]
    """Signature → valid violations."""
    conflicts_by_second: tuple[int, ...]
    """Valid contacts by the second in which the conflict began."""
    contacts_by_second: tuple[int, ...]
    """The same by the second of the contact."""


def cell_of(runs: Sequence[FinishedRun], phase: Phase) -> Cell:
    """Sums up the runs of one cell, at least one of them, all with episodes in the phase."""
    (family, method) = runs[0].cell
    metrics = [run.metrics[phase] for run in runs]
    counts = pooled_counts(metrics)
    ratios: dict[str, Any] = {ratio.name: ratio.formula(counts) for ratio in RATIOS}
    distinct, cpu_s = counts.distinct_failures, sum(run.cpu_s for run in runs)
    return Cell(
        family=family,
        method=method,
        phase=phase,
        seeds=tuple(run.spec.seed for run in runs),
        headline=pooled_headline(metrics),
        **dict(counts),
        **ratios,
        estimates={metric.name: estimate(metric, metrics) for metric in metrics_of(phase)},
        cpu_s_per_distinct_failure=cpu_s / distinct if distinct and phase == "search" else None,
        pcr_by_driver=pcr_by_driver(metrics),
        episodes_driven_by=pooled_names([each.episodes_driven_by for each in metrics]),
        headline_driven_by=headline_driven_by(metrics),
        by_severity=pooled_names([each.by_severity for each in metrics]),
        by_fault=pooled_names([each.by_fault for each in metrics]),
        requirements=pooled_requirements(metrics),
        signatures=pooled_names([each.signatures for each in metrics]),
        conflicts_by_second=pooled_bins([each.conflicts_by_second for each in metrics]),
        contacts_by_second=pooled_bins([each.contacts_by_second for each in metrics]),
    )
