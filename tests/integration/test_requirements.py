"""What the requirements and C_soft say of traffic, measured with the real simulator.

A few episodes a family on fixed seeds; `Statistics` is what a report on more of them would compute as well.
"""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import pytest

from risk_sac.config import FamilyName, RunSpec
from risk_sac.env import Observation, RiskSacEnv
from risk_sac.problem import Problem
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.run_folder.series import Trace
from risk_sac.types import STEP_S, Collision

each_family = pytest.mark.parametrize("family", ["low", "mixed", "dense"])
UNDISTURBED_SEEDS = range(1000, 1020)
RANDOM_SEEDS = range(1000, 1006)
CONTACT_STEPS = round(3.0 / STEP_S)

Policy = Callable[[Observation], Observation]


@dataclass(frozen=True)
class Statistics:
    """The issue's figures over the steps of several episodes."""

    positive: float  # share of steps whose soft minimum is above 0
    minimum: dict[str, float]  # share of steps in which a requirement of φ is the smallest
    clipped: float  # share of steps in which any of them sits at its clip
    median: dict[str, float]  # robustness
    cost: float  # mean C_soft

    @classmethod
    def of(cls, env: RiskSacEnv, traces: list[Trace], costs: list[float]) -> "Statistics":
        shapes = np.array([requirement.shapes for requirement in env.problem.requirements])
        names = [requirement.name for requirement in env.problem.requirements if requirement.shapes]
        measures = [measure for trace in traces for measure in trace.measures[-env.problem.family.horizon_steps :]]
        soft = np.array([measure.soft_min for measure in measures])
        robustness = np.array([measure.robustness for measure in measures])[:, shapes]
        least = np.bincount(robustness.argmin(axis=1), minlength=len(names)) / len(robustness)
        return cls(
            positive=float((soft > 0).mean()),
            minimum=dict(zip(names, least.tolist(), strict=True)),
            clipped=float((np.abs(robustness) >= ROBUSTNESS_CLIP).any(axis=1).mean()),
            median=dict(zip(names, np.median(robustness, axis=0).tolist(), strict=True)),
            cost=float(np.mean(costs)),
        )


def environment(family: FamilyName, *, controlled: bool) -> RiskSacEnv:
    spec = RunSpec(family=family, method="risk-sac" if controlled else "no-adversary", seed=0)
    return RiskSacEnv(Problem.from_spec(spec), spec.learner.reward, controlled=controlled)


def episode(env: RiskSacEnv, seed: int, act: Policy) -> tuple[Trace, list[float], Collision | None]:
    observation, _ = env.reset(seed=seed)
    costs = []
    while True:
        observation, _, terminated, truncated, info = env.step(act(observation))
        costs.append(info["cost"])
        if terminated or truncated:
            return env.trace, costs, info.get("collision")


def idle(env: RiskSacEnv) -> Policy:
    return lambda _: np.zeros(env.action_size, dtype=np.float32)


def uniform(env: RiskSacEnv, seed: int) -> Policy:
    """Drawn anew in every step."""
    generator = np.random.default_rng(seed)
    return lambda _: generator.uniform(-1, 1, env.action_size).astype(np.float32)


def statistics(env: RiskSacEnv, seeds: range, policy: Callable[[int], Policy]) -> Statistics:
    traces, costs = [], []
    for seed in seeds:
        trace, paid, _ = episode(env, seed, policy(seed))
        traces.append(trace)
        costs += paid
    return Statistics.of(env, traces, costs)


@each_family
def test_undisturbed_traffic_meets_the_requirements_and_costs_nothing(family: FamilyName) -> None:
    with closing(environment(family, controlled=False)) as env:
        found = statistics(env, UNDISTURBED_SEEDS, lambda _: idle(env))
    assert found.positive >= 0.99, found
    assert max(found.minimum.values()) <= 0.6, found
    assert found.clipped < 0.01, found
    assert found.cost <= 0.05, found
    assert all(0.5 <= median <= 3.0 for median in found.median.values()), found


@each_family
def test_uniformly_random_actions_cost_much(family: FamilyName) -> None:
    with closing(environment(family, controlled=True)) as env:
        found = statistics(env, RANDOM_SEEDS, lambda seed: uniform(env, seed))
    assert found.cost >= 0.4, found
