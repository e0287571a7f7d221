"""What every agent must do, whichever algorithm it runs."""

import io
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from risk_sac.config import METHODS, DdpgConfig, LearnerConfig
from risk_sac.config.learner import MOST_TEMPERATURE, AgentConfig, SacConfig
from risk_sac.errors import ConfigError
from risk_sac.search.agents.ddpg import DdpgAgent
from risk_sac.search.agents.learner import Learner
from risk_sac.search.agents.replay import Batch
from risk_sac.search.agents.sac import SacAgent
from risk_sac.search.agents.sb3 import Sb3Agent

OBSERVATIONS, ACTIONS, ROWS = 5, 2, 16
CONFIG = AgentConfig(hidden_sizes=(16, 16), batch_size=ROWS, critic_learning_rate=1e-3, target_rate=0.01)


def sac(config: AgentConfig = CONFIG, *, seed: int = 0) -> SacAgent:
    return SacAgent(OBSERVATIONS, ACTIONS, config, SacConfig(), seed)


def ddpg(config: AgentConfig = CONFIG, *, seed: int = 0) -> DdpgAgent:
    return DdpgAgent(OBSERVATIONS, ACTIONS, config, DdpgConfig(), seed)


both = pytest.mark.parametrize("make", [sac, ddpg])


def random_batch(generator: np.random.Generator, rows: int = ROWS) -> Batch:
    def normal(*shape: int) -> Tensor:
        return torch.from_numpy(generator.standard_normal(shape).astype(np.float32))

    return Batch(
        observation=normal(rows, OBSERVATIONS),
        action=normal(rows, ACTIONS).tanh(),
        risk_reward=normal(rows),
        cost=normal(rows).abs(),
        robustness=normal(rows),
        next_robustness=normal(rows),
        next_observation=normal(rows, OBSERVATIONS),
        terminated=(normal(rows) > 1.0).float(),
        weight=normal(rows).abs().clamp(0.1, 1.0),
        indices=np.arange(rows),
    )


@both
def test_actions_stay_in_the_unit_box_and_the_frozen_policy_is_deterministic(make):
    agent = make()
    observation = np.full(OBSERVATIONS, 100.0)
    drawn = np.array([agent.act(observation, explore=True) for _ in range(50)])
    assert drawn.shape == (50, ACTIONS)
    assert drawn.dtype == np.float32
    assert (np.abs(drawn) <= 1.0).all()
    assert len(np.unique(drawn, axis=0)) > 1
    assert np.array_equal(agent.act(observation, explore=False), agent.act(observation, explore=False))


def test_the_temperature_has_a_bound_where_the_policy_cannot_reach_its_entropy():
    hot = SacConfig(initial_temperature=99.9, temperature_learning_rate=0.01, target_entropy_per_action=0.5)
    config = CONFIG.model_copy(update={"actor_learning_rate": 1e-7})
    agent = SacAgent(OBSERVATIONS, ACTIONS, config, hot, 0)
    batch = random_batch(np.random.default_rng(0))
    found = [agent.update(batch, batch.risk_reward).temperature for _ in range(5)]
    assert found == pytest.approx([MOST_TEMPERATURE] * 5)


@both
def test_importance_weights_scale_the_losses_that_they_are_meant_for(make):
    batch = random_batch(np.random.default_rng(0))
    alike = replace(batch, weight=torch.full_like(batch.weight, 0.2))

    def losses(given: Batch, *, weighted_actor: bool) -> tuple[float, float]:
        agent = make(CONFIG.model_copy(update={"weighted_actor": weighted_actor, "critic_learning_rate": 1e-7}))
        update = agent.update(given, given.risk_reward)
        return update.critic_loss, update.actor_loss

    critic, actor = losses(batch, weighted_actor=True)
    critic_alike, actor_alike = losses(alike, weighted_actor=True)
    assert abs(critic - critic_alike) > 1e-2
    assert abs(actor - actor_alike) > 5e-3
    assert losses(batch, weighted_actor=False) == pytest.approx((critic, actor_alike), abs=1e-5)


@both
def test_agent_neither_reads_nor_moves_the_global_generator(make):
    torch.manual_seed(1)
    before = torch.get_rng_state()
    figures = []
    for global_seed in (1, 2):
        agent = make(seed=3)
        agent.act(np.zeros(OBSERVATIONS, np.float32), explore=True)
        batch = random_batch(np.random.default_rng(0))
        figures.append(agent.update(batch, batch.risk_reward))
        assert torch.equal(torch.get_rng_state(), before)
        torch.manual_seed(global_seed + 1)
        before = torch.get_rng_state()
    assert figures[0].actor_loss == figures[1].actor_loss
    assert figures[0].critic_loss == figures[1].critic_loss


