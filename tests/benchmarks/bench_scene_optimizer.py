"""ask + tell against a cold refit on all data followed by qLogNEI, interleaved in one run.

Run: python -m pytest tests/benchmarks/bench_scene_optimizer.py -m bench -s
"""

import time

import numpy as np
import pytest
import torch

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scene_optimizer import BotorchOptimizer
from risk_sac.types import Floats

DIMENSION = 12
EPISODES = 300
ROUNDS = 2  # per size: one baseline proposal, then a chunk of ours
CHUNK = 60  # asks and tells: as many as lie between two fits at the larger window, so that fits are paid for


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def risk(u: Floats, random: np.random.Generator) -> float:
    return float(np.exp(-8 * ((u[:4] - 0.4) ** 2).sum()) + 0.1 * random.standard_normal())


def filled(count: int, config: SceneOptimizerConfig, random: np.random.Generator) -> BotorchOptimizer:
    optimizer = BotorchOptimizer(DIMENSION, config, 0)
    for u in random.random((count, DIMENSION)):
        optimizer.tell(u, risk(u, random))
    return optimizer


def ours(optimizer: BotorchOptimizer, random: np.random.Generator, episodes: int = CHUNK) -> list[float]:
    seconds = []
    for _ in range(episodes):
        began = time.perf_counter()
        u = optimizer.ask()
        asked = time.perf_counter() - began
        mean_return = risk(u, random)
        began = time.perf_counter()
        optimizer.tell(u, mean_return)
        seconds.append(asked + time.perf_counter() - began)
    return seconds


def baseline(count: int, random: np.random.Generator) -> float:
    from botorch.acquisition.logei import qLogNoisyExpectedImprovement
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskGP
    from botorch.optim import optimize_acqf
    from gpytorch.mlls import ExactMarginalLogLikelihood

    points = torch.from_numpy(random.random((count, DIMENSION)))
    values = torch.tensor([[risk(u, random)] for u in points.numpy()], dtype=torch.float64)
    bounds = torch.stack((torch.zeros(DIMENSION), torch.ones(DIMENSION))).double()
    began = time.perf_counter()
    model = SingleTaskGP(points, values)
    fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
    acquisition = qLogNoisyExpectedImprovement(model, points, prune_baseline=True)
    optimize_acqf(acquisition, bounds, q=1, num_restarts=4, raw_samples=256)
    return time.perf_counter() - began


@pytest.mark.bench
@pytest.mark.filterwarnings("ignore")  # the baseline is BoTorch as it comes
def test_ask_and_tell_stay_fast_and_flat():
    torch.manual_seed(0)
    random = np.random.default_rng(0)
    configs = {"default window": SceneOptimizerConfig(), "window 300": SceneOptimizerConfig(window=300)}
    means = {}
    for count in (300, 1000):
        optimizers = {name: filled(count, config, random) for name, config in configs.items()}
        measured: dict[str, list[float]] = {name: [] for name in configs}
        reference = []
        for _ in range(ROUNDS):
            reference.append(baseline(count, random))
            for name, optimizer in optimizers.items():
                measured[name] += ours(optimizer, random)
        for name, seconds in measured.items():
            means[count, name] = np.mean(seconds)
            print(
                f"\nn={count}, d={DIMENSION}, {name}: ask+tell mean {np.mean(seconds):.3f} s, worst "
                f"{np.max(seconds):.3f} s; cold refit + qLogNEI {np.mean(reference):.2f} s; "
                f"ratio {np.mean(reference) / np.mean(seconds):.0f}x"
            )
    for name in configs:
        assert means[1000, name] <= 0.6
        assert means[1000, name] <= 1.5 * means[300, name] + 0.02  # flat, up to timer noise


@pytest.mark.bench
def test_a_run_spends_little_on_its_scenes():
    seconds = ours(BotorchOptimizer(DIMENSION, SceneOptimizerConfig(), 0), np.random.default_rng(0), EPISODES)
    print(
        f"\nd={DIMENSION}: mean ask + tell over a run of {EPISODES} episodes {1e3 * np.mean(seconds):.1f} ms, "
        f"median {1e3 * np.median(seconds):.1f} ms, worst {1e3 * np.max(seconds):.0f} ms"
    )
    assert np.mean(seconds) <= 0.010
