import numpy as np
import pytest
import torch

from risk_sac.config.learner import AgentConfig, ReplayConfig, SacConfig
from risk_sac.search.agents.replay import Batch, UniformReplay
from risk_sac.search.agents.sac import WARM_UP, GraphedUpdate, SacAgent
from risk_sac.search.agents.transition import Transition

SIZES = 7, 3  # of an observation and an action


def transition(random: np.random.Generator, observation_size: int, action_size: int) -> Transition:
    """Draws a transition."""
    before, after, action = (
        random.uniform(-1, 1, size).astype(np.float32) for size in (observation_size, observation_size, action_size)
    )
    return Transition(
        observation=before,
        action=action,
        risk_reward=float(action.sum()),
        cost=0.0,
        robustness=0.0,
        next_robustness=0.0,
        next_observation=after,
        terminated=bool(random.random() < 0.1),
        accumulated_reward=0.0,
    )


def batches(count: int) -> list[Batch]:
    """Draws batches of random transitions."""
    random, replay = np.random.default_rng(3), UniformReplay(*SIZES, ReplayConfig(capacity=1000))
    for _ in range(1000):
        replay.add(transition(random, *SIZES))
    return [replay.sample(64, random) for _ in range(count)]


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU with CUDA")
def test_updates_of_a_graph_are_those_of_the_agent():
    plain, graphed = (SacAgent(*SIZES, AgentConfig(), SacConfig(), 5, "cuda", normalised=True) for _ in range(2))
    update = GraphedUpdate(graphed)
    for batch in batches(WARM_UP + 40):
        on_device = batch.on("cuda")
        wanted, found = plain.update(on_device, on_device.risk_reward), update(batch)
        assert found.critic_loss == pytest.approx(wanted.critic_loss, rel=1e-4)
        assert found.entropy == pytest.approx(wanted.entropy, rel=1e-4)
    for wanted_layers, found_layers in zip(plain.networks(), graphed.networks(), strict=True):
        for wanted_layer, found_layer in zip(wanted_layers, found_layers, strict=True):
            np.testing.assert_allclose(found_layer, wanted_layer, atol=1e-5)
