"""Soft actor-critic: losses, and the agent that minimises them.

Source: RISK-SAC, Eq. 4; Haarnoja et al., "Soft actor-critic algorithms and applications", 2018.
"""

import copy
import math
from dataclasses import fields
from functools import partial

import torch
from torch import Tensor, nn
from torch.optim import Adam

from risk_sac.config.learner import MOST_TEMPERATURE, AgentConfig, SacConfig
from risk_sac.search.agents.agent import (
    Agent,
    UpdateResult,
    actor_weights,
    all_finite,
    critic_loss,
    follow,
    mean_magnitude,
    minimise,
    td_target,
)
from risk_sac.search.agents.networks import Mlp, bounded_log_std, raw_log_std, tanh_gaussian
from risk_sac.search.agents.replay import Batch
from risk_sac.search.frozen_policy import Layers
from risk_sac.world.types import Vector


def soft_value(values: Tensor, log_prob: Tensor, temperature: Tensor) -> Tensor:
    """Soft value of a state by one action drawn in it.

    V(s) = min_i Q_ψi(s, a) - α log π(a|s),  a ~ π(·|s)

    Args:
      values: `2 x batch`, both critics at (s, a).
      log_prob: `batch`, log π(a|s).
      temperature: α, held constant.

    Returns:
      `batch`.

    Source: Haarnoja et al. 2018, Eq. 3, with the smaller of two critics (Sec. 6).
    """
    return values.amin(dim=0) - temperature * log_prob


def actor_loss(value: Tensor, weight: Tensor) -> Tensor:
    """Computes the negative soft value of the policy's actions, as in (4).

    J_π = E[w (α log π(a|s) - min_i Q_ψi(s, a))] = -E[w V(s)],  a ~ π(·|s) reparameterised

    Choice: weighted like the critics' loss. Most PER agents weight that alone, but then the policy learns for the
    states that are replayed most and forgets the quiet ones, from which an attack has to begin.

    Args:
      value: `batch`, the soft value V(s).
      weight: `batch`, importance weights of (10), 1 on average.

    Source: Haarnoja et al. 2018, Eq. 7-10.
    """
    return -(weight * value).mean()


def temperature_loss(temperature: Tensor, entropy: Tensor, target_entropy: float) -> Tensor:
    """Moves the policy's entropy towards its target.

    J(α) = E[-α (log π(a|s) + H̄)] = α (H - H̄) with the policy's entropy H = E[-log π(a|s)]

    Args:
      temperature: α.
      entropy: H, nats, held constant.
      target_entropy: H̄, nats.

    Source: Haarnoja et al. 2018, Eq. 18.
    """
    return temperature * (entropy - target_entropy)


class Temperature(nn.Module):
    """α in (0, MOST_TEMPERATURE], learned as its logarithm to stay positive."""

    def __init__(self, initial: float, device: torch.device) -> None:
        super().__init__()
        self.log = nn.Parameter(torch.tensor(math.log(initial), device=device))

    def forward(self) -> Tensor:
        """α."""
        return self.log.exp()

    @torch.no_grad()
    def clamp(self) -> None:
        """Bounds α, which an unreachable entropy would make grow without end (choice)."""
        self.log.clamp_(max=math.log(MOST_TEMPERATURE))


