"""Plays the episodes of a control. Episode i has the same scene and the same random actions whatever the ego."""

from contextlib import closing
from dataclasses import dataclass

import numpy as np

from risk_sac.agents.random import RandomAgent
from risk_sac.audit.controls import Control
from risk_sac.config import FamilyName, RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.errors import InfeasibleScene
from risk_sac.problem import Problem
from risk_sac.records import Collision


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """One episode of a control."""

    index: int
    rejected: str = ""  # the rule of C_hard that refused its scene
    steps: int = 0
    mean_cost: float = 0.0  # C_soft per step
    collision: Collision | None = None


def play(family: FamilyName, control: Control, seed: int, first: int, count: int) -> list[Played]:
    """Episodes `first` to `first + count - 1`.

    Args:
      family: of the scenes.
      control: who drives and who attacks.
      seed: of the audit.
      first: index of the first one.
      count: how many.
    """
    spec = RunSpec(family=family, method="random", seed=0, ego=control.ego)
    env = RiskSacEnv(Problem.from_spec(spec), spec.learner.reward, controlled=control.attack != "nobody")
    with closing(env):
        return [_episode(env, control, index, seed) for index in range(first, first + count)]


def _episode(env: RiskSacEnv, control: Control, index: int, seed: int) -> Played:
    draw = np.random.default_rng((seed, index))
    scene = env.problem.space.from_unit(draw.random(env.problem.space.dimension))
    simulator_seed, action_seed = (int(value) for value in draw.integers(2**31 - 1, size=2))
    agent = RandomAgent(env.action_size, action_seed) if control.attack == "random" else None
    try:
        observation, _ = env.reset(seed=simulator_seed, options={"scene": scene})
    except InfeasibleScene as infeasible:
        return Played(index=index, rejected=infeasible.reason)
    cost, steps, ended = 0.0, 0, False
    while not ended:
        action = agent.act(observation) if agent else np.zeros(env.action_size, dtype=np.float32)
        observation, _, terminated, truncated, info = env.step(action)
        cost, steps, ended = cost + info["cost"], steps + 1, terminated or truncated
    return Played(index=index, steps=steps, mean_cost=cost / steps, collision=info.get("collision"))
