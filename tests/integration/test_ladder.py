"""Better egos fail less under the same attacks, from slowest to careful."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np

from risk_sac.config import DynamicElements, EgoConfig, FamilyName, Odd, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import InfeasibleScene
from risk_sac.world.types import Scene

ATTACK_FROM, ATTACK_STEPS = 12, 45  # after the release, and how long it lasts
RUNGS = {
    "reaction 1.0 s": EgoConfig(reaction_time_s=1.0),
    "reaction 0.5 s": EgoConfig(),
    "reaction 0.1 s": EgoConfig(reaction_time_s=0.1),
    "reaction 0.1 s, sees all": EgoConfig(profile="perfect"),
}
BESIDE = {"reaction 0.5 s, sees all": EgoConfig(sensor=None), "careful": EgoConfig(profile="careful")}
EMERGENCY = Odd(dynamic=DynamicElements(behaviour="emergency"))  # these attacks spare egos under ordinary limits
PHASES = 10  # of the ego's reaction in which attacks begin: an ego about to decide is lucky


def scenes(family: FamilyName, space_middle: Scene) -> Iterator[Scene]:
    """Yields scenes with a neighbour ahead or a walker at the kerb."""
    if family == "low":
        for offset_m in np.linspace(4.0, 16.0, 13):
            for speed_mps in (10.0, 13.0, 16.0):
                changes = {"ego_speed_mps": speed_mps, "left_speed_mps": speed_mps, "left_offset_m": float(offset_m)}
                far = {"lead_gap_m": 50.0, "lead_speed_mps": speed_mps, "right_offset_m": -15.0, "right_speed_mps": 6.0}
                yield replace(space_middle, values=dict(space_middle.values) | changes | far)
    else:
        for distance_m in np.linspace(40.0, 75.0, 18):
            for offset_m in (-1.5, 0.0):
                changes = {"ego_distance_m": float(distance_m), "ego_speed_mps": 12.0, "pedestrian_offset_m": offset_m}
                still = {"pedestrian_speed_mps": 0.0, "pedestrian_setback_m": 0.3, "crossing": 0.0}
                truck = {"occluder_speed_mps": 0.0, "occluder_distance_m": 2.0}
                yield replace(space_middle, values=dict(space_middle.values) | changes | still | truck)


def attack(family: FamilyName, env: RiskSacEnv, step: int) -> np.ndarray:
    """The left neighbour cuts in and brakes; the walker walks on."""
    action = np.zeros(env.action_size, dtype=np.float32)
    if step >= 0:
        if family == "low":
            action[2:4] = (-0.7, -1.0)
        else:
            action[2] = 1.0
    return action


def touched(family: FamilyName, ego: EgoConfig) -> tuple[int, int]:
    """Counts the episodes in which the ego hit an actor, and all."""
    spec = RunSpec(family=family, method="random", seed=0, ego=ego, odd=EMERGENCY)
    problem = Problem.from_spec(spec)
    hits = count = 0
    with closing(RiskSacEnv(problem, spec.learner.reward)) as env:
        middle = problem.space.from_unit(np.full(problem.space.dimension, 0.5))
        for index, scene in enumerate(scenes(family, middle)):
            start = ATTACK_FROM + 3 * index % PHASES
            try:
                env.reset(seed=1, options={"scene": scene})
            except InfeasibleScene:
                continue
            count += 1
            for step in range(start + ATTACK_STEPS):
                _, _, terminated, truncated, info = env.step(attack(family, env, step - start))
                if terminated or truncated:
                    break
            collision = info.get("collision")
            hits += collision is not None and collision.ego_zone == "front" and collision.ego_speed_mps >= 0.5
    return hits, count


def test_no_ego_fails_more_often_than_the_next_worse_one() -> None:
    totals = []
    for family in ("low", "mixed"):
        found = {name: touched(family, ego) for name, ego in (RUNGS | BESIDE).items()}
        assert len({count for _, count in found.values()}) == 1, "one budget for all"
        hits = [found[name][0] for name in RUNGS]
        assert hits == sorted(hits, reverse=True), (family, found)
        assert all(found[name][0] <= found["reaction 0.5 s"][0] for name in BESIDE), (family, found)
        totals.append(hits)
    worst, *_, best = np.sum(totals, axis=0)
    assert best < worst, totals
