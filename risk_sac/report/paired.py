"""Two methods against each other, runs paired by seed. Pure.

Source: Arcuri & Briand 2014, A hitchhiker's guide to statistical tests for assessing randomized algorithms in
software engineering: report an effect size beside every p-value.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import FamilyName, MethodName
from risk_sac.metrics import RESAMPLING_SEED, MetricName, bootstrap_interval
from risk_sac.records import Phase

LEVEL = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTest:
    """The reference against another method in one metric, runs paired by seed."""

    family: FamilyName
    phase: Phase
    metric: MetricName
    """Or what a user pays for, `headline failures within 30 CPU s`."""
    reference: MethodName
    method: MethodName
    pairs: int
    """Seeds for which both have a value."""
    difference: float | None
    """Mean of reference - method; null without a pair."""
    low: float | None
    """95 % interval of the difference, bootstrapped over the pairs; null with fewer than two."""
    high: float | None
    p: float | None
    """Wilcoxon signed-rank, exact, two-sided; null with fewer than two pairs."""
    p_holm: float | None
    """Corrected over the tests of the same family and phase that were declared beforehand, or over all others."""
    a12: float | None
    """Vargha-Delaney: chance that the reference's value is the larger one."""

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - a body of the service shows it

    @property
    def significant(self) -> bool:
        """Whether the corrected p is below 5 %."""
        return self.p_holm is not None and self.p_holm < LEVEL


Values = Mapping[int, float | None]
"""Seed → the value of its run; None where it has none."""


def paired_tests(
    family: FamilyName, phase: Phase, metric: MetricName, reference: MethodName, values: Mapping[MethodName, Values]
) -> Iterator[PairedTest]:
    """Test the reference against every other method in one metric; not corrected."""
    ours = values[reference]
    for method, theirs in values.items():
        if method == reference:
            continue
        both = [(ours[seed], theirs[seed]) for seed in sorted(ours.keys() & theirs.keys())]
        pairs = [(one, other) for one, other in both if one is not None and other is not None]
        differences = [one - other for one, other in pairs]
        low, high = bootstrap_interval(differences, RESAMPLING_SEED) if len(pairs) > 1 else (None, None)
        yield PairedTest(
            family=family,
            phase=phase,
            metric=metric,
            reference=reference,
            method=method,
            pairs=len(pairs),
            difference=sum(differences) / len(pairs) if pairs else None,
            low=low,
            high=high,
            p=wilcoxon_p(differences) if len(pairs) > 1 else None,
            p_holm=None,
            a12=vargha_delaney(*zip(*pairs, strict=True)) if pairs else None,
        )


def corrected(tests: Sequence[PairedTest]) -> Iterator[PairedTest]:
    """Holm over the tests that have a p."""
    adjusted = iter(holm([test.p for test in tests if test.p is not None]))
    for test in tests:
        yield test if test.p is None else replace(test, p_holm=next(adjusted))


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


class PairPower(NamedTuple):
    """Statistical power of tests with this number of pairs."""

    hypotheses: int  # that have a p
    pairs: int
    smallest: float  # p that so many pairs can give
    corrected: float  # over all hypotheses
    needed: int | None  # pairs, where these are too few for any test to pass


def pair_power(tests: Sequence[PairedTest]) -> PairPower:
    """Computes what tests with so many pairs can show."""
    hypotheses, pairs = sum(test.p is not None for test in tests), max(test.pairs for test in tests)
    corrected = hypotheses * smallest_p(pairs)
    needed = pairs_needed(hypotheses, LEVEL) if corrected > LEVEL else None
    return PairPower(hypotheses, pairs, smallest_p(pairs), min(1.0, corrected), needed)


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
    """Computes A12: the chance that a first value exceeds a second one.

    Ties count half.

    Source: Vargha & Delaney 2000, A critique and improvement of the CL common language effect size statistics.
    """
    ordered = np.sort(np.asarray(second, np.float64))
    below, up_to = (int(np.searchsorted(ordered, first, side).sum()) for side in ("left", "right"))
    return (below + up_to) / 2 / (len(first) * len(second))


def _doubled_ranks(values: NDArray[np.float64]) -> list[int]:
    """Twice the mid-rank of each value, which is whole where a mid-rank ends in one half."""
    ordered = np.sort(values)
    below = np.searchsorted(ordered, values, side="left")
    up_to = np.searchsorted(ordered, values, side="right")
    return [int(rank) for rank in below + up_to + 1]
