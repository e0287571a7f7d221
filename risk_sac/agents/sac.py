"""Soft actor-critic: losses, and the agent that applies them.

Source: RISK-SAC, Eq. 4; Haarnoja et al., "Soft actor-critic algorithms and applications", 2018.
"""

import copy
import math
from typing import Any, NamedTuple

import torch
from torch import Tensor

from risk_sac.agents.adam import Adam
from risk_sac.agents.agent import UpdateResult, all_finite, loading, mean_magnitude
from risk_sac.agents.critics import Critics
from risk_sac.agents.networks import Mlp, bounded_log_std, draw_action, tanh_gaussian, tanh_gaussian_gradient
from risk_sac.agents.replay import Batch
from risk_sac.config.learner import MOST_TEMPERATURE, AgentConfig, SacConfig
from risk_sac.frozen_policy import FrozenPolicy
from risk_sac.types import Floats, Vector


def soft_target(
    reward: Tensor,
    terminated: Tensor,
    next_values: Tensor,
    next_log_prob: Tensor,
    temperature: Tensor,
    discount: float,
) -> Tensor:
    """Target of both critics.

    y = r + γ (1 - terminated) (min_i Q̄_ψi(s', a') - α log π(a'|s')),  a' ~ π(·|s')

    Args:
      reward: `batch`, the reward to be maximised.
      terminated: `batch`, 1 where s' is terminal; 0 where only the time limit was reached.
      next_values: `2 x batch`, target critics at (s', a').
      next_log_prob: `batch`.
      temperature: α.
      discount: γ.

    Returns:
      `batch`.

    Source: Haarnoja et al. 2018, Eq. 2-3 and 5, with the smaller of two target critics (Sec. 6).
    """
    soft_value = next_values.amin(dim=0) - temperature * next_log_prob
    return reward + discount * (1.0 - terminated) * soft_value


class Sample(NamedTuple):
    """Actions drawn from the policy, and what they were drawn with."""

    raw: Tensor  # output of the policy network, `batch x 2 action_size`
    noise: Tensor  # ε, `batch x action_size`
    action: Tensor  # `batch x action_size`
    log_prob: Tensor  # `batch`

    def since(self, row: int) -> "Sample":
        """Those from a row on."""
        return Sample(*(each[row:] for each in self))


def actor_loss(
    sample: Sample, values: Tensor, slope: Tensor, weight: Tensor, temperature: Tensor
) -> tuple[Tensor, Tensor]:
    """Negative soft value of the policy's own actions, the term in the sum of (4).

    J_π = E[w (α log π(a|s) - Q(s, a))],  a ~ π(·|s) reparameterised,  Q = min_i Q_ψi
    ∂J_π/∂x = w (α ∂log π/∂x - ∂Q/∂a ∂a/∂x) / batch

    Choice: weighted like the critics' loss. Most PER agents weight that alone, but then the policy learns for the
    states that are replayed most and forgets the quiet ones, from which an attack has to begin.

    Args:
      sample: a and log π(a|s), from the policy network's output x.
      values: `batch`, Q(s, a).
      slope: `batch x action_size`, ∂Q/∂a.
      weight: `batch`, importance weights of (10), 1 on average.
      temperature: α, held constant.

    Returns:
      J_π, and its gradient in x, `batch x 2 action_size`.

    Source: Haarnoja et al. 2018, Eq. 7-10.
    """
    count = len(values)
    loss = (weight * (temperature * sample.log_prob - values)).mean()
    gradient = tanh_gaussian_gradient(sample.raw, sample.noise, sample.action, slope / -count, temperature / count)
    return loss, weight.unsqueeze(1) * gradient


def temperature_loss(temperature: Tensor, entropy: Tensor, target_entropy: float) -> tuple[Tensor, Tensor]:
    """Pulls the policy's entropy towards its target.

    J(α) = E[-α (log π(a|s) + H̄)] = α (H - H̄) with the policy's entropy H = E[-log π(a|s)],  ∂J/∂log α = J(α)

    Choice: minimised over log α, so that α stays positive.

    Args:
      temperature: α.
      entropy: H, nats.
      target_entropy: H̄, nats.

    Returns:
      J(α), and its gradient in log α.

    Source: Haarnoja et al. 2018, Eq. 18.
    """
    loss = temperature * (entropy - target_entropy)
    return loss, loss


