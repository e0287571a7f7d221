import dataclasses
import io
import math

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from risk_sac.agents.networks import bounded_log_std
from risk_sac.agents.replay import Batch
from risk_sac.agents.sac import SacAgent, actor_loss, critic_loss, soft_target, temperature_loss
from risk_sac.config import SacConfig
from risk_sac.errors import NotFinite

OBSERVATIONS, ACTIONS, ROWS = 5, 2, 16
CONFIG = SacConfig(hidden_sizes=(16, 16), batch_size=ROWS, critic_learning_rate=1e-3, target_rate=0.01)


def random_batch(generator: np.random.Generator) -> Batch:
    def normal(*shape: int) -> Tensor:
        return torch.from_numpy(generator.standard_normal(shape).astype(np.float32))

    return Batch(
        observation=normal(ROWS, OBSERVATIONS),
        action=normal(ROWS, ACTIONS).tanh(),
        risk_reward=normal(ROWS),
        cost=normal(ROWS).abs(),
        robustness=normal(ROWS),
        next_robustness=normal(ROWS),
        next_observation=normal(ROWS, OBSERVATIONS),
        terminated=(normal(ROWS) > 1.0).float(),
        weight=normal(ROWS).abs().clamp(0.1, 1.0),
        indices=np.arange(ROWS),
    )


def test_soft_target_of_a_hand_computed_case() -> None:
    target = soft_target(
        reward=torch.tensor([1.0, 1.0]),
        terminated=torch.tensor([0.0, 1.0]),
        next_values=torch.tensor([[3.0, 3.0], [5.0, 5.0]]),
        next_log_prob=torch.tensor([-2.0, -2.0]),
        temperature=torch.tensor(0.5),
        discount=0.9,
    )
    assert target.tolist() == pytest.approx([1.0 + 0.9 * (3.0 + 1.0), 1.0])


def test_critic_loss_of_a_hand_computed_case() -> None:
    td_errors = torch.tensor([[2.0, 0.0], [1.0, 4.0]])
    # First critic: ½ mean(1·4, ½·0) = 1; second: ½ mean(1·1, ½·16) = 2.25.
    assert critic_loss(td_errors, torch.tensor([1.0, 0.5])).item() == 3.25


def test_actor_loss_of_a_hand_computed_case() -> None:
    loss = actor_loss(torch.tensor([-1.0, 1.0]), torch.tensor([[1.0, 2.0], [3.0, 0.0]]), torch.tensor(0.5))
    assert loss.item() == pytest.approx(((-0.5 - 1.0) + (0.5 - 0.0)) / 2)


def test_temperature_falls_while_entropy_exceeds_its_target_and_rises_below() -> None:
    for entropy, sign in ((3.0, 1.0), (-3.0, -1.0)):
        log_temperature = torch.tensor(math.log(0.2), requires_grad=True)
        temperature_loss(log_temperature, torch.full((4,), -entropy), target_entropy=-2.0).backward()
        # dJ/dlog α = α (entropy - H̄)
        assert log_temperature.grad.item() == pytest.approx(0.2 * (entropy + 2.0))
        assert math.copysign(1.0, log_temperature.grad.item()) == sign


def test_actions_stay_in_the_unit_box_and_the_mean_is_deterministic() -> None:
    agent = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=0)
    observation = np.full(OBSERVATIONS, 100.0)
    drawn = np.array([agent.act(observation, explore=True) for _ in range(50)])
    assert drawn.shape == (50, ACTIONS)
    assert drawn.dtype == np.float32
    assert (np.abs(drawn) <= 1.0).all()
    assert len(np.unique(drawn, axis=0)) > 1
    assert np.array_equal(agent.act(observation, explore=False), agent.act(observation, explore=False))


def test_agent_neither_reads_nor_moves_the_global_generator() -> None:
    torch.manual_seed(1)
    before = torch.get_rng_state()
    figures = []
    for global_seed in (1, 2):
        agent = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=3)
        agent.act(np.zeros(OBSERVATIONS, np.float32), explore=True)
        batch = random_batch(np.random.default_rng(0))
        figures.append(agent.update(batch, batch.risk_reward))
        assert torch.equal(torch.get_rng_state(), before)
        torch.manual_seed(global_seed + 1)
        before = torch.get_rng_state()
    assert figures[0].actor_loss == figures[1].actor_loss
    assert figures[0].critic_loss == figures[1].critic_loss


def test_td_error_of_one_transition_is_that_of_the_batch_at_equal_noise() -> None:
    agent = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=0)
    state = agent.state()
    batch = random_batch(np.random.default_rng(0))
    one = agent.td_error(
        batch.observation[0].numpy(), batch.action[0].numpy(), 0.5, batch.next_observation[0].numpy(), False
    )
    agent.load(state)
    single = dataclasses.replace(
        batch,
        observation=batch.observation[:1],
        action=batch.action[:1],
        next_observation=batch.next_observation[:1],
        terminated=torch.zeros(1),
        weight=torch.ones(1),
    )
    assert agent.update(single, torch.tensor([0.5])).td_errors == pytest.approx([one], rel=1e-6)


def test_actor_step_leaves_no_gradient_in_the_critics() -> None:
    agent = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=0)
    batch = random_batch(np.random.default_rng(0))
    agent._update_actor(batch.observation)
    assert all(parameter.grad is None for parameter in agent._critics.parameters())
    assert all(parameter.grad is not None for parameter in agent._policy.parameters())


