"""Random episodes of an environment, and whether two are bitwise equal."""

import numpy as np

from risk_sac.env.env import RiskSacEnv
from risk_sac.world.types import Scene

Outcome = tuple[np.ndarray, float, bool, bool, dict[str, object]]


def episode(env: RiskSacEnv, seed: int, action_seed: int = 0, **options: Scene) -> list[Outcome]:
    """Everything a random episode returns, its reset first."""
    generator = np.random.default_rng(action_seed)
    observation, info = env.reset(seed=seed, options=options or None)
    outcomes: list[Outcome] = [(observation, 0.0, False, False, info)]
    while not (outcomes[-1][2] or outcomes[-1][3]):
        outcomes.append(env.step(generator.uniform(-1, 1, env.action_size).astype(np.float32)))
    return outcomes


def same(one: list[Outcome], other: list[Outcome]) -> bool:
    return len(one) == len(other) and all(
        np.array_equal(a[0], b[0]) and a[1:] == b[1:] for a, b in zip(one, other, strict=True)
    )
