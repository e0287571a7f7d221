"""A row of the metrics: names, formula, and pooling of runs. Pure."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from risk_sac.metrics.intervals import RESAMPLING_SEED, bootstrap_interval, wilson_interval
from risk_sac.records import Counts, DrivenBy, DriverPcr, RunMetrics


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A figure of each run; of several runs their mean, with an interval."""

    name: str  # in `table.json`, `table.csv`, the API and names of figures
    symbol: str  # in tables
    meaning: str  # the formula in words
    formula: Callable[[Any], float | None]  # of a run's `Tally`, where the figure has a field; else of its `Counts`
    field: str = ""  # of `RunMetrics`, which keeps the figure
    words: str = ""  # before the symbol, where there is room
    trials: Callable[[Counts], int] | None = None  # of a rate: one run has a Wilson interval over so many
    search_only: bool = False  # or of the evaluation as well
    tested: bool = True  # whether methods are compared by it
    tabled: bool = True  # whether the table of methods shows it

    def value(self, metrics: RunMetrics) -> float | None:
        """Its value for a run."""
        value: float | None = getattr(metrics, self.field) if self.field else self.formula(metrics)
        return value

    def interval(self, value: float, counts: Counts) -> tuple[float, float] | None:
        """Wilson's 95 % interval of one run's rate; None for what is no rate."""
        if self.trials is None:
            return None
        trials = self.trials(counts)
        return wilson_interval(round(value * trials), trials)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """A figure of counts; of several runs that of their sums, without an interval."""

    name: str
    symbol: str
    meaning: str
    formula: Callable[[Counts], float | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A mean over seeds."""

    mean: float | None
    """Null where no run has a value."""
    low: float | None
    """95 % interval: bootstrap over seeds, of a rate no narrower than Wilson over all episodes; null where unknown."""
    high: float | None
    runs: int
    """Over how many the mean was taken."""

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - a body of the service shows it


def estimate(metric: Metric, metrics: Sequence[RunMetrics]) -> Estimate:
    """Returns the mean over the runs that have a value, with its 95 % interval.

    Choice: the interval of a rate is Wilson's over the pooled trials, widened to the bootstrap interval over the runs.
    The bootstrap alone ends at the worst run: at 0 where none has failed, however short the runs were.
    """
    values = _values(metric, metrics)
    if not values:
        return Estimate(mean=None, low=None, high=None, runs=0)
    mean = sum(values) / len(values)
    intervals = [metric.interval(mean, pooled_counts(metrics))]
    if len(values) > 1:
        intervals.append(bootstrap_interval(values, RESAMPLING_SEED))
    known = [each for each in intervals if each is not None]
    low, high = (min(low for low, _ in known), max(high for _, high in known)) if known else (None, None)
    return Estimate(mean=mean, low=low, high=high, runs=len(values))


def mean_over_runs(metric: Metric, metrics: Sequence[RunMetrics]) -> float | None:
    """Mean over the runs that have a value; None without one."""
    values = _values(metric, metrics)
    return sum(values) / len(values) if values else None


def _values(metric: Metric, metrics: Sequence[RunMetrics]) -> list[float]:
    return [value for value in map(metric.value, metrics) if value is not None]


def pooled_counts(metrics: Sequence[RunMetrics]) -> Counts:
    """Each count summed over the runs; what two runs found alike counts twice."""
    return Counts(**{name: sum(getattr(each, name) for each in metrics) for name in Counts.model_fields})


def pooled_headline(metrics: Iterable[RunMetrics]) -> int | None:
    """Headline failures of several runs: what they found alike counts once; None if none was replayed."""
    replayed = [each for each in metrics if each.headline is not None]
    return len({kind for each in replayed for kind in each.headline_kinds}) if replayed else None


def headline_driven_by(metrics: Iterable[RunMetrics]) -> dict[str, int]:
    """Counts headline failures of several runs by the first one's driver.

    The first one of each kind counts; a kind without a known driver is left out.
    """
    first: dict[str, DrivenBy | None] = {}
    for each in metrics:
        for kind, driven_by in zip(each.headline_kinds, each.headline_kinds_driven_by, strict=False):
            first.setdefault(kind, driven_by)
    return dict(Counter(driven_by.value for driven_by in first.values() if driven_by is not None))


def pooled_names(counts: Sequence[Mapping[str, int]]) -> dict[str, int]:
    """Counts by name summed over the runs, in the order in which the runs first met the names."""
    pooled: Counter[str] = Counter()
    for each in counts:
        pooled.update(each)
    return dict(pooled)


def pcr_by_driver(metrics: Sequence[RunMetrics]) -> dict[str, DriverPcr]:
    """Each reference driver's own PCR, over the runs whose contacts the drivers were asked for."""
    asked = [each for each in metrics if each.prevented_by or not each.collisions]
    rated, pooled = sum(each.rated for each in asked), {}
    for name, prevented in pooled_names([each.prevented_by for each in asked]).items():
        low, high = wilson_interval(prevented, rated)
        pooled[name] = DriverPcr(prevented=prevented, pcr=prevented / rated, pcr_low=low, pcr_high=high)
    return pooled


def pooled_bins(histograms: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """Histograms summed bin by bin; one from before there were any is empty."""
    return tuple(map(sum, zip_longest(*histograms, fillvalue=0)))
