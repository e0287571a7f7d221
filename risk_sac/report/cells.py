"""One cell of the comparison: a method in a family and phase, over all its seeds. Pure."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from risk_sac.config import FamilyName, MethodName
from risk_sac.metrics import (
    WINDOW,
    bootstrap_interval,
    pooled_bins,
    pooled_counts,
    pooled_signatures,
    wilson_interval,
)
from risk_sac.report.runs import FinishedRun
from risk_sac.types import Phase, RunMetrics

RESAMPLING_SEED = 0
PER_STEPS = 1000  # environment steps over which the rate of distinct failures is taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """One figure of a run."""

    name: str
    symbol: str
    meaning: str
    value: Callable[[RunMetrics], float | None]
    phases: tuple[Phase, ...] = ("search", "evaluation")
    tested: bool = True  # whether methods are compared by it
    trials: Callable[[RunMetrics], int] | None = None  # of a rate: a single run has a Wilson interval over them


def _all(metrics: RunMetrics) -> int:
    return metrics.episodes


def _newest(metrics: RunMetrics) -> int:
    return min(WINDOW, metrics.episodes)


def _distinct_rate(metrics: RunMetrics) -> float | None:
    return PER_STEPS * metrics.distinct_failures / metrics.environment_steps if metrics.environment_steps else None


METRICS = (
    Metric(name="ecr", symbol="ECR", meaning="valid failures / episodes", value=lambda m: m.ecr, trials=_all),
    Metric(
        name="pcr",
        symbol="PCR",
        meaning="preventable failures / episodes: valid ones that the careful driver would have prevented",
        value=lambda m: m.pcr,
        trials=_all,
    ),
    Metric(
        name="ecr_last",
        symbol=f"ECR last {WINDOW}",
        meaning=f"ECR of the last {WINDOW} search episodes, or of all where there are fewer",
        value=lambda m: m.window_ecr,
        phases=("search",),
        tested=False,
        trials=_newest,
    ),
    Metric(
        name="pcr_last",
        symbol=f"PCR last {WINDOW}",
        meaning=f"PCR of the last {WINDOW} search episodes, or of all where there are fewer",
        value=lambda m: m.window_pcr,
        phases=("search",),
        tested=False,
        trials=_newest,
    ),
    Metric(
        name="es",
        symbol="ES",
        meaning="1 − (mean steps to the valid failure) / T; an episode without one counts the horizon T",
        value=lambda m: m.efficiency,
    ),
    Metric(
        name="rho_c",
        symbol="ρ̄_c",
        meaning="mean realism cost C_soft per executed step, in [0, 1]; lower is more realistic",
        value=lambda m: m.cost_rate,
    ),
    Metric(
        name="ofd",
        symbol="OFD",
        meaning="mean distance between two valid failures of a run in outcome features, in [0, 1]",
        value=lambda m: m.dispersion,
    ),
    Metric(
        name="distinct_per_1000_steps",
        symbol=f"distinct / {PER_STEPS} steps",
        meaning=f"distinct valid failures per {PER_STEPS} environment steps",
        value=_distinct_rate,
        phases=("search",),
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A mean over seeds."""

    mean: float | None  # None where no run has a value
    low: float | None  # 95 % interval; None where it takes more runs to have one
    high: float | None
    runs: int  # over how many the mean was taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """What a method achieved in a family and phase."""

    family: FamilyName
    method: MethodName
    phase: Phase
    seeds: tuple[int, ...]  # of the runs that are counted
    # `metrics.COUNTS`, each summed over the runs; what two of them found alike counts twice.
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
    episodes, failures, raw = counts["episodes"], counts["failures"], counts["raw_collisions"]
    distinct, steps = counts["distinct_failures"], counts["environment_steps"]
    cpu_s = sum(run.cpu_s for run in runs)
    return Cell(
        family=family,
        method=method,
        phase=phase,
        seeds=tuple(run.spec.seed for run in runs),
        **counts,
        estimates={metric.name: estimate(metric, metrics) for metric in METRICS if phase in metric.phases},
        steps_per_distinct_failure=steps / distinct if distinct else None,
        cpu_s_per_distinct_failure=cpu_s / distinct if distinct and phase == "search" else None,
        raw_rate=raw / episodes,
        artefact_rate=counts["artefacts"] / episodes,
        degenerate_rate=(raw - failures) / episodes,
        rejected_rate=counts["rejected"] / episodes,
        unresponsive_share=counts["unresponsive"] / failures if failures else None,
        signatures=pooled_signatures(metrics),
        conflicts_by_second=pooled_bins([each.conflicts_by_second for each in metrics]),
        contacts_by_second=pooled_bins([each.contacts_by_second for each in metrics]),
    )


def estimate(metric: Metric, metrics: Sequence[RunMetrics]) -> Estimate:
    """Mean over the runs that have a value, with its 95 % interval: bootstrap over runs, Wilson for the rate of one."""
    values = [value for value in map(metric.value, metrics) if value is not None]
    if not values:
        return Estimate(mean=None, low=None, high=None, runs=0)
    low: float | None = None
    high: float | None = None
    if len(values) > 1:
        low, high = bootstrap_interval(values, RESAMPLING_SEED)
    elif metric.trials is not None:
        trials = metric.trials(metrics[0])
        low, high = wilson_interval(round(values[0] * trials), trials)
    return Estimate(mean=sum(values) / len(values), low=low, high=high, runs=len(values))
