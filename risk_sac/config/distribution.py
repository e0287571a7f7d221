"""Probability distributions of a scenario's parameters, truncated to a parameter's range.

They are those of OpenSCENARIO XML 1.3: uniform, normal, log-normal, Poisson, histogram and probability set.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from itertools import accumulate, pairwise
from statistics import NormalDist
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from risk_sac.config.base import Settings, Word
from risk_sac.errors import ConfigError
from risk_sac.world.types import Floats

LEAST_MASS = 1e-9  # of a distribution within its range, below which quantiles lose their digits; choice
LEAST_EIGENVALUE = 1e-6  # of a correlation matrix, below which one parameter follows from the others; choice
TAIL = 1e-3  # share of a distribution on either side of its usual range; choice
_STANDARD = NormalDist()

Finite = Annotated[float, Field(ge=-1e9, le=1e9)]
Share = Annotated[float, Field(ge=0, le=1)]


class _Law(Settings, ABC):
    """A distribution of a number."""

    @abstractmethod
    def cumulative(self, value: float) -> float:
        """F(x) = P(X <= value)."""

    @abstractmethod
    def inverse(self, share: float) -> float:
        """Returns the least x with F(x) >= share, share in (0, 1)."""

    def mass(self, low: float, high: float) -> float:
        """P(low <= X <= high)."""
        return self.cumulative(high) - self._below(low)

    def quantile(self, share: float, low: float, high: float) -> float:
        """Returns the quantile at `share` in [0, 1], truncated to [low, high].

        x = F⁻¹(F(low) + share · (F(high) - F(low)))

        Uniform shares give samples of the truncated distribution.
        """
        p = self._below(low) + share * self.mass(low, high)
        value = low if p <= 0.0 else high if p >= 1.0 else self.inverse(p)
        return min(max(value, low), high)

    @property
    def usual_range(self) -> tuple[float, float]:
        """Returns the range that leaves out a thousandth on either side."""
        return self.inverse(TAIL), self.inverse(1.0 - TAIL)

    def _below(self, value: float) -> float:
        return self.cumulative(value)


class UniformLaw(_Law):
    """Each value within a range alike."""

    kind: Literal["uniform"]
    low: Finite
    high: Finite

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.low >= self.high:
            raise ConfigError("low", f"{self.low:g} with high {self.high:g}", "low < high")
        return self

    def cumulative(self, value: float) -> float:
        """See `_Law.cumulative`."""
        return min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)

    def inverse(self, share: float) -> float:
        """See `_Law.inverse`."""
        return self.low + share * (self.high - self.low)

    @property
    def usual_range(self) -> tuple[float, float]:
        """All of it."""
        return self.low, self.high


class NormalLaw(_Law):
    """Gaussian distribution."""

    kind: Literal["normal"]
    mean: Finite
    deviation: Annotated[float, Field(gt=0, le=1e9)]
    """Standard deviation; OpenSCENARIO states its square."""

    def cumulative(self, value: float) -> float:
        """See `_Law.cumulative`."""
        return _STANDARD.cdf((value - self.mean) / self.deviation)

    def inverse(self, share: float) -> float:
        """See `_Law.inverse`."""
        return self.mean + self.deviation * _STANDARD.inv_cdf(share)


class LognormalLaw(_Law):
    """Distribution of a positive number whose logarithm is Gaussian."""

    kind: Literal["lognormal"]
    log_mean: Annotated[float, Field(ge=-20, le=20)]
    """Mean of the logarithm."""
    log_deviation: Annotated[float, Field(gt=0, le=20)]
    """Standard deviation of the logarithm."""

    def cumulative(self, value: float) -> float:
        """See `_Law.cumulative`."""
        return 0.0 if value <= 0.0 else _STANDARD.cdf((math.log(value) - self.log_mean) / self.log_deviation)

    def inverse(self, share: float) -> float:
        """See `_Law.inverse`."""
        return math.exp(self.log_mean + self.log_deviation * _STANDARD.inv_cdf(share))


class PoissonLaw(_Law):
    """Number of independent events, where so many are expected."""

    kind: Literal["poisson"]
    expected: Annotated[float, Field(gt=0, le=1000)]

    def cumulative(self, value: float) -> float:
        """See `_Law.cumulative`."""
        return min(math.fsum(map(self._probability, range(min(math.floor(value), self._most) + 1))), 1.0)

    def inverse(self, share: float) -> float:
        """See `_Law.inverse`."""
        sums = accumulate(map(self._probability, range(self._most + 1)))
        # 1e-12: a sum that falls short of the share by rounding alone is not below it.
        return float(next((count for count, sum_ in enumerate(sums) if sum_ >= share - 1e-12), self._most))

    def quantile(self, share: float, low: float, high: float) -> float:
        """See `_Law.quantile`; a whole number within the range."""
        return max(super().quantile(share, math.ceil(low), math.floor(high)), float(math.ceil(low)))

    def _below(self, value: float) -> float:
        return self.cumulative(math.ceil(value) - 1)

    @property
    def _most(self) -> int:
        """A count that is hardly ever exceeded."""
        return math.ceil(self.expected + 12.0 * math.sqrt(self.expected) + 20.0)

    def _probability(self, count: int) -> float:
        return math.exp(count * math.log(self.expected) - self.expected - math.lgamma(count + 1))


class HistogramBin(Settings):
    """Part of a histogram."""

    low: Finite
    high: Finite
    weight: Annotated[float, Field(ge=0, le=1e9)]
    """Its share of the histogram, in units that all its bins have."""


class HistogramLaw(_Law):
    """Probability that is constant within each bin, and 0 between bins."""

    kind: Literal["histogram"]
    bins: Annotated[tuple[HistogramBin, ...], Field(min_length=1, max_length=10_000)]
    """In ascending order."""

    @model_validator(mode="after")
    def _sums(self) -> Self:
        for i, part in enumerate(self.bins):
            if part.low >= part.high:
                raise ConfigError(f"bins[{i}]", f"{part.low:g} to {part.high:g}", "low < high")
        for i, (left, right) in enumerate(pairwise(self.bins), 1):
            if right.low < left.high:
                raise ConfigError(
                    f"bins[{i}].low", f"{right.low:g}", f"at least {left.high:g}, where the last bin ends"
                )
        if self._total <= 0.0:
            raise ConfigError("bins", f"weights that sum to {self._total:g}", "a sum above 0")
        return self

    def cumulative(self, value: float) -> float:
        """See `_Law.cumulative`."""
        shares = (min(max((value - part.low) / (part.high - part.low), 0.0), 1.0) * part.weight for part in self.bins)
        return math.fsum(shares) / self._total

    def inverse(self, share: float) -> float:
        """See `_Law.inverse`."""
        left = share * self._total
        for part in self.bins:
            if part.weight > 0.0 and left <= part.weight:
                return part.low + left / part.weight * (part.high - part.low)
            left -= part.weight
        return self.bins[-1].high

    @property
    def usual_range(self) -> tuple[float, float]:
        """All bins."""
        return self.bins[0].low, self.bins[-1].high

    @property
    def _total(self) -> float:
        return math.fsum(part.weight for part in self.bins)


class WeightsLaw(Settings):
    """A probability for each word or row of a parameter."""

    kind: Literal["weights"]
    weights: Annotated[tuple[Annotated[float, Field(ge=0, le=1e9)], ...], Field(min_length=1, max_length=10_000)]
    """In the order of the words or rows; each one's share of their sum is its probability."""

    @model_validator(mode="after")
    def _sums(self) -> Self:
        if math.fsum(self.weights) <= 0.0:
            raise ConfigError("weights", "weights that sum to 0", "a sum above 0")
        return self

    def kept(self, which: Sequence[bool]) -> "WeightsLaw":
        """Returns the weights of the words or rows that are kept."""
        return WeightsLaw(kind="weights", weights=tuple(w for w, keep in zip(self.weights, which, strict=True) if keep))

    def index(self, share: float) -> int:
        """Returns the index at a share in [0, 1] of all probability."""
        left = share * math.fsum(self.weights)
        last = max(i for i, weight in enumerate(self.weights) if weight > 0.0)
        return next((i for i, sum_ in enumerate(accumulate(self.weights)) if sum_ > left), last)


