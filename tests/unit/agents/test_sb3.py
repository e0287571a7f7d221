"""The control by Stable-Baselines3: it learns, and goes on from a state bit for bit."""

import numpy as np

from risk_sac.agents.sb3 import Sb3Agent
from risk_sac.config.learner import AgentConfig, SacConfig
from tests.unit.agents.test_agent import random_batch

CONFIG = AgentConfig(hidden_sizes=(32, 32), batch_size=64, actor_learning_rate=0.003, discount=0.01)


def learnt(agent: Sb3Agent, updates: int) -> list[float]:
    """Critic losses of updates on one batch, whose reward is the smaller the farther the action is from 0.5."""
    batch = random_batch(np.random.default_rng(0), 256)
    reward = -((batch.action - 0.5) ** 2).sum(dim=1)
    return [agent.update(batch, reward).critic_loss for _ in range(updates)]


def test_learns_what_is_rewarded() -> None:
    agent = Sb3Agent(5, 2, CONFIG, SacConfig(), 0)
    observation = np.zeros(5, np.float32)
    before = np.abs(agent.act(observation, explore=False) - 0.5).max()
    losses = learnt(agent, 400)
    assert losses[-1] < losses[0] / 10
    after = agent.act(observation, explore=False)
    assert np.abs(after - 0.5).max() < min(before, 0.25)
    assert 0.0 < agent.temperature < SacConfig().initial_temperature


def test_goes_on_from_its_state_bit_for_bit() -> None:
    agent, other = Sb3Agent(5, 2, CONFIG, SacConfig(), 0), Sb3Agent(5, 2, CONFIG, SacConfig(), 1)
    learnt(agent, 3)
    state = agent.state()
    expected = learnt(agent, 3), agent.act(np.ones(5, np.float32), explore=True)
    other.load(state)
    found = learnt(other, 3), other.act(np.ones(5, np.float32), explore=True)
    assert found[0] == expected[0]
    np.testing.assert_array_equal(found[1], expected[1])
    assert other.temperature == agent.temperature
