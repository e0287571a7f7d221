import math

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.metrics import bootstrap_interval, clopper_pearson, wilson_interval


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # Newcombe 1998, Table I, method 3 for the first two; closed forms 0 and z²/(n+z²) for the third.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (0, 0, 0.0, 1.0)],
)
def test_wilson_literals(successes, trials, low, high):
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5e-5)


@settings(deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 10**6))
def test_wilson_contains_the_rate_and_mirrors(successes, trials):
    successes = min(successes, trials)
    low, high = wilson_interval(successes, trials)
    assert 0 <= low <= successes / trials <= high <= 1
    assert wilson_interval(trials - successes, trials) == pytest.approx((1 - high, 1 - low), abs=1e-9)


def test_bootstrap_literals():
    assert bootstrap_interval([0.4], 0) == (0.4, 0.4)
    assert bootstrap_interval([0.2, 0.2, 0.2], 0) == (0.2, 0.2)
    low, high = bootstrap_interval(list(np.linspace(0, 1, 101)), 0)
    half = 1.96 * np.linspace(0, 1, 101).std() / math.sqrt(101)
    assert (low, high) == pytest.approx((0.5 - half, 0.5 + half), abs=0.005)


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), min_size=1, max_size=10), st.integers(0, 100))
def test_bootstrap_is_ordered_repeatable_and_within_the_values(values, seed):
    low, high = bootstrap_interval(values, seed)
    assert min(values) <= low <= high <= max(values)
    assert bootstrap_interval(values, seed) == (low, high)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # 1 - 0.05^(1/300) and its mirror; Clopper and Pearson's own bounds for 3 of 20; no trial tells nothing.
    [(0, 300, 0.0, 0.00993608), (300, 300, 0.99006392, 1.0), (3, 20, 0.04217, 0.34366), (0, 0, 0.0, 1.0)],
)
def test_clopper_pearson_literals(successes, trials, low, high):
    assert clopper_pearson(successes, trials) == pytest.approx((low, high), abs=5e-6)


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 10**4), st.integers(1, 10**4))
def test_at_its_bounds_a_rate_gives_what_was_seen_in_one_case_of_twenty(successes, trials):
    successes = min(successes, trials)
    low, high = clopper_pearson(successes, trials)
    assert 0 <= low <= successes / trials <= high <= 1
    if successes < trials:
        assert scipy.stats.binom.cdf(successes, trials, high) == pytest.approx(0.05, abs=1e-6)
    if successes:
        assert scipy.stats.binom.sf(successes - 1, trials, low) == pytest.approx(0.05, abs=1e-6)