@pytest.mark.parametrize("sign", [1.0, -1.0])
@both
def test_learns_what_is_rewarded(make, sign):
    agent = make(CONFIG.model_copy(update={"discount": 0.01, "actor_learning_rate": 3e-3}))
    batch = random_batch(np.random.default_rng(0), 64)
    losses = [agent.update(batch, sign * batch.action.sum(dim=1)).critic_loss for _ in range(200)]
    assert losses[-1] < losses[0] / 2
    actions = np.array([agent.act(each.numpy(), explore=False) for each in batch.observation])
    assert sign * actions.mean() > 0.5


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a GPU here")
def test_the_cpu_is_taken_unless_a_gpu_is_asked_for_and_a_missing_one_is_refused():
    def learner(device):
        config = LearnerConfig.model_validate({"agent": {"device": device}})
        return Learner(OBSERVATIONS, ACTIONS, METHODS["sac"], config, 0)

    assert (learner("auto").device, learner("cpu").device) == ("cpu", "cpu")
    with pytest.raises(ConfigError, match="CUDA") as caught:
        learner("cuda")
    assert caught.value.field == "learner.agent.device"


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_an_agent_on_the_gpu_learns_what_one_on_the_cpu_learns():
    slow = sac()
    fast = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, SacConfig(), 0, "cuda")
    fast.load(slow.state() | {"generator": fast.state()["generator"]})
    batch = random_batch(np.random.default_rng(0))
    results = [
        agent.update(batch.on(device), batch.risk_reward.to(device))
        for agent, device in ((slow, "cpu"), (fast, "cuda"))
    ]
    assert results[1].critic_loss == pytest.approx(results[0].critic_loss, rel=0.5)  # their noise differs


@both
def test_resumed_agent_equals_one_never_interrupted_bit_for_bit(make):
    agents = [make(seed=seed) for seed in (0, 99)]
    generator = np.random.default_rng(0)
    for _ in range(10):
        batch = random_batch(generator)
        agents[0].update(batch, batch.risk_reward)
    file = io.BytesIO()
    torch.save(agents[0].state(), file)
    file.seek(0)
    state = torch.load(file, weights_only=True)
    agents[1].load(state)
    resumed_later = make(seed=7)
    for agent in agents:
        generator = np.random.default_rng(1)
        for _ in range(10):
            batch = random_batch(generator)
            agent.update(batch, batch.risk_reward)
    observation = np.ones(OBSERVATIONS, np.float32)
    drawn = [agent.act(observation, explore=True) for agent in agents]
    assert np.array_equal(*drawn)
    first, second = (flatten(agent.state()) for agent in agents)
    assert first.keys() == second.keys()
    assert all(torch.equal(torch.as_tensor(first[key]), torch.as_tensor(second[key])) for key in first)
    # A state can be loaded again after the agent that loaded it has moved on.
    resumed_later.load(state)
    assert not np.array_equal(resumed_later.act(observation, explore=False), agents[1].act(observation, explore=False))


def flatten(state: object, prefix: str = "") -> dict[str, object]:
    if isinstance(state, dict):
        items = state.items()
    elif isinstance(state, list | tuple):
        items = enumerate(state)
    else:
        return {} if state is None else {prefix: state}
    return {key: leaf for name, value in items for key, leaf in flatten(value, f"{prefix}/{name}").items()}


SB3_CONFIG = AgentConfig(hidden_sizes=(32, 32), batch_size=64, actor_learning_rate=0.003, discount=0.01)


def learnt(agent: Sb3Agent, updates: int) -> list[float]:
    """Critic losses on one batch, whose reward falls with |action - 0.5|."""
    batch = random_batch(np.random.default_rng(0), 256)
    reward = -((batch.action - 0.5) ** 2).sum(dim=1)
    return [agent.update(batch, reward).critic_loss for _ in range(updates)]


def test_learns_what_is_rewarded_of_sb3():
    agent = Sb3Agent(5, 2, SB3_CONFIG, SacConfig(), 0)
    observation = np.zeros(5, np.float32)
    before = np.abs(agent.act(observation, explore=False) - 0.5).max()
    losses = learnt(agent, 400)
    assert losses[-1] < losses[0] / 10
    after = agent.act(observation, explore=False)
    assert np.abs(after - 0.5).max() < min(before, 0.25)
    assert 0.0 < agent.temperature < SacConfig().initial_temperature


def test_goes_on_from_its_state_bit_for_bit():
    agent, other = Sb3Agent(5, 2, SB3_CONFIG, SacConfig(), 0), Sb3Agent(5, 2, SB3_CONFIG, SacConfig(), 1)
    learnt(agent, 3)
    state = agent.state()
    expected = learnt(agent, 3), agent.act(np.ones(5, np.float32), explore=True)
    other.load(state)
    found = learnt(other, 3), other.act(np.ones(5, np.float32), explore=True)
    assert found[0] == expected[0]
    np.testing.assert_array_equal(found[1], expected[1])
    assert other.temperature == agent.temperature
