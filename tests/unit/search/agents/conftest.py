import numpy as np
import pytest
import torch

from risk_sac.search.agents.transition import Transition


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture
def transition():
    def make(value=0.0, *, observation_size=3, action_size=2, **changes):
        fields = {
            "observation": np.full(observation_size, value, np.float32),
            "action": np.full(action_size, np.tanh(value), np.float32),
            "risk_reward": value,
            "cost": 0.0,
            "robustness": 0.0,
            "next_robustness": 0.0,
            "next_observation": np.full(observation_size, value + 1.0, np.float32),
            "terminated": False,
            "accumulated_reward": 0.0,
        }
        return Transition(**(fields | changes))

    return make


@pytest.fixture
def random_transition(transition):
    def make(generator, observation_size=3, action_size=2):
        return transition(
            observation=generator.standard_normal(observation_size).astype(np.float32),
            action=generator.uniform(-1, 1, action_size).astype(np.float32),
            risk_reward=generator.normal(),
            cost=generator.uniform(),
            robustness=generator.normal(),
            next_robustness=generator.normal(),
            next_observation=generator.standard_normal(observation_size).astype(np.float32),
            terminated=bool(generator.uniform() < 0.1),
            accumulated_reward=generator.normal(),
        )

    return make
