import math
from collections.abc import Callable

import numpy as np
import pytest
import scipy.stats
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.config import SceneOptimizerConfig
from risk_sac.run_folder import checkpoint
from risk_sac.search.scene_optimizer import (
    ArchiveOptimizer,
    BotorchOptimizer,
    IidSampler,
    SceneOptimizer,
    SobolOptimizer,
    gaussian_process,
)
from risk_sac.search.scene_optimizer.base import RunningMaximum, objective
from risk_sac.world.types import Floats

QUICK = SceneOptimizerConfig(initial_scenes=6, window=24, refit_every=5, candidates=64)
SCORING = (SobolOptimizer, BotorchOptimizer, ArchiveOptimizer)
KINDS = (*SCORING, IidSampler)
returns = st.floats(-100, 100)


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def drive(optimizer: SceneOptimizer, episodes: int, score: Callable[[int, Floats], float | None]) -> Floats:
    """Scenes asked for, `episodes x d`."""
    asked = []
    for episode in range(episodes):
        u = optimizer.ask()
        optimizer.tell(u, score(episode, u))
        asked.append(u)
    return np.array(asked)


def bowl(episode: int, u: Floats) -> float | None:
    """Deterministic in its arguments; a corner is rejected."""
    return None if u[0] > 0.8 else float(math.sin(7 * episode) * 0.05 - ((u - 0.3) ** 2).sum())


# Equation 11


@pytest.mark.parametrize(
    ("mean_return", "maximum", "expected"),
    [(0.5, 2.0, 1.5 / 2.001), (2.0, 2.0, 0.0), (3.0, 2.0, 0.0), (-3.0, -1.0, 2 / 1.001), (-0.25, 0.0, 250.0)],
)
def test_objective_literals(mean_return, maximum, expected):
    assert objective(mean_return, maximum) == pytest.approx(expected, rel=1e-12)


@settings(deadline=None)
@given(returns, returns, returns)
def test_objective_is_never_negative_and_falls_with_the_return(a, b, maximum):
    low, high = sorted((a, b))
    assert 0 <= objective(high, maximum) <= objective(low, maximum)


def test_running_maximum_literals():
    maximum = RunningMaximum(0.1)
    scores = [maximum.score(mean_return) for mean_return in (1.0, 3.0, 0.0)]
    assert (maximum.largest, maximum.smoothed) == pytest.approx((3.0, 1.38))  # after 1 and 1.2
    assert scores == pytest.approx([0.0, 0.0, 1.38 / 1.381])


# What all optimisers promise