def test_reward_that_is_no_number_is_noticed() -> None:
    agent = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=0)
    batch = random_batch(np.random.default_rng(0))
    with pytest.raises(NotFinite, match="learning rates"):
        agent.update(batch, batch.risk_reward * float("nan"))


def test_resumed_agent_equals_one_never_interrupted_bit_for_bit() -> None:
    agents = [SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=seed) for seed in (0, 99)]
    generator = np.random.default_rng(0)
    for _ in range(10):
        batch = random_batch(generator)
        agents[0].update(batch, batch.risk_reward)
    file = io.BytesIO()
    torch.save(agents[0].state(), file)
    file.seek(0)
    state = torch.load(file, weights_only=True)
    agents[1].load(state)
    resumed_later = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=7)
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


class Reference:
    """SAC as the papers write it: separate critics, one loss at a time, plain Adam, no shortcuts."""

    def __init__(self, agent: SacAgent) -> None:
        self.policy = [*map(clone, agent._policy.weights)], [*map(clone, agent._policy.biases)]
        self.critics = [split(agent._critics, twin) for twin in range(2)]
        self.targets = [split(agent._critics, twin) for twin in range(2)]
        self.log_temperature = clone(agent._log_temperature)
        self.generator = torch.Generator()
        self.generator.set_state(agent._generator.get_state())
        adam = {"fused": False, "foreach": False}
        self.policy_optimizer = torch.optim.Adam(flat(self.policy), lr=CONFIG.actor_learning_rate, **adam)
        self.temperature_optimizer = torch.optim.Adam(
            [self.log_temperature], lr=CONFIG.temperature_learning_rate, **adam
        )
        self.critic_optimizers = [
            torch.optim.Adam(flat(critic), lr=CONFIG.critic_learning_rate, **adam) for critic in self.critics
        ]

    def sample(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        mean, raw = network(self.policy, observation).chunk(2, dim=1)
        normal = torch.distributions.Normal(mean, bounded_log_std(raw).exp())
        unsquashed = mean + normal.stddev * torch.randn(mean.shape, generator=self.generator)
        action = torch.tanh(unsquashed)
        return action, (normal.log_prob(unsquashed) - torch.log(1.0 - action**2 + 1e-12)).sum(1)

    def update(self, batch: Batch, reward: Tensor) -> None:
        temperature = self.log_temperature.exp().detach()
        action, log_prob = self.sample(batch.next_observation)
        inputs = torch.cat((batch.next_observation, action), 1)
        smaller = torch.minimum(*(network(target, inputs)[:, 0] for target in self.targets))
        target = (reward + CONFIG.discount * (1.0 - batch.terminated) * (smaller - temperature * log_prob)).detach()
        for critic, optimizer in zip(self.critics, self.critic_optimizers, strict=True):
            value = network(critic, torch.cat((batch.observation, batch.action), 1))[:, 0]
            step(optimizer, (batch.weight * 0.5 * (value - target) ** 2).mean())
        action, log_prob = self.sample(batch.observation)
        inputs = torch.cat((batch.observation, action), 1)
        smaller = torch.minimum(*(network(critic, inputs)[:, 0] for critic in self.critics))
        step(self.policy_optimizer, (temperature * log_prob - smaller).mean())
        target_entropy = CONFIG.target_entropy_per_action * ACTIONS
        step(self.temperature_optimizer, (-self.log_temperature.exp() * (log_prob.detach() + target_entropy)).mean())
        for critic, target_critic in zip(self.critics, self.targets, strict=True):
            for parameter, average in zip(flat(critic), flat(target_critic), strict=True):
                average.data = (1 - CONFIG.target_rate) * average.data + CONFIG.target_rate * parameter.data


def network(layers: tuple[list[Tensor], list[Tensor]], hidden: Tensor) -> Tensor:
    weights, biases = layers
    for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
        hidden = torch.relu(hidden @ weight + bias)
    return hidden @ weights[-1] + biases[-1]


def clone(parameter: Tensor) -> Tensor:
    return parameter.detach().clone().requires_grad_()


def split(critics: nn.Module, twin: int) -> tuple[list[Tensor], list[Tensor]]:
    return [clone(weight[twin]) for weight in critics.weights], [clone(bias[twin, 0]) for bias in critics.biases]


def flat(layers: tuple[list[Tensor], list[Tensor]]) -> list[Tensor]:
    weights, biases = layers
    return [*weights, *biases]


def step(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()


def test_a_hundred_updates_equal_a_plain_autograd_reference() -> None:
    agent = SacAgent(OBSERVATIONS, ACTIONS, CONFIG, seed=0)
    reference = Reference(agent)
    generator = np.random.default_rng(0)
    for _ in range(100):
        batch = random_batch(generator)
        agent.update(batch, batch.risk_reward)
        reference.update(batch, batch.risk_reward)
    for fast, plain in zip(agent._policy.parameters(), flat(reference.policy), strict=True):
        torch.testing.assert_close(fast, plain, rtol=0, atol=1e-5)
    for stacked, plain in ((agent._critics, reference.critics), (agent._targets, reference.targets)):
        for twin in range(2):
            for fast, slow in zip(flat(split(stacked, twin)), flat(plain[twin]), strict=True):
                torch.testing.assert_close(fast, slow, rtol=0, atol=1e-5)
    assert agent.temperature == pytest.approx(reference.log_temperature.exp().item(), abs=1e-5)
