"""The agents as the papers write them: autograd, one loss at a time, plain Adam, no shortcuts."""

import torch
from torch import Tensor
from torch.distributions import Normal, TanhTransform
from torch.nn.functional import layer_norm

from risk_sac.agents.ddpg import DdpgAgent
from risk_sac.agents.networks import Mlp, bounded_log_std
from risk_sac.agents.replay import Batch
from risk_sac.agents.sac import SacAgent
from risk_sac.config import AgentConfig, SacConfig


class PlainMlp:
    """The same function as a network of ours, with parameters of its own."""

    def __init__(self, network: Mlp) -> None:
        self._weights = [weight.detach().clone().requires_grad_() for weight in network._weights]
        self._biases = [bias.detach().clone().requires_grad_() for bias in network._biases]
        self._normalised = network._normalised

    def __call__(self, hidden: Tensor) -> Tensor:
        for weight, bias in zip(self._weights[:-1], self._biases[:-1], strict=True):
            hidden = hidden @ weight + bias
            hidden = torch.relu(layer_norm(hidden, hidden.shape[1:]) if self._normalised else hidden)
        return hidden @ self._weights[-1] + self._biases[-1]

    def tensors(self) -> list[Tensor]:
        return [tensor for layer in zip(self._weights, self._biases, strict=True) for tensor in layer]

    def parameters(self) -> Tensor:
        return torch.cat([tensor.detach().ravel() for tensor in self.tensors()])

    def take_over(self, parameters: Tensor) -> None:
        tensors = self.tensors()
        for tensor, part in zip(tensors, parameters.split([tensor.numel() for tensor in tensors]), strict=True):
            tensor.data = part.view_as(tensor).clone()

    def gradient(self) -> Tensor:
        return torch.cat([tensor.grad.ravel() for tensor in self.tensors()])

    def follow(self, other: "PlainMlp", rate: float) -> None:
        for mine, theirs in zip(self.tensors(), other.tensors(), strict=True):
            mine.data = (1 - rate) * mine.data + rate * theirs.data


def adam(network: PlainMlp, learning_rate: float) -> torch.optim.Optimizer:
    return torch.optim.Adam(network.tensors(), lr=learning_rate, fused=False, foreach=False)


def step(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()


class PlainCritics:
    """Separate critics, each with its own loss and optimiser."""

    def __init__(self, agent: SacAgent | DdpgAgent, config: AgentConfig) -> None:
        self.config = config
        self.online = [PlainMlp(critic) for critic in agent._critics._critics]
        self.targets = [PlainMlp(critic) for critic in agent._critics._critics]
        self.optimizers = [adam(critic, config.critic_learning_rate) for critic in self.online]

    def fit(self, batch: Batch, target: Tensor) -> None:
        inputs = torch.cat((batch.observation, batch.action), 1)
        for critic, optimizer in zip(self.online, self.optimizers, strict=True):
            step(optimizer, (batch.weight * 0.5 * (critic(inputs)[:, 0] - target.detach()) ** 2).mean())

    def smallest(self, networks: list[PlainMlp], observation: Tensor, action: Tensor) -> Tensor:
        inputs = torch.cat((observation, action), 1)
        return torch.stack([network(inputs)[:, 0] for network in networks]).min(0).values

    def follow(self) -> None:
        for target, critic in zip(self.targets, self.online, strict=True):
            target.follow(critic, self.config.target_rate)


class PlainSac:
    def __init__(self, agent: SacAgent, config: AgentConfig, sac: SacConfig, actions: int) -> None:
        self.config = config
        self.target_entropy = sac.target_entropy_per_action * actions
        self.policy = PlainMlp(agent._policy)
        self.critics = PlainCritics(agent, config)
        self.log_temperature = agent._log_temperature.detach().clone().requires_grad_()
        self.generator = torch.Generator()
        self.generator.set_state(agent._generator.get_state())
        self.policy_optimizer = adam(self.policy, config.actor_learning_rate)
        self.temperature_optimizer = torch.optim.Adam([self.log_temperature], lr=sac.temperature_learning_rate)

    def sample(self, observation: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        mean, raw = self.policy(observation).chunk(2, dim=1)
        normal = Normal(mean, bounded_log_std(raw).exp())
        unsquashed = mean + normal.stddev * noise
        action = torch.tanh(unsquashed)
        squashing = TanhTransform().log_abs_det_jacobian(unsquashed, action)
        return action, (normal.log_prob(unsquashed) - squashing).sum(1)

    def update(self, batch: Batch, reward: Tensor) -> None:
        temperature = self.log_temperature.exp().detach()
        rows, actions = batch.action.shape
        noise = torch.randn(2 * rows, actions, generator=self.generator)  # first that of the targets
        action, log_prob = self.sample(batch.next_observation, noise[:rows])
        value = self.critics.smallest(self.critics.targets, batch.next_observation, action) - temperature * log_prob
        self.critics.fit(batch, reward + self.config.discount * (1.0 - batch.terminated) * value)
        action, log_prob = self.sample(batch.observation, noise[rows:])
        value = self.critics.smallest(self.critics.online, batch.observation, action)
        weight = batch.weight / batch.weight.mean()
        step(self.policy_optimizer, (weight * (temperature * log_prob - value)).mean())
        entropy_gap = log_prob.detach() + self.target_entropy
        step(self.temperature_optimizer, (-self.log_temperature.exp() * entropy_gap).mean())
        self.critics.follow()


class PlainDdpg:
    def __init__(self, agent: DdpgAgent, config: AgentConfig) -> None:
        self.config = config
        self.policy, self.target_policy = PlainMlp(agent._policy), PlainMlp(agent._policy)
        self.critics = PlainCritics(agent, config)
        self.policy_optimizer = adam(self.policy, config.actor_learning_rate)

    def update(self, batch: Batch, reward: Tensor) -> None:
        action = torch.tanh(self.target_policy(batch.next_observation))
        value = self.critics.smallest(self.critics.targets, batch.next_observation, action)
        self.critics.fit(batch, reward + self.config.discount * (1.0 - batch.terminated) * value)
        action = torch.tanh(self.policy(batch.observation))
        value = self.critics.smallest(self.critics.online, batch.observation, action)
        step(self.policy_optimizer, -(batch.weight / batch.weight.mean() * value).mean())
        self.critics.follow()
        self.target_policy.follow(self.policy, self.config.target_rate)
