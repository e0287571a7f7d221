import math
from types import MappingProxyType

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.metrics import (
    METRICS,
    RESAMPLING_SEED,
    Estimate,
    Tally,
    bootstrap_interval,
    clopper_pearson,
    estimate,
    mean_over_runs,
    outcome_features,
    pcr_by_driver,
    results_digest,
    wilson_interval,
)
from risk_sac.metrics.rows import (
    cost_rate,
    effective_collision_rate,
    efficiency_score,
    outcome_dispersion,
    preventable_collision_rate,
    steps_per_distinct_failure,
)
from risk_sac.records import DriverPcr
from tests.unit.metrics.episodes import JUDGED, RUN, contact, episode, feed

FORMULAS = {metric.name: metric.formula for metric in METRICS}


def test_formula_literals():
    tally = Tally(
        horizon_steps=150,
        episodes=8,
        collisions=4,
        failures=4,
        preventable=2,
        preventable_collisions=2,
        avoidable=3,
        distinct_failures=3,
        environment_steps=600,
        steps_to_failure=900,
        cost=150.0,
        distance=6.0,
        newest_episodes=5,
        newest_failures=3,
        newest_preventable=1,
    )
    assert (effective_collision_rate(tally), preventable_collision_rate(tally)) == (0.5, 0.25)
    assert FORMULAS["acr"](tally) == 0.375
    assert (FORMULAS["ecr_last"](tally), FORMULAS["pcr_last"](tally)) == (0.6, 0.2)
    assert efficiency_score(tally) == 1 - 900 / (8 * 150) == 0.25
    assert cost_rate(tally) == 0.25
    assert outcome_dispersion(tally) == 0.5  # 6 over six pairs, over √4
    assert (FORMULAS["distinct_per_1000_steps"](tally), steps_per_distinct_failure(tally)) == (5, 200)


def test_outcome_features_are_scaled_and_clipped():
    np.testing.assert_allclose(outcome_features(contact(1.5, 5.0, 0.0, 0.0)), [0.5, 0.25, 0.5, 0.75])
    np.testing.assert_allclose(outcome_features(contact(math.inf, 40.0, -9.0, -math.inf)), [1, 1, 0, 0])


def test_digest_is_the_hash_of_canonical_json():
    assert results_digest([]) == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert results_digest(RUN) == results_digest(list(RUN))


def test_digest_does_not_depend_on_the_order_or_kind_of_mappings():
    scene = {"gap_m": 10.0, "speed_mps": 12.5}
    turned = MappingProxyType(dict(reversed(scene.items())))
    assert results_digest([episode(scene=scene)]) == results_digest([episode(scene=turned)])


@pytest.mark.parametrize(
    "change", [{"risk_return": math.nextafter(1.0, 2)}, {"steps": 149}, {"scene": {"gap_m": 10.0}}, {"objective": None}]
)
def test_digest_notices_the_smallest_change(change):
    assert results_digest([RUN[1].model_copy(update=change)]) != results_digest([RUN[1]])
    assert results_digest(RUN[::-1]) != results_digest(RUN)


def test_each_drivers_pcr_is_over_the_runs_that_asked_it():
    asked = feed([*JUDGED[:4], episode()])  # r157 prevents 3 of 4 contacts in 5 episodes
    clean, old = feed([episode()] * 3), feed(JUDGED).model_copy(update={"prevented_by": {}})
    pooled = pcr_by_driver([asked, clean, old])
    low, high = wilson_interval(3, 8)
    assert pooled["r157"] == DriverPcr(prevented=3, pcr=3 / 8, pcr_low=low, pcr_high=high)
    assert pcr_by_driver([old]) == pcr_by_driver([clean]) == pcr_by_driver([]) == {}


def test_metrics_are_pooled_by_their_mean_over_the_runs_that_have_a_value():
    rows = {metric.name: metric for metric in METRICS}
    one, other = feed(RUN), feed(JUDGED)
    assert estimate(rows["ecr"], [one]) == Estimate(
        mean=0.4, low=wilson_interval(2, 5)[0], high=wilson_interval(2, 5)[1], runs=1
    )
    assert estimate(rows["ecr"], [one, other]).mean == pytest.approx(0.5125)
    without = feed(RUN[:1])
    assert estimate(rows["ofd"], [one, without]) == Estimate(mean=one.dispersion, low=None, high=None, runs=1)
    assert mean_over_runs(rows["ofd"], [without]) is None
    assert estimate(rows["ofd"], [without]) == Estimate(mean=None, low=None, high=None, runs=0)


def test_the_interval_of_a_rate_is_the_wider_of_bootstrap_and_wilson():
    ecr = next(metric for metric in METRICS if metric.name == "ecr")
    clean = [feed([episode()] * 5), feed([episode()] * 5)]
    assert estimate(ecr, clean).low == 0.0
    assert estimate(ecr, clean).high == pytest.approx(0.2775, abs=1e-4)  # 1.96² / (10 + 1.96²)
    apart = [feed([episode()] * 50)] * 5 + [feed(JUDGED * 6)] * 5
    low, high = bootstrap_interval([0.0] * 5 + [0.625] * 5, RESAMPLING_SEED)
    found = estimate(ecr, apart)
    assert (found.low, found.high) == (pytest.approx(low), pytest.approx(high))


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
