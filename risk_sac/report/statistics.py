"""Tests and effect sizes for runs paired by seed. Pure.

Source: Arcuri & Briand 2014, A hitchhiker's guide to statistical tests for assessing randomized algorithms in
software engineering: report an effect size beside every p-value.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

DECIMALS = 12  # beyond which two differences are the same


def wilcoxon_p(differences: Sequence[float]) -> float:
    """Exact two-sided p of Wilcoxon's signed-rank test.

    Under the null hypothesis each |difference| is as likely to be positive as negative. The distribution of the rank
    sum is counted over all 2^n signs, with the mid-ranks that the differences have, so ties keep it exact.
    Choice: zero differences are left out, as Wilcoxon did; differences that only rounding tells apart are ties.

    Args:
        differences: one per pair, finite.

    Returns:
        In (0, 1]; 1 where no difference is left.

    Source: Wilcoxon 1945, Individual comparisons by ranking methods.
    """
    values = np.round(np.asarray(differences, dtype=np.float64), DECIMALS)
    values = values[values != 0.0]
    if not values.size:
        return 1.0
    doubled = _doubled_ranks(np.abs(values))
    ways = [1]  # ways[s]: in how many of the sign patterns the doubled ranks of the positives sum to s
    for rank in doubled:
        longer = ways + [0] * rank
        for total, count in enumerate(ways):
            longer[total + rank] += count
        ways = longer
    positive = sum(rank for rank, value in zip(doubled, values, strict=True) if value > 0)
    least = min(positive, sum(doubled) - positive)
    return min(1.0, 2 * sum(ways[: least + 1]) / (1 << len(values)))


def smallest_p(pairs: int) -> float:
    """The least p that `wilcoxon_p` can give for so many pairs: all differences on one side."""
    return min(1.0, 2 / (1 << pairs))


def pairs_needed(hypotheses: int, level: float) -> int:
    """The fewest pairs with which one of so many tests can pass Holm's correction at a level."""
    return 1 + math.ceil(math.log2(hypotheses / level))


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's step-down correction: adjusted p-values, in the order given.

    p̃_(i) = max_{j <= i} min(1, (m - j + 1) p_(j))  with p_(1) <= ... <= p_(m)

    Source: Holm 1979, A simple sequentially rejective multiple test procedure.
    """
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for place, index in enumerate(sorted(range(len(p_values)), key=lambda each: p_values[each])):
        largest = max(largest, min(1.0, (len(p_values) - place) * p_values[index]))
        adjusted[index] = largest
    return adjusted


def vargha_delaney(first: Sequence[float], second: Sequence[float]) -> float:
    """A12: the chance that a value of the first is larger than one of the second, ties counted half.

    Args:
        first: at least one.
        second: at least one.

    Returns:
        In [0, 1]; 0.5 means no difference.

    Source: Vargha & Delaney 2000, A critique and improvement of the CL common language effect size statistics.
    """
    larger = sum((one > other) + 0.5 * (one == other) for one in first for other in second)
    return larger / (len(first) * len(second))


def _doubled_ranks(values: NDArray[np.float64]) -> list[int]:
    """Twice the mid-rank of each value, which is whole where a mid-rank ends in one half."""
    ordered = np.sort(values)
    below = np.searchsorted(ordered, values, side="left")
    up_to = np.searchsorted(ordered, values, side="right")
    return [int(rank) for rank in below + up_to + 1]