class SacAgent:
    """Policy, twin critics with targets and learned temperature; all noise from one generator."""

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: AgentConfig,
        sac: SacConfig,
        seed: int,
        device: str = "cpu",
    ) -> None:
        self._config = config
        self._action_size = action_size
        self._target_entropy = sac.target_entropy_per_action * action_size
        self._device = torch.device(device)
        self._generator = torch.Generator(self._device).manual_seed(seed)
        self._policy = Mlp((observation_size, *config.hidden_sizes, 2 * action_size), self._generator)
        self._critics = Critics(2, observation_size, action_size, config, self._generator)
        self._log_temperature = torch.full((1,), math.log(sac.initial_temperature), device=self._device)
        self._actor_optimizer = Adam(
            [self._policy.parameters, self._log_temperature],
            [config.actor_learning_rate, sac.temperature_learning_rate],
        )

    @property
    def temperature(self) -> float:
        """α."""
        return self._log_temperature.exp().item()

    def act(self, observation: Vector, explore: bool) -> Vector:
        """See `Agent.act`: a draw from the policy, or tanh of its mean."""
        noise = torch.zeros(self._action_size)
        if explore:
            noise = torch.randn(self._action_size, generator=self._generator, device=self._device).cpu()
        return draw_action(self._policy.respond(observation), noise.numpy())

    def frozen(self) -> FrozenPolicy:
        """See `Agent.frozen`."""
        return self._policy.frozen(self._action_size)

    @torch.inference_mode()
    def td_errors(self, batch: Batch, reward: Tensor) -> Floats:
        """See `Agent.td_errors`."""
        drawn = self._sample(self._policy.forward(batch.next_observation).output)
        target = self._target(reward, batch.terminated, batch.next_observation, drawn.action, drawn.log_prob)
        return mean_magnitude(target - self._critics.values(batch.observation, batch.action))

    @torch.inference_mode()
    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """See `Agent.update`."""
        count = len(reward)
        # The policy changes last, so one pass serves the critics' targets and its own step.
        evaluated = self._policy.forward(torch.cat((batch.next_observation, batch.observation)))
        drawn = self._sample(evaluated.output)
        next_action, next_log_prob = drawn.action[:count], drawn.log_prob[:count]
        target = self._target(reward, batch.terminated, batch.next_observation, next_action, next_log_prob)
        td_errors, loss_q = self._critics.fit(batch.observation, batch.action, target, batch.weight)

        own = drawn.since(count)
        values, slope = self._critics.smallest(batch.observation, own.action)
        temperature = self._log_temperature.exp()
        loss_pi, gradient = actor_loss(own, values, slope, batch.weight / batch.weight.mean(), temperature)
        self._policy.backward(evaluated.since(count), gradient)
        entropy = -own.log_prob.mean()
        _, self._log_temperature.grad = temperature_loss(temperature, entropy, self._target_entropy)
        self._actor_optimizer.step()
        # Choice: α has a bound. An entropy that the policy cannot reach would have it grow without end.
        self._log_temperature.clamp_(max=math.log(MOST_TEMPERATURE))
        self._critics.follow()

        figures = torch.stack((loss_q, loss_pi, self._log_temperature.exp()[0], entropy)).tolist()
        critic_figure, actor_figure, temperature_figure, entropy_figure = all_finite(figures)
        return UpdateResult(
            td_errors=mean_magnitude(td_errors),
            critic_loss=critic_figure,
            actor_loss=actor_figure,
            temperature=temperature_figure,
            entropy=entropy_figure,
        )

    def state(self) -> dict[str, Any]:
        """See `Agent.state`."""
        return copy.deepcopy(
            {
                "policy": self._policy.parameters,
                "critics": self._critics.state(),
                "log_temperature": self._log_temperature,
                "actor_optimizer": self._actor_optimizer.state(),
                "generator": self._generator.get_state(),
            }
        )

    def load(self, state: dict[str, Any]) -> None:
        """See `Agent.load`."""
        state = copy.deepcopy(state)  # the optimisers would share its tensors
        with loading():
            self._policy.parameters.copy_(state["policy"])
            self._critics.load(state["critics"])
            self._log_temperature.copy_(state["log_temperature"])
            self._actor_optimizer.load(state["actor_optimizer"])
            self._generator.set_state(state["generator"])

    def _target(
        self, reward: Tensor, terminated: Tensor, next_observation: Tensor, next_action: Tensor, next_log_prob: Tensor
    ) -> Tensor:
        next_values = self._critics.target_values(next_observation, next_action)
        temperature = self._log_temperature.exp()
        return soft_target(reward, terminated, next_values, next_log_prob, temperature, self._config.discount)

    def _sample(self, raw: Tensor) -> Sample:
        mean, raw_log_std = raw.chunk(2, dim=1)
        noise = torch.randn(mean.shape, generator=self._generator, device=self._device)
        return Sample(raw, noise, *tanh_gaussian(mean, bounded_log_std(raw_log_std), noise))