@pytest.mark.parametrize("kind", KINDS)
def test_same_seed_asks_the_same_scenes_and_another_seed_others(kind):
    first, again, other = (drive(kind(3, QUICK, seed), 20, bowl) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("interrupted_at", [1, 21])
def test_resumed_run_equals_one_never_interrupted(kind, interrupted_at, tmp_path):
    whole = drive(kind(3, QUICK, 1), 30, bowl)
    before, after = kind(3, QUICK, 1), kind(3, QUICK, 1)
    drive(before, interrupted_at, bowl)
    checkpoint.save(tmp_path / "state", before.state(), "run")
    drive(before, 3, bowl)  # a state must not change with the optimiser it was taken from
    after.load(checkpoint.load(tmp_path / "state", "run"))
    rest = drive(after, 30 - interrupted_at, lambda episode, u: bowl(episode + interrupted_at, u))
    np.testing.assert_array_equal(rest, whole[interrupted_at:])


@pytest.mark.parametrize("kind", KINDS)
def test_global_generators_and_dtype_are_neither_moved_nor_read(kind):
    torch.manual_seed(0)
    torch_before, numpy_before = torch.get_rng_state(), np.random.get_state()[1].copy()  # noqa: NPY002
    asked = drive(kind(3, QUICK, 2), 20, bowl)
    assert torch.equal(torch.get_rng_state(), torch_before)
    np.testing.assert_array_equal(np.random.get_state()[1], numpy_before)  # noqa: NPY002
    assert torch.get_default_dtype() == torch.float32
    torch.manual_seed(1)
    np.testing.assert_array_equal(drive(kind(3, QUICK, 2), 20, bowl), asked)


def test_independent_scenes_are_uniform_have_no_score_and_do_not_depend_on_returns():
    sampler, untold = (IidSampler(3, QUICK, 2**31 + 5) for _ in range(2))
    points = drive(sampler, 2000, lambda episode, u: [None, 3.0][episode % 2])
    assert sampler.tell(points[0], 3.0) is None
    np.testing.assert_array_equal(points[:5], [untold.ask() for _ in range(5)])
    for axis in points.T:
        assert scipy.stats.kstest(axis, "uniform").pvalue > 0.001
        assert abs(np.corrcoef(axis[1:], axis[:-1])[0, 1]) < 0.08
    # A Sobol sequence would put nearly as many into each cell of a grid; chance does not.
    cells = np.histogramdd(points, bins=5)[0]
    assert 0.7 < cells.var() / cells.mean() < 1.4


# What the Bayesian optimiser adds


def test_all_scores_are_recomputed_when_the_maximum_moves():
    optimizer = BotorchOptimizer(1, SceneOptimizerConfig(running_maximum_rate=1.0), 0)
    optimizer.tell(np.array([0.1]), 1.0)
    optimizer.tell(np.array([0.2]), 0.5)
    np.testing.assert_allclose(optimizer.scores(), [0.0, 0.5 / 1.001])
    optimizer.tell(np.array([0.3]), 2.0)
    np.testing.assert_allclose(optimizer.scores(), [1 / 2.001, 1.5 / 2.001, 0.0])


def test_rejected_scene_is_stated_to_be_as_bad_as_the_worst():
    optimizer = BotorchOptimizer(1, SceneOptimizerConfig(running_maximum_rate=1.0), 0)
    optimizer.tell(np.array([0.1]), None)
    np.testing.assert_array_equal(optimizer.scores(), [1.0])
    optimizer.tell(np.array([0.2]), 2.0)
    optimizer.tell(np.array([0.3]), -1.0)
    np.testing.assert_allclose(optimizer.scores(), [3 / 2.001, 0.0, 3 / 2.001])


@pytest.mark.parametrize("score", [lambda episode, u: 0.25, lambda episode, u: None], ids=["equal", "rejected"])
def test_observations_without_information_fill_the_space(score):
    asked = drive(BotorchOptimizer(3, QUICK.model_copy(update={"exploration": 0.0}), 0), 40, score)
    np.testing.assert_array_equal(asked, drive(SobolOptimizer(3, QUICK, 0), 40, score))


def test_repeated_scene_and_extreme_returns_do_not_break_the_model():
    optimizer = BotorchOptimizer(2, QUICK.model_copy(update={"exploration": 0.0}), 0)
    for value in (1e9, -1e9, 1e-9, 0.0, 1.0, 2.0, 3.0, None):
        optimizer.tell(np.array([0.5, 0.5]), value)
        assert np.isfinite(optimizer.ask()).all()


# Its Gaussian process


def observations(count: int, dimension: int, seed: int) -> tuple[torch.Tensor, torch.Tensor]:
    """Points, some of them repeated, and noisy values."""
    random = np.random.default_rng(seed)
    points = random.random((count, dimension))
    points[: count // 5] = points[-(count // 5) :]
    values = 40 * np.sin(4 * points[:, 0]) + points[:, -1] + random.standard_normal(count) - 300
    return torch.from_numpy(points), torch.from_numpy(values)


def test_the_posterior_is_that_of_the_equations():
    """Posterior mean and variance by Rasmussen and Williams 2006, Alg. 2.1.

    m(x) = k(x)ᵀ K⁻¹ (y - c) + c,  s²(x) = 1 - k(x)ᵀ K⁻¹ k(x)
    """
    points, values = observations(40, 5, seed=0)
    model = gaussian_process.condition(points, values, gaussian_process.fit(points, values, None, seed=0))
    lengthscales, constant = model.covar_module.lengthscale.detach(), model.mean_module.constant.detach()

    def kernel(a, b):
        return (-0.5 * torch.cdist(a / lengthscales, b / lengthscales) ** 2).exp()

    x = torch.from_numpy(np.random.default_rng(1).random((20, 5)))
    weights = torch.linalg.inv(kernel(points, points) + model.likelihood.noise.detach() * torch.eye(40).double())
    cross, residuals = kernel(points, x), (values - values.mean()) / values.std() - constant
    posterior = model.posterior(x)
    torch.testing.assert_close(posterior.mean[:, 0], constant + cross.T @ weights @ residuals, rtol=1e-6, atol=1e-6)
    torch.testing.assert_close(posterior.variance[:, 0], 1 - (cross * (weights @ cross)).sum(0), rtol=1e-6, atol=1e-6)


# How well it searches


def test_finds_the_optimum_of_a_noisy_function_far_more_often_than_sobol():
    centre = np.array([0.2, 0.7, 0.6, 0.35])

    def risk(u):
        return float(np.exp(-8 * ((u[:4] - centre) ** 2).sum()))  # two of six parameters do not matter

    def hits(optimizer, seed):
        noise = np.random.default_rng(seed + 100).normal(scale=0.1, size=80)
        asked = drive(optimizer, 80, lambda episode, u: None if u[5] > 0.85 else risk(u) + noise[episode])
        return sum(risk(u) > 0.6 for u in asked)

    for seed in range(3):
        found = hits(BotorchOptimizer(6, SceneOptimizerConfig(), seed), seed)
        by_chance = hits(SobolOptimizer(6, SceneOptimizerConfig(), seed), seed)
        assert found >= 12
        assert found >= 4 * by_chance


@pytest.mark.parametrize("seed", range(3))
def test_comes_back_to_a_needle_that_a_smooth_model_does_not_see(seed):
    random = np.random.default_rng(seed)
    needle = random.uniform(0.2, 0.8, 18)

    def risk(episode, u):
        return float(random.normal(scale=0.1) + (np.abs(u - needle)[:8] < 0.12).all())

    optimizer = BotorchOptimizer(18, SceneOptimizerConfig(), seed)
    for _ in range(3):  # as failures that others have found
        optimizer.tell(needle, risk(0, needle))
    asked = drive(optimizer, 100, risk)
    assert (np.abs(asked[30:] - needle)[:, :8] < 0.12).all(axis=1).mean() > 0.3  # of anywhere: 4e-6


@settings(deadline=None)
@given(st.lists(returns, min_size=1, max_size=30), st.floats(0.01, 1))
def test_running_maximum_rises_towards_the_largest_return_and_never_past_it(values, rate):
    maximum, before = RunningMaximum(rate), -math.inf
    for count, value in enumerate(values, start=1):
        maximum.score(value)
        assert before <= maximum.smoothed <= maximum.largest == max(values[:count])
        before = maximum.smoothed
