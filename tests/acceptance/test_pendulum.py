"""The learner solves a task of another kind through Gymnasium's interface."""

from collections.abc import Iterator

import gymnasium
import numpy as np
import pytest
import torch

from risk_sac.config import METHODS, AgentConfig, LearnerConfig, MethodName, ReplayConfig, SacConfig
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.transition import Transition

STEPS = 10_000
CONFIG = LearnerConfig(
    agent=AgentConfig(
        decision_steps=1,
        updates_per_step=1,
        hidden_sizes=(64, 64),
        batch_size=64,
        actor_learning_rate=1e-3,
        critic_learning_rate=2e-3,
        target_rate=0.01,
        warmup_steps=500,
    ),
    sac=SacConfig(temperature_learning_rate=1e-3),
    replay=ReplayConfig(capacity=STEPS),
)


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def scaled(action: np.ndarray, box: gymnasium.spaces.Box) -> np.ndarray:
    return box.low + 0.5 * (action + 1.0) * (box.high - box.low)


def train(learner: Learner, seed: int, steps: int) -> None:
    env = gymnasium.make("Pendulum-v1")
    observation, _ = env.reset(seed=seed)
    accumulated = 0.0
    for _ in range(steps):
        action = learner.act(observation)
        next_observation, reward, terminated, truncated, _ = env.step(scaled(action, env.action_space))
        accumulated += float(reward)
        learner.observe(
            Transition(
                observation=observation,
                action=action,
                risk_reward=float(reward),
                cost=0.0,
                robustness=0.0,
                next_robustness=0.0,
                next_observation=next_observation,
                terminated=terminated,
                accumulated_reward=accumulated,
            )
        )
        learner.update()
        observation = next_observation
        if terminated or truncated:
            observation, _ = env.reset()
            accumulated = 0.0
    env.close()


def mean_return(learner: Learner, episodes: int) -> float:
    env = gymnasium.make("Pendulum-v1")
    total = 0.0
    for episode in range(episodes):
        observation, _ = env.reset(seed=10_000 + episode)
        done = False
        while not done:
            action = scaled(learner.act(observation, explore=False), env.action_space)
            observation, reward, terminated, truncated, _ = env.step(action)
            total += float(reward)
            done = terminated or truncated
    env.close()
    return total / episodes


@pytest.mark.parametrize(
    ("method", "seed", "steps"),
    [
        ("sac", 0, 3_500),
        *(pytest.param("sac", seed, 5_000, marks=pytest.mark.torture) for seed in (1, 2)),
        *(pytest.param("ddpg", seed, STEPS, marks=pytest.mark.torture) for seed in (0, 1, 2)),
        pytest.param("risk-sac-only-rper", 0, STEPS, marks=pytest.mark.torture),
    ],
)
def test_learner_swings_up_the_pendulum(method: MethodName, seed: int, steps: int) -> None:
    learner = Learner(3, 1, METHODS[method], CONFIG, seed)
    train(learner, seed, steps)
    assert mean_return(learner, episodes=20) >= -250.0
