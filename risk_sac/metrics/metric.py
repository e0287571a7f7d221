"""Metrics of runs: formulas, pooling, intervals and outcome features. Pure."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np

from risk_sac.errors import NotFinite
from risk_sac.records import Collision, Counts, DrivenBy, DriverPcr, RunMetrics
from risk_sac.world.types import Floats

NORMAL_QUANTILE = 1.959963984540054  # two-sided 95 %
CONFIDENCE = 0.95  # of each bound
RESAMPLES = 10_000
RESAMPLING_SEED = 0


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a rate.

    It lies within [0, 1] and contains k/n; without trials nothing is known and it is [0, 1].

    Source: Wilson 1927, Probable inference, the law of succession, and statistical inference.
    """
    if trials == 0:
        return 0.0, 1.0
    z2 = NORMAL_QUANTILE**2
    rate = successes / trials
    centre = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    half = NORMAL_QUANTILE * math.sqrt(rate * (1 - rate) / trials + z2 / (4 * trials**2)) / (1 + z2 / trials)
    # At rates of 0 and 1 the bound equals the rate; rounding must not push it past.
    return max(0.0, min(centre - half, rate)), min(1.0, max(centre + half, rate))


def clopper_pearson(successes: int, trials: int) -> tuple[float, float]:
    """Returns exact one-sided 95 % bounds of a rate from independent trials.

    With the upper bound as the rate, no more than k successes come in 5 % of all cases; with the lower one, no fewer.
    The rate is below the one with 95 % confidence, and above the other with 95 %; between both with 90 %.

    0 of 300 gives (0, 0.00994); without trials nothing is known and the bounds are (0, 1).

    Source: Clopper & Pearson 1934, The use of confidence or fiducial limits illustrated in the case of the binomial.
    """
    from scipy.special import betaincinv  # here, because few ask for bounds, and every process of a server loads this

    low = float(betaincinv(successes, trials - successes + 1, 1 - CONFIDENCE)) if successes else 0.0
    high = float(betaincinv(successes + 1, trials - successes, CONFIDENCE)) if successes < trials else 1.0
    return low, high


def bootstrap_interval(values: Sequence[float], seed: int) -> tuple[float, float]:
    """Percentile bootstrap 95 % interval of the mean over seeds.

    With fewer than about ten seeds it is narrower than its name; one seed gives a point. It stays within the values'
    range. `seed` is that of the resampling; the same seed gives the same interval.

    Raises:
        ValueError: there are no values.
        NotFinite: a value is NaN or infinite.
    """
    if not values:
        raise ValueError("values is empty; wanted one figure per seed")
    sample = np.asarray(values, dtype=np.float64)
    if not np.isfinite(sample).all():
        raise NotFinite(f"values is {list(values)}; wanted finite figures, one per seed")
    drawn = np.random.default_rng(seed).integers(len(sample), size=(RESAMPLES, len(sample)))
    low, high = np.quantile(sample[drawn].mean(axis=1), (0.025, 0.975)).clip(sample.min(), sample.max())
    return float(low), float(high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A figure of each run; over several runs a mean with interval."""

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
        """Returns Wilson's 95 % interval of one run's rate; None for non-rates."""
        if self.trials is None:
            return None
        trials = self.trials(counts)
        return wilson_interval(round(value * trials), trials)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """A figure of counts; over several runs of their sums, without interval."""

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
    """Returns the mean over runs with a value, with 95 % interval.

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
    """Sums each count over runs; what two runs found counts twice."""
    return Counts(**{name: sum(getattr(each, name) for each in metrics) for name in Counts.model_fields})


def pooled_headline(metrics: Iterable[RunMetrics]) -> int | None:
    """Counts distinct headline failures of several runs; None if none was replayed."""
    replayed = [each for each in metrics if each.headline is not None]
    return len({kind for each in replayed for kind in each.headline_kinds}) if replayed else None


def pooled_published(metrics: Iterable[RunMetrics]) -> int | None:
    """Counts headline failures that R157, FSM or RSS prevents; see `pooled_headline`."""
    replayed = [run for run in metrics if run.headline is not None]
    return len({kind for run in replayed for kind in run.headline_kinds_published}) if replayed else None


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
    """Sums counts by name over the runs, in order of first appearance."""
    pooled: Counter[str] = Counter()
    for each in counts:
        pooled.update(each)
    return dict(pooled)


def pcr_by_driver(metrics: Sequence[RunMetrics]) -> dict[str, DriverPcr]:
    """Returns each reference driver's PCR over the runs that asked the drivers."""
    asked = [each for each in metrics if each.prevented_by or not each.collisions]
    rated, pooled = sum(each.rated for each in asked), {}
    for name, prevented in pooled_names([each.prevented_by for each in asked]).items():
        low, high = wilson_interval(prevented, rated)
        pooled[name] = DriverPcr(prevented=prevented, pcr=prevented / rated, pcr_low=low, pcr_high=high)
    return pooled


def pooled_bins(histograms: Sequence[Sequence[int]]) -> tuple[int, ...]:
    """Sums histograms bin by bin; those of older versions are empty."""
    return tuple(map(sum, zip_longest(*histograms, fillvalue=0)))


class Feature(NamedTuple):
    """An outcome feature and its range, scaled to [0, 1] with clipping."""

    name: str
    low: float
    high: float


# Choice: the paper names the features but no scale. Fixed physical ranges keep OFD comparable between runs.
FEATURES = (
    Feature("early_min_ttc_s", 0.0, 3.0),  # beyond 3 s there is no conflict
    Feature("relative_speed_mps", 0.0, 20.0),  # urban: 72 km/h
    Feature("lateral_offset_m", -3.5, 3.5),  # half a car's length plus half a car's width to either side
    Feature("early_min_robustness", -3.0, 1.0),  # in scales: the monitor clips at -3, and 1 is a clear margin
)


def outcome_features(collision: Collision) -> Floats:
    """Returns a failure's outcome features, `FEATURES`, scaled and clipped to [0, 1].

    Raises:
        NotFinite: a feature is NaN; infinite ones are clipped.
    """
    values = np.array([getattr(collision, feature.name) for feature in FEATURES], dtype=np.float64)
    if np.isnan(values).any():
        raise NotFinite(f"collision at {collision.time_s:g} s has outcome features {values.tolist()}; wanted no NaN")
    low, high = (np.array([getattr(feature, end) for feature in FEATURES]) for end in ("low", "high"))
    scaled: Floats = ((values - low) / (high - low)).clip(0.0, 1.0)
    return scaled


class Spread:
    """Σ_{i<j} ||x_i - x_j|| over failures' features; adding one costs O(failures)."""

    def __init__(self) -> None:
        self.distance = 0.0
        self._count = 0
        self._features = np.empty((64, len(FEATURES)))  # doubled when full; the first `_count` rows count

    def add(self, features: Floats) -> None:
        """Add one failure: `FEATURES`, scaled."""
        if self._count == len(self._features):
            self._features = np.concatenate((self._features, np.empty_like(self._features)))
        rows = self._features[: self._count]
        self.distance += float(np.sqrt(((rows - features) ** 2).sum(axis=1)).sum())
        self._features[self._count] = features
        self._count += 1