class SacAgent(Agent):
    """Policy, twin critics with targets and learned temperature, with one noise generator.

    Choice: the critics' hidden layers are normalised. Otherwise a memory of a few thousand transitions, replayed at the
    pace of the steps, makes them overrate untried actions. Source: Ball et al., "Efficient online reinforcement
    learning with offline data", 2023, Sec. 4.2.
    """

    exploration = "squashed"

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: AgentConfig,
        sac: SacConfig,
        seed: int,
        device: str = "cpu",
        *,
        normalised: bool = False,
    ) -> None:
        """Draws the networks; `normalised` says whether the policy's hidden layers are, too."""
        self._config = config
        self._action_size = action_size
        self._target_entropy = sac.target_entropy_per_action * action_size
        self._generator = torch.Generator(torch.device(device)).manual_seed(seed)
        critic_sizes = (observation_size + action_size, *config.hidden_sizes, 1)
        policy_sizes = (observation_size, *config.hidden_sizes, 2 * action_size)
        self._policy = Mlp(policy_sizes, self._generator, normalised=normalised)
        self._critics = Mlp(critic_sizes, self._generator, count=2, normalised=True)
        self._targets = copy.deepcopy(self._critics)
        self._temperature = Temperature(sac.initial_temperature, self._generator.device)
        graphed = self._generator.device.type == "cuda"  # an update may become a part of a CUDA graph
        adam = partial(Adam, fused=True, capturable=graphed)
        self._critic_optimizer = adam(self._critics.parameters(), lr=config.critic_learning_rate)
        self._policy_optimizer = adam(
            [
                {"params": self._policy.parameters(), "lr": config.actor_learning_rate},
                {"params": self._temperature.parameters(), "lr": sac.temperature_learning_rate},
            ]
        )
        self.parts = {
            "policy": self._policy,
            "critics": self._critics,
            "targets": self._targets,
            "temperature": self._temperature,
            "critic_optimizer": self._critic_optimizer,
            "policy_optimizer": self._policy_optimizer,
        }

    @property
    def generator(self) -> torch.Generator:
        """Generator of all noise."""
        return self._generator

    @property
    def temperature(self) -> float:
        """α."""
        return self._temperature.log.detach().exp().item()

    def spread(self, deviation: float) -> None:
        """Gives the initial policy about this σ, not a random network's 0.22."""
        self._policy.set_last_bias(self._action_size, raw_log_std(deviation))

    def networks(self) -> tuple[Layers, Layers]:
        """Returns the arrays of policy and critics, see `Mlp.arrays`."""
        return self._policy.arrays(), self._critics.arrays()

    @torch.no_grad()
    def begin_from(self, policy: Layers, critics: Layers, temperature: float) -> None:
        """Takes over networks, as `networks` returns them, and α."""
        self._policy.copy_from(policy)
        for networks in (self._critics, self._targets):
            networks.copy_from(critics)
        self._temperature.log.fill_(math.log(temperature))

    @torch.no_grad()
    def act(self, observation: Vector, explore: bool) -> Vector:
        """See `Agent.act`: a draw from the policy, or tanh of its mean."""
        mean, raw = self._policy.respond(observation).chunk(2)
        if explore:
            mean = mean + bounded_log_std(raw).exp() * self._noise(self._action_size).cpu()
        return torch.tanh(mean).numpy()

    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """See `Agent.update`."""
        return self.result(*self.advance(batch, reward))

    def advance(self, batch: Batch, reward: Tensor) -> tuple[Tensor, Tensor]:
        """Makes one step of all networks; returns `result`'s input without synchronising."""
        td_errors = self._td_errors(batch, reward)
        loss_q = critic_loss(td_errors, batch.weight, self._config.critic_loss)
        minimise(loss_q, self._critic_optimizer)

        action, log_prob = self._sample(batch.observation)
        temperature, entropy = self._temperature(), -log_prob.detach().mean()
        value = soft_value(values(self._critics, batch.observation, action), log_prob, temperature.detach())
        loss_pi = actor_loss(value, actor_weights(batch, weighted=self._config.weighted_actor))
        loss_alpha = temperature_loss(temperature, entropy, self._target_entropy)
        minimise(loss_pi + loss_alpha, self._policy_optimizer)
        self._temperature.clamp()
        follow(self._targets, self._critics, self._config.target_rate)
        return td_errors.detach(), torch.stack((loss_q, loss_pi, self._temperature(), entropy)).detach()

    def result(self, td_errors: Tensor, figures: Tensor) -> UpdateResult:
        """Returns the figures of an update; raises NotFinite if one is not."""
        return UpdateResult(mean_magnitude(td_errors), *all_finite(figures.tolist()))

    @torch.no_grad()
    def _target(self, batch: Batch, reward: Tensor) -> Tensor:
        action, log_prob = self._sample(batch.next_observation)
        next_values = values(self._targets, batch.next_observation, action)
        next_value = soft_value(next_values, log_prob, self._temperature())
        return td_target(reward, batch.terminated, next_value, self._config.discount)

    def _td_errors(self, batch: Batch, reward: Tensor) -> Tensor:
        return self._target(batch, reward) - values(self._critics, batch.observation, batch.action)

    def _sample(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        mean, raw = self._policy(observation)[0].chunk(2, dim=1)
        return tanh_gaussian(mean, bounded_log_std(raw), self._noise(*mean.shape))

    def _noise(self, *shape: int) -> Tensor:
        return torch.randn(shape, generator=self._generator, device=self._generator.device)


def values(critics: Mlp, observation: Tensor, action: Tensor) -> Tensor:
    """Q_ψi(s, a), `critics x batch`."""
    values: Tensor = critics(torch.cat((observation, action), dim=1))
    return values.squeeze(-1)


WARM_UP = 3  # updates before the recording; in them torch sets up what may not be set up within


class GraphedUpdate:
    """Makes an agent's updates; they are the same as those of `SacAgent.update`.

    Batches must have the same size. An agent that has loaded a state needs a new object.
    """

    def __init__(self, agent: SacAgent) -> None:
        """Records nothing yet; the agent must live on a GPU."""
        self._agent = agent
        self._made = 0
        self._graph: torch.cuda.CUDAGraph | None = None

    def __call__(self, batch: Batch) -> UpdateResult:
        """Makes one update with a CPU batch and its risk reward."""
        if self._made < WARM_UP:
            return self._warm_up(batch.on("cuda"))
        if self._graph is None:
            self._graph = self._recorded(batch.on("cuda"))
        for name, tensor in self._given.items():
            tensor.copy_(getattr(batch, name))
        self._graph.replay()
        return self._agent.result(*self._figures)

    def _warm_up(self, batch: Batch) -> UpdateResult:
        """Makes an update without a graph, on another stream, as torch requires."""
        self._made += 1
        stream = torch.cuda.Stream()  # type: ignore[no-untyped-call]
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            figures = self._agent.advance(batch, batch.risk_reward)
        torch.cuda.current_stream().wait_stream(stream)
        return self._agent.result(*figures)

    def _recorded(self, batch: Batch) -> torch.cuda.CUDAGraph:
        """Records an update without making it; later batches reuse this one's memory."""
        self._given: dict[str, Tensor] = {f.name: getattr(batch, f.name) for f in fields(batch) if f.name != "indices"}
        graph = torch.cuda.CUDAGraph()
        graph.register_generator_state(self._agent.generator)
        with torch.cuda.graph(graph):
            self._figures = self._agent.advance(batch, batch.risk_reward)
        return graph
