"""Requirements and C_soft on traffic, measured with the real simulator.

A few episodes a family on fixed seeds; `Statistics` is what a report on more of them would compute as well. Signals and
scales were tuned on the seeds 2000 to 3700 and 9000 to 9039; what these tests play was not looked at before.
"""

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import spearmanr

from risk_sac.config import DynamicElements, FamilyName, Odd, RunSpec
from risk_sac.env.env import Observation, RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.records import ARTEFACT_RULES, Collision
from risk_sac.risk.stl import ROBUSTNESS_CLIP
from risk_sac.run_folder.series import Trace
from risk_sac.search.agents.controls import ScriptedAgent
from risk_sac.world.types import STEP_S, Floats, Scene

each_family = pytest.mark.parametrize("family", ["low", "mixed", "dense"])
UNDISTURBED_SEEDS = range(9100, 9115)
CONTACT_SEEDS = range(9100, 9125)
CONTACT_STEPS = round(3.0 / STEP_S)
MOVED = 0.1  # of a scale

# Scenes in which the scripted adversary often strikes the ego: on a slippery road a neighbour drives ahead of the ego
# and cuts in; a pedestrian steps out from behind a vehicle in the next lane; and one crosses on red behind a queue.
DANGEROUS: dict[FamilyName, dict[str, tuple[float, float]]] = {
    "low": {
        "ego_speed_mps": (10.5, 16.6),
        "lead_gap_m": (35, 50),
        "lead_speed_mps": (13, 16.6),
        "left_offset_m": (12, 25),
        "left_speed_mps": (14.5, 16.6),
        "right_offset_m": (-15, -10),
        "follower_gap_m": (30, 40),
        "friction": (0.6, 0.65),
    },
    "mixed": {
        "crossing": (0.6, 1.0),
        "ego_speed_mps": (6, 10),
        "ego_distance_m": (25, 27),
        "occluder_distance_m": (0.5, 1.5),
        "pedestrian_offset_m": (1, 1.9),
        "pedestrian_setback_m": (0.3, 0.5),
        "pedestrian_speed_mps": (1.5, 2),
        "signal_offset_s": (0, 0.5),
    },
    "dense": {
        "ego_turn": (0.35, 0.6),
        "ego_distance_m": (70, 90),
        "ego_speed_mps": (5, 9),
        "oncoming_distance_m": (60, 90),
        "from_left_distance_m": (75, 90),
        "from_right_turn": (0, 0.3),
        "from_right_distance_m": (10, 20),
        "from_right_speed_mps": (10, 13.8),
        "pedestrian_offset_m": (-1.9, -1.3),
        "pedestrian_setback_m": (4.7, 5),
        "pedestrian_speed_mps": (1.2, 1.6),
        "background_gap_m": (15, 20),
        "signal_offset_s": (0, 1.5),
        "friction": (0.6, 0.62),
    },
}

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


EMERGENCY = Odd(dynamic=DynamicElements(behaviour="emergency"))  # random actions meet the ego too seldom otherwise


def environment(family: FamilyName, *, controlled: bool) -> RiskSacEnv:
    spec = RunSpec(family=family, method="risk-sac" if controlled else "no-adversary", seed=0, odd=EMERGENCY)
    return RiskSacEnv(Problem.from_spec(spec), spec.learner.reward, controlled=controlled)


def episode(
    env: RiskSacEnv, seed: int, act: Policy, scene: Scene | None = None
) -> tuple[Trace, list[float], Collision | None]:
    observation, _ = env.reset(seed=seed, options={"scene": scene} if scene else None)
    costs = []
    while True:
        observation, _, terminated, truncated, info = env.step(act(observation))
        costs.append(info["cost"])
        if terminated or truncated:
            return env.trace, costs, info.get("collision")


def idle(env: RiskSacEnv) -> Policy:
    return lambda _: np.zeros(env.action_size, dtype=np.float32)


def statistics(env: RiskSacEnv, seeds: range, policy: Callable[[int], Policy]) -> tuple[Statistics, int]:
    """What the episodes say, and how many ended in a contact."""
    traces, costs, contacts = [], [], 0
    for seed in seeds:
        trace, paid, collision = episode(env, seed, policy(seed))
        traces.append(trace)
        costs += paid
        contacts += collision is not None
    return Statistics.of(env, traces, costs), contacts


@each_family
def test_undisturbed_traffic_meets_the_requirements_costs_nothing_and_touches_nobody(family: FamilyName) -> None:
    with closing(environment(family, controlled=False)) as env:
        found, contacts = statistics(env, UNDISTURBED_SEEDS, lambda _: idle(env))
    assert contacts == 0
    assert found.positive >= 0.99, found
    assert max(found.minimum.values()) <= 0.6, found
    assert found.clipped < 0.01, found
    assert found.cost <= 0.05, found
    assert all(0.5 <= median <= 3.0 for median in found.median.values()), found


@each_family
def test_adversaries_that_do_nothing_are_hardly_ever_touched(family: FamilyName) -> None:
    with closing(environment(family, controlled=True)) as env:
        _, contacts = statistics(env, UNDISTURBED_SEEDS[:6], lambda _: idle(env))
    assert contacts <= 1


def dangerous(env: RiskSacEnv, seed: int) -> Scene:
    """Uniform in the family's `DANGEROUS` bounds."""
    generator = np.random.default_rng(seed)
    space, bounds = env.problem.space, DANGEROUS[env.problem.family.name]
    return Scene(
        space.family, {p.name: float(generator.uniform(*bounds.get(p.name, (p.low, p.high)))) for p in space.parameters}
    )


def is_degenerate(collision: Collision) -> bool:
    """Whether the ego is not at fault: struck from behind, aside, standing."""
    return not all(passed for rule, passed in collision.verdicts.items() if rule not in ARTEFACT_RULES)


def before_contacts(env: RiskSacEnv, seeds: range) -> list[Floats]:
    """Soft minimum in the last 3 s before contacts, since the release."""
    found = []
    for seed in seeds:
        scripted = ScriptedAgent(env.action_size, seed)
        trace, _, collision = episode(env, seed, scripted.act, dangerous(env, seed))
        if collision is not None and not is_degenerate(collision):
            soft = np.array([measure.soft_min for measure in trace.measures[trace.released :]])
            found.append(soft[-CONTACT_STEPS:])
    return found


def moved_for_s(soft: Floats) -> float:
    """Time before the contact since it stays `MOVED` below its start, s."""
    above = np.flatnonzero(soft >= soft[0] - MOVED)
    return float(len(soft) - 1 - above[-1]) * STEP_S


@each_family
def test_before_contacts_the_soft_minimum_moves_early_and_falls_steadily(family: FamilyName) -> None:
    with closing(environment(family, controlled=True)) as env:
        contacts = before_contacts(env, CONTACT_SEEDS)
    assert len(contacts) >= 5
    trend = [spearmanr(np.arange(len(soft)), soft).statistic for soft in contacts]
    assert np.median(trend) <= -0.9, trend
    assert np.median([moved_for_s(soft) for soft in contacts]) >= 1.5, contacts
