"""Deep deterministic policy gradient: targets, loss, and the agent that applies them.

Source: Lillicrap et al., "Continuous control with deep reinforcement learning", 2016. Read beside `sac.py`.
"""

import copy
from typing import Any

import numpy as np
import torch
from torch import Tensor

from risk_sac.agents.adam import Adam
from risk_sac.agents.agent import UpdateResult, all_finite, loading, mean_magnitude
from risk_sac.agents.critics import Critics
from risk_sac.agents.networks import Mlp
from risk_sac.agents.replay import Batch
from risk_sac.config.learner import AgentConfig, DdpgConfig
from risk_sac.frozen_policy import FrozenPolicy
from risk_sac.types import Floats, Vector


def deterministic_target(reward: Tensor, terminated: Tensor, next_value: Tensor, discount: float) -> Tensor:
    """Target of the critic.

    y = r + γ (1 - terminated) Q̄_ψ(s', μ̄_θ(s'))

    Args:
      reward: `batch`, the reward to be maximised.
      terminated: `batch`, 1 where s' is terminal; 0 where only the time limit was reached.
      next_value: `batch`, target critic at the target policy's action.
      discount: γ.

    Returns:
      `batch`.

    Source: Lillicrap et al. 2016, Alg. 1.
    """
    return reward + discount * (1.0 - terminated) * next_value


def actor_loss(action: Tensor, values: Tensor, slope: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Negative value of the policy's own actions.

    J_μ = -E[w Q_ψ(s, a)],  a = tanh(x),  ∂J_μ/∂x = -w ∂Q/∂a (1 - a²) / batch

    Args:
      action: a, `batch x action_size`, from the policy network's output x.
      values: `batch`, Q_ψ(s, a).
      slope: `batch x action_size`, ∂Q/∂a.
      weight: `batch`, importance weights of (10), 1 on average.

    Returns:
      J_μ, and its gradient in x, `batch x action_size`.

    Source: Lillicrap et al. 2016, Eq. 6, times w of RISK-SAC, Eq. 10.
    """
    return -(weight * values).mean(), weight.unsqueeze(1) * slope * (1.0 - action.square()) / -len(values)


class DdpgAgent:
    """Policy and critic with targets; Gaussian noise explores.

    Choice: Gaussian noise instead of an Ornstein-Uhlenbeck process, which later work found to gain nothing.
    """

    temperature = 0.0

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        config: AgentConfig,
        ddpg: DdpgConfig,
        seed: int,
        device: str = "cpu",
    ) -> None:
        self._config = config
        self._ddpg = ddpg
        self._action_size = action_size
        self._device = torch.device(device)
        self._generator = torch.Generator(self._device).manual_seed(seed)
        self._policy = Mlp((observation_size, *config.hidden_sizes, action_size), self._generator)
        self._target_policy = copy.deepcopy(self._policy)
        self._critics = Critics(1, observation_size, action_size, config, self._generator)
        self._actor_optimizer = Adam([self._policy.parameters], [config.actor_learning_rate])

    def act(self, observation: Vector, explore: bool) -> Vector:
        """See `Agent.act`: the policy's action, with noise while exploring."""
        action = np.tanh(self._policy.respond(observation))
        if explore:
            noise = torch.randn(action.shape, generator=self._generator, device=self._device).cpu().numpy()
            action = np.clip(action + self._ddpg.exploration_deviation * noise, -1.0, 1.0)
        return action

    def frozen(self) -> FrozenPolicy:
        """See `Agent.frozen`."""
        return self._policy.frozen(self._action_size)

    @torch.inference_mode()
    def td_errors(self, batch: Batch, reward: Tensor) -> Floats:
        """See `Agent.td_errors`."""
        target = self._target(reward, batch.terminated, batch.next_observation)
        return mean_magnitude(target - self._critics.values(batch.observation, batch.action))

    @torch.inference_mode()
    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """See `Agent.update`."""
        target = self._target(reward, batch.terminated, batch.next_observation)
        td_errors, loss_q = self._critics.fit(batch.observation, batch.action, target, batch.weight)

        evaluated = self._policy.forward(batch.observation)
        action = torch.tanh(evaluated.output)
        values, slope = self._critics.smallest(batch.observation, action)
        loss_mu, gradient = actor_loss(action, values, slope, batch.weight / batch.weight.mean())
        self._policy.backward(evaluated, gradient)
        self._actor_optimizer.step()
        self._critics.follow()
        self._target_policy.parameters.lerp_(self._policy.parameters, self._config.target_rate)

        critic_figure, actor_figure = all_finite(torch.stack((loss_q, loss_mu)).tolist())
        return UpdateResult(
            td_errors=mean_magnitude(td_errors),
            critic_loss=critic_figure,
            actor_loss=actor_figure,
            temperature=0.0,
            entropy=0.0,
        )

    def state(self) -> dict[str, Any]:
        """See `Agent.state`."""
        return copy.deepcopy(
            {
                "policy": self._policy.parameters,
                "target_policy": self._target_policy.parameters,
                "critics": self._critics.state(),
                "actor_optimizer": self._actor_optimizer.state(),
                "generator": self._generator.get_state(),
            }
        )

    def load(self, state: dict[str, Any]) -> None:
        """See `Agent.load`."""
        state = copy.deepcopy(state)  # the optimisers would share its tensors
        with loading():
            self._policy.parameters.copy_(state["policy"])
            self._target_policy.parameters.copy_(state["target_policy"])
            self._critics.load(state["critics"])
            self._actor_optimizer.load(state["actor_optimizer"])
            self._generator.set_state(state["generator"])

    def _target(self, reward: Tensor, terminated: Tensor, next_observation: Tensor) -> Tensor:
        next_action = torch.tanh(self._target_policy.forward(next_observation).output)
        next_value = self._critics.target_values(next_observation, next_action)[0]
        return deterministic_target(reward, terminated, next_value, self._config.discount)
