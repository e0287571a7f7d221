"""One cell of the comparison: a method in a family and phase, over all its seeds. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from risk_sac.config import FamilyName, MethodName
from risk_sac.metrics import (
    METRICS,
    RATIOS,
    Estimate,
    Metric,
    estimate,
    pooled_bins,
    pooled_counts,
    pooled_signatures,
)
from risk_sac.records import Phase
from risk_sac.report.runs import FinishedRun


def metrics_of(phase: Phase) -> tuple[Metric, ...]:
    """The metrics that a phase has."""
    return tuple(metric for metric in METRICS if phase == "search" or not metric.search_only)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """What a method achieved in a family and phase."""

    family: FamilyName
    method: MethodName
    phase: Phase
    seeds: tuple[int, ...]  # of the runs that are counted
    # `metrics.Counts`, each summed over the runs; what two of them found alike counts twice.
    episodes: int
    rejected: int
    raw_collisions: int
    failures: int
    distinct_failures: int
    preventable: int
    distinct_preventable: int
    artefacts: int
    unresponsive: int
    environment_steps: int
    estimates: Mapping[str, Estimate]  # by `Metric.name`
    # `metrics.RATIOS` of the summed counts, and what a distinct failure costs in processor time.
    steps_per_distinct_failure: float | None
    cpu_s_per_distinct_failure: float | None  # of the search only; the whole run's processor time
    raw_rate: float  # contacts / episodes
    artefact_rate: float
    degenerate_rate: float
    rejected_rate: float
    unresponsive_share: float | None  # of the valid failures; None without one
    signatures: Mapping[str, int]  # signature -> valid failures
    conflicts_by_second: tuple[int, ...]  # valid failures by the second after the release in which they began
    contacts_by_second: tuple[int, ...]  # the same by the second of the contact


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
        **asdict(counts),
        **ratios,
        estimates={metric.name: estimate(metric, metrics) for metric in metrics_of(phase)},
        cpu_s_per_distinct_failure=cpu_s / distinct if distinct and phase == "search" else None,
        signatures=pooled_signatures(metrics),
        conflicts_by_second=pooled_bins([each.conflicts_by_second for each in metrics]),
        contacts_by_second=pooled_bins([each.contacts_by_second for each in metrics]),
    )
