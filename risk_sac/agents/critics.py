"""Action values with their slow targets: one for DDPG, two for SAC.

Source: Lillicrap et al., "Continuous control with deep reinforcement learning", 2016 (targets); Fujimoto et al.,
"Addressing function approximation error in actor-critic methods", 2018 (the smaller of two).
"""

import copy
from typing import Any

import torch
from torch import Tensor

from risk_sac.agents.adam import Adam
from risk_sac.agents.networks import Mlp
from risk_sac.config.learner import AgentConfig


def critic_loss(td_errors: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
    """Importance-weighted squared error of all critics.

    J_Q = Σ_i E[w · ½ (y - Q_ψi(s, a))²],  ∂J_Q/∂Q_ψi = -w (y - Q_ψi) / batch

    Args:
      td_errors: `critics x batch`, y - Q_ψi.
      weight: `batch`, importance weights of (10).

    Returns:
      J_Q, and its gradient in the values, `critics x batch`.

    Source: Haarnoja et al. 2018, Eq. 5, times w of RISK-SAC, Eq. 10.
    """
    weighted = weight * td_errors
    return 0.5 * (weighted * td_errors).mean(dim=1).sum(), weighted / -td_errors.shape[1]


class Critics:
    """Q_ψi(s, a) of equal shape, their targets Q̄_ψi and their optimiser.

    Choice: their hidden layers are normalised. A memory of a few thousand transitions, replayed at the pace of the
    steps, otherwise makes them overrate what the policy might do and nobody has tried.

    Source: Ball et al., "Efficient online reinforcement learning with offline data", 2023, Sec. 4.2 (normalisation).
    """

    def __init__(
        self, count: int, observation_size: int, action_size: int, config: AgentConfig, generator: torch.Generator
    ) -> None:
        self._observation_size = observation_size
        self._rate = config.target_rate
        sizes = (observation_size + action_size, *config.hidden_sizes, 1)
        self._critics = [Mlp(sizes, generator, normalised=True) for _ in range(count)]
        self._targets = copy.deepcopy(self._critics)
        self._parameters = [critic.parameters for critic in self._critics]
        self._target_parameters = [target.parameters for target in self._targets]
        self._optimizer = Adam(self._parameters, [config.critic_learning_rate] * count)

    def values(self, observation: Tensor, action: Tensor) -> Tensor:
        """Q_ψi, `critics x batch`."""
        return _evaluate(self._critics, observation, action)

    def target_values(self, observation: Tensor, action: Tensor) -> Tensor:
        """Q̄_ψi, `critics x batch`."""
        return _evaluate(self._targets, observation, action)

    def fit(self, observation: Tensor, action: Tensor, target: Tensor, weight: Tensor) -> tuple[Tensor, Tensor]:
        """One optimiser step towards the targets y.

        Returns:
          y - Q_ψi before the step, `critics x batch`, and J_Q.
        """
        inputs = torch.cat((observation, action), dim=1)
        passes = [critic.forward(inputs) for critic in self._critics]
        td_errors = target - torch.stack([each.output[:, 0] for each in passes])
        loss, gradient = critic_loss(td_errors, weight)
        for critic, evaluated, column in zip(self._critics, passes, gradient.unsqueeze(2), strict=True):
            critic.backward(evaluated, column)
        self._optimizer.step()
        return td_errors, loss

    def smallest(self, observation: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """min_i Q_ψi(s, a), `batch`, and its gradient in the action, `batch x action_size`."""
        inputs = torch.cat((observation, action), dim=1)
        passes = [critic.forward(inputs) for critic in self._critics]
        values = torch.stack([each.output for each in passes])  # critics x batch x 1
        smallest = values.amin(dim=0)
        chosen = (values == smallest).to(values.dtype)
        columns = slice(self._observation_size, None)
        slopes = [
            critic.input_gradient(evaluated, column, columns)
            for critic, evaluated, column in zip(self._critics, passes, chosen, strict=True)
        ]
        return smallest[:, 0], torch.stack(slopes).sum(dim=0)

    def follow(self) -> None:
        """Moves the targets towards the critics, by τ."""
        torch._foreach_lerp_(self._target_parameters, self._parameters, self._rate)

    def state(self) -> dict[str, Any]:
        """Both kinds of networks and the optimiser."""
        return {
            "critics": self._parameters,
            "targets": self._target_parameters,
            "optimizer": self._optimizer.state(),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Continue from a copy of `state()`; RuntimeError if the networks are of another size."""
        for name, parameters in (("critics", self._parameters), ("targets", self._target_parameters)):
            for mine, stored in zip(parameters, state[name], strict=True):
                mine.copy_(stored)
        self._optimizer.load(state["optimizer"])


def _evaluate(networks: list[Mlp], observation: Tensor, action: Tensor) -> Tensor:
    inputs = torch.cat((observation, action), dim=1)
    return torch.stack([network.forward(inputs).output[:, 0] for network in networks])
