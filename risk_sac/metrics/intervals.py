"""95 % intervals of a rate and of a mean, and exact bounds of a rate. Pure."""

import math
from collections.abc import Sequence

import numpy as np

from risk_sac.errors import NotFinite

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
    """Exact one-sided 95 % bounds of a rate, from trials that are independent and alike.

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
