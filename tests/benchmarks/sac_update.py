"""One learner update beside Stable-Baselines3's, in a process of its own.

Run: OMP_NUM_THREADS=1 python -m tests.benchmarks.sac_update 256 256; prints the times as JSON. Torch's threads are
fixed at the start of a process.
"""

import json
import sys

import gymnasium as gym
import numpy as np
from stable_baselines3 import SAC
from stable_baselines3.common.logger import Logger

from risk_sac.config import METHODS, LearnerConfig
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.transition import Transition
from tests.benchmarks.timing import interleaved

OBSERVATIONS, ACTIONS, STORED = 48, 6, 5000
WARM_UP = 20
ROUNDS = 150  # of one call each: the shorter, the likelier that nothing else comes in between


class Still(gym.Env[np.ndarray, np.ndarray]):
    """Spaces to build a model from."""

    observation_space = gym.spaces.Box(-5.0, 5.0, (OBSERVATIONS,), np.float32)
    action_space = gym.spaces.Box(-1.0, 1.0, (ACTIONS,), np.float32)


def sb3(width: int, batch: int) -> SAC:
    policy = {"net_arch": [width, width]}
    model = SAC("MlpPolicy", Still(), batch_size=batch, buffer_size=STORED, policy_kwargs=policy, device="cpu")
    model.set_logger(Logger(None, []))
    return model


def ours(width: int, batch: int) -> Learner:
    agent = {"hidden_sizes": (width, width), "batch_size": batch, "warmup_steps": 0, "device": "cpu"}
    config = LearnerConfig.model_validate({"agent": agent, "replay": {"capacity": STORED}})
    return Learner(OBSERVATIONS, ACTIONS, METHODS["sac"], config, 0)


def fill(model: SAC, learner: Learner) -> None:
    generator = np.random.default_rng(0)
    for _ in range(STORED):
        observation, following = generator.standard_normal((2, OBSERVATIONS), np.float32)
        action = generator.uniform(-1.0, 1.0, ACTIONS).astype(np.float32)
        reward = generator.standard_normal(1)
        model.replay_buffer.add(observation, following, action, reward, np.zeros(1), [{}])
        learner.observe(
            Transition(
                observation=observation,
                action=action,
                risk_reward=reward.item(),
                cost=0.1,
                robustness=0.0,
                next_robustness=0.0,
                next_observation=following,
                terminated=False,
                accumulated_reward=0.0,
            )
        )


def main(width: int, batch: int) -> None:
    model, learner = sb3(width, batch), ours(width, batch)
    fill(model, learner)
    calls = (lambda: model.train(1, batch), learner.update)
    interleaved(*calls, rounds=WARM_UP)
    times = interleaved(*calls, rounds=ROUNDS)
    json.dump({"wall_s": times.wall_s.tolist(), "cpu_s": times.cpu_s.tolist()}, sys.stdout)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