class RankCorrelation(Settings):
    """Spearman's rank correlations between parameters, which a Gaussian copula makes.

    Source: Kruskal 1958, Ordinal measures of association: r = 2 sin(π ρ / 6) of normal variables.
    """

    parameters: Annotated[tuple[Word, ...], Field(min_length=2, max_length=100)]
    """Those that depend on each other; all others are independent."""
    spearman: tuple[tuple[Annotated[float, Field(ge=-1, le=1)], ...], ...]
    """A row for each of them, in their order: a symmetric matrix with ones on its diagonal."""

    @model_validator(mode="after")
    def _is_one(self) -> Self:
        size = len(self.parameters)
        if len(set(self.parameters)) < size:
            raise ConfigError("parameters", ", ".join(self.parameters), "each parameter once")
        if len(self.spearman) != size or any(len(row) != size for row in self.spearman):
            rows = ", ".join(str(len(row)) for row in self.spearman)
            raise ConfigError("spearman", f"rows of {rows or 'no'} numbers", f"{size} rows of {size} numbers")
        matrix = np.array(self.spearman)
        if (matrix != matrix.T).any() or (matrix.diagonal() != 1.0).any():
            raise ConfigError("spearman", f"{matrix.tolist()}", "a symmetric matrix with ones on its diagonal")
        if np.linalg.eigvalsh(self.normal).min() < LEAST_EIGENVALUE:
            remedy = "weaken the correlations"
            raise ConfigError("spearman", f"{matrix.tolist()}", "correlations that are possible together", remedy)
        return self

    @property
    def normal(self) -> Floats:
        """Correlation matrix of the copula's normal variables, in the order of `parameters`."""
        matrix: Floats = 2.0 * np.sin(math.pi / 6.0 * np.array(self.spearman))
        return matrix


NumberLaw = UniformLaw | NormalLaw | LognormalLaw | PoissonLaw | HistogramLaw
Distribution = Annotated[NumberLaw | WeightsLaw, Field(discriminator="kind")]


def check_distribution(law: "NumberLaw | WeightsLaw", bounds: tuple[float, float] | None, alternatives: int) -> None:
    """Refuses a distribution that does not fit its parameter.

    Args:
      law: the distribution.
      bounds: the parameter's range; None: it has none.
      alternatives: number of its words or rows; 0: it has none.

    Raises:
      ConfigError: weights without alternatives, another number of them, or no mass within the range.
    """
    if isinstance(law, WeightsLaw):
        if not alternatives:
            raise ConfigError("distribution", "weights", "words or rows beside it")
        if len(law.weights) != alternatives:
            raise ConfigError("distribution.weights", f"{len(law.weights)} weights", f"{alternatives}, one for each")
    elif bounds is None:
        remedy = "write weights for words and rows"
        raise ConfigError("distribution", f"a {law.kind} distribution", "a range beside it", remedy)
    elif law.mass(*bounds) < LEAST_MASS and bounds[0] < bounds[1]:
        low, high = bounds
        usual = "{:g} to {:g}".format(*law.usual_range)
        raise ConfigError(
            "distribution",
            f"no mass in the range [{low:g}, {high:g}]",
            f"a range that overlaps its usual values, {usual}",
        )
