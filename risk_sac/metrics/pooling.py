"""Several runs' metrics as one. Pure."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

from risk_sac.metrics.counts import pooled_counts
from risk_sac.metrics.intervals import RESAMPLING_SEED, bootstrap_interval
from risk_sac.metrics.metric import Metric
from risk_sac.records import RunMetrics


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A mean over seeds."""

    mean: float | None
    """Null where no run has a value."""
    low: float | None
    """95 % interval: bootstrap over seeds, Wilson for the rate of one run; null where it takes more runs."""
    high: float | None
    runs: int
    """Over how many the mean was taken."""

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - a body of the service shows it


def estimate(metric: Metric, metrics: Sequence[RunMetrics]) -> Estimate:
    """Mean over the runs that have a value, with its 95 % interval: bootstrap over runs, Wilson for the rate of one."""
    values = _values(metric, metrics)
    interval: tuple[float, float] | None = None
    if len(values) > 1:
        interval = bootstrap_interval(values, RESAMPLING_SEED)
    elif values:
        interval = metric.interval(values[0], pooled_counts(metrics[:1]))
    low, high = interval or (None, None)
    return Estimate(mean=mean_over_runs(metric, metrics), low=low, high=high, runs=len(values))


def mean_over_runs(metric: Metric, metrics: Sequence[RunMetrics]) -> float | None:
    """Mean over the runs that have a value; None without one."""
    values = _values(metric, metrics)
    return sum(values) / len(values) if values else None


def _values(metric: Metric, metrics: Sequence[RunMetrics]) -> list[float]:
    return [value for value in map(metric.value, metrics) if value is not None]


def pooled_signatures(metrics: Sequence[RunMetrics]) -> dict[str, int]:
    """Valid failures per signature over the runs, in the order in which the runs first met them."""
    pooled: Counter[str] = Counter()
    for each in metrics:
        pooled.update(each.signatures)
    return dict(pooled)


def pooled_bins(histograms: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """Histograms summed bin by bin; one from before there were any is empty."""
    return tuple(map(sum, zip_longest(*histograms, fillvalue=0)))
