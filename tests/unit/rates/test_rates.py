"""Importance sampling of failure rates, against problems whose rate is known."""

import math
from statistics import NormalDist

import numpy as np
import pytest

from risk_sac.lab.figures.rate_coverage import ANALYTIC, repeated
from risk_sac.rates.proposal import (
    DECLARED,
    Draws,
    Gaussians,
    Stages,
    defensive,
    draws_of,
    elite,
    fit,
    log_normal,
    stage_sizes,
)
from risk_sac.rates.record import LEAST_EFFECTIVE, estimated, with_exposure

ALL, ONES = np.ones(4000, dtype=bool), np.ones(4000)


def test_a_mixture_is_the_sum_of_its_densities():
    mixture = Gaussians(
        np.array([0.25, 0.75]), np.array([[0.0, 0.0], [1.0, 2.0]]), np.stack([np.eye(2), 2 * np.eye(2)])
    )
    point = np.array([[0.5, -1.0]])

    def density(x, mean, deviation):
        return NormalDist(mean, deviation).pdf(x)

    by_hand = 0.25 * density(0.5, 0, 1) * density(-1, 0, 1) + 0.75 * density(0.5, 1, 2) * density(-1, 2, 2)
    assert math.exp(mixture.log_density(point)[0]) == pytest.approx(by_hand)


def test_no_weight_exceeds_what_the_declared_share_allows():
    far = Gaussians(np.array([1.0]), np.full((1, 3), 5.0), 0.1 * np.eye(3)[None])
    points = np.random.default_rng(0).normal(size=(1000, 3)) * 3
    ratios = np.exp(log_normal(points) - defensive(3, far).log_density(points))
    assert ratios.max() <= 1 / DECLARED + 1e-9


def test_weights_of_mean_one_integrate_the_declared_distribution():
    stages = Stages(2, 4000, 7)
    draws = _played(stages, 4000, lambda z: 2.0 - z[0])
    weights = stages.ratios(draws) * stages.trust(4000)
    assert weights.mean() == pytest.approx(1.0, abs=0.05)
    inside = (np.abs(draws.points[:, 1]) < 1.0) * weights
    assert inside.mean() == pytest.approx(0.6827, abs=0.05)


def test_a_fit_finds_two_clusters():
    random = np.random.default_rng(0)
    points = np.concatenate([random.normal((3, 0), 0.3, (60, 2)), random.normal((-3, 1), 0.3, (60, 2))])
    fitted = fit(points, np.ones(120), np.random.default_rng(1))
    assert fitted is not None
    right = fitted.weights[fitted.means[:, 0] > 0].sum()
    assert right == pytest.approx(0.5, abs=0.05)
    assert np.abs(np.abs(fitted.means[:, 0]) - 3).max() < 0.6


def test_the_proposal_is_fitted_to_what_comes_nearest_to_each_requirement():
    margins = np.array([[0.5, 9.0], [0.1, 9.0], [0.5, 1.0], [0.5, 9.0], [0.4, 9.0], [0.5, 8.0], [0.5, 9.0], [0.5, 9.0]])
    failed = np.zeros(8, dtype=bool)
    assert np.flatnonzero(elite(margins, failed, 8)).tolist() == [1, 2]
    failed[3] = True
    assert 3 in np.flatnonzero(elite(margins, failed, 8))
    assert np.flatnonzero(elite(np.full((8, 2), 1.0), failed, 8)).tolist() == [3]  # a margin that says nothing


@pytest.mark.parametrize("draws", [1, 9, 10, 15, 2000])
def test_stages_share_all_draws_and_the_last_has_half(draws):
    sizes = stage_sizes(draws)
    assert sum(sizes) == draws
    assert sizes[-1] >= draws / 2


@pytest.mark.parametrize("name", ANALYTIC)
def test_the_interval_covers_a_known_rate_in_most_repetitions(name):
    repetitions = [repeated(ANALYTIC[name], seed) for seed in range(12)]
    estimates = [estimate for estimate in repetitions if estimate.rate is not None]
    assert len(estimates) >= 10
    covered = [estimate.low <= ANALYTIC[name].rate <= estimate.high for estimate in estimates]
    assert sum(covered) >= len(covered) - 3  # 12 of probability 0.9: more than 3 outside in 3 of 100
    rates = [estimate.rate for estimate in estimates]
    assert np.mean(rates) == pytest.approx(ANALYTIC[name].rate, rel=0.2)


def test_draws_of_the_declared_distribution_give_the_share_of_failures():
    failed = np.arange(4000) < 80
    estimate = estimated(ONES, ONES, failed, ALL)
    assert estimate.rate == pytest.approx(0.02)
    assert (estimate.low, estimate.high) == pytest.approx((0.016, 0.025), abs=1e-3)


def test_scenes_that_were_not_played_count_neither_way():
    estimate = estimated(ONES, ONES, np.arange(4000) < 80, np.arange(4000) < 2000)
    assert estimate.rate == pytest.approx(0.04)


def test_chance_in_the_weights_does_not_widen_the_interval():
    # A quarter of the draws has weight 4 by chance and not by the failures, which all have weight 1.
    random = np.random.default_rng(0)
    passed = np.where(random.random(4000) < 0.25, 4.0, 0.0)
    ratios = np.where(np.arange(4000) < 400, 1.0, passed)
    estimate = estimated(ratios, ONES, np.arange(4000) < 400, ALL)
    assert estimate.rate == pytest.approx(0.1, rel=0.02)
    low, high = (
        estimated(ONES, ONES, np.arange(4000) < 400, ALL).low,
        estimated(ONES, ONES, np.arange(4000) < 400, ALL).high,
    )
    assert estimate.high - estimate.low == pytest.approx(high - low, rel=0.05)


@pytest.mark.parametrize(
    ("ratios", "failures"),
    [
        (ONES, 0),
        (ONES, int(LEAST_EFFECTIVE) - 1),
        (np.where(np.arange(4000) == 0, 50.0, 3950 / 3999), 100),
        (np.where(np.arange(4000) < 100, 1 / DECLARED, (4000 - 100 / DECLARED) / 3900), 100),
        (np.full(4000, 2.0), 100),
    ],
    ids=["none", "few", "one draw", "declared", "mean"],
)
def test_an_estimate_that_fails_a_check_is_none_and_says_why(ratios, failures):
    estimate = estimated(ratios, ONES, np.arange(4000) < failures, ALL)
    assert (estimate.rate, estimate.low, estimate.high) == (None, None, None)
    assert estimate.why
    assert estimate.at_most > failures / 4000


def test_exposure_makes_a_rate_per_hour():
    failed = np.arange(4000) < 80
    told = {"failure": estimated(ONES, ONES, failed, ALL)}
    hourly = with_exposure(told, 12.0)["failure"].per_hour
    assert hourly is not None
    assert hourly.rate == pytest.approx(0.24)
    assert with_exposure(told, None)["failure"].per_hour is None


def _played(stages: Stages, count: int, margin) -> Draws:
    points, margins = [], []
    for number in range(count):
        points.append(stages.draw(number, lambda: _draws(points, margins)))
        margins.append(margin(points[-1]))
    return _draws(points, margins)


def _draws(points, margins) -> Draws:
    return draws_of(points, [{"margin": margin} for margin in margins], [margin <= 0 for margin in margins])
