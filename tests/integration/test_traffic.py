"""Traffic in which nobody attacks has no collisions: what the ego runs into otherwise, it was made to."""

from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import FamilyName, RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.problem import Problem
from risk_sac.records import Collision

EPISODES = 40
each_family = pytest.mark.parametrize("family", ["low", "mixed", "dense"])


def contacts(family: FamilyName, *, controlled: bool) -> list[tuple[int, Collision]]:
    """By seed, those of episodes in which all actions are 0."""
    spec = RunSpec(family=family, method="risk-sac" if controlled else "no-adversary", seed=0)
    found = []
    with closing(RiskSacEnv(Problem.from_spec(spec), spec.learner.reward, controlled=controlled)) as env:
        for seed in range(EPISODES):
            env.reset(seed=seed)
            terminated = truncated = False
            while not (terminated or truncated):
                _, _, terminated, truncated, info = env.step(np.zeros(env.action_size, dtype=np.float32))
            if terminated:
                found.append((seed, info["collision"]))
    return found


@each_family
def test_without_adversaries_nobody_is_touched(family: FamilyName) -> None:
    assert contacts(family, controlled=False) == []


@each_family
def test_adversaries_that_do_nothing_are_hardly_ever_touched(family: FamilyName) -> None:
    assert len(contacts(family, controlled=True)) <= 1  # at most 1 % of many episodes
