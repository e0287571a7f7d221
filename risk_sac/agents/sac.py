"""Soft actor-critic: losses, and the agent that applies them.

Source: RISK-SAC, Eq. 4; Haarnoja et al., "Soft actor-critic algorithms and applications", 2018.
"""

import copy
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from risk_sac.agents.networks import Policy, TwinCritics, tanh_gaussian
from risk_sac.agents.replay import Batch, Vector
from risk_sac.config.learner import SacConfig
from risk_sac.errors import CheckpointError, NotFinite
from risk_sac.types import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdateResult:
    """What one update of all networks found out."""

    td_errors: Floats  # batch; |δ|, mean over the two critics
    critic_loss: float
    actor_loss: float
    temperature: float  # α after the update
    entropy: float  # of the policy over the batch, nats


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


def critic_loss(td_errors: Tensor, weight: Tensor) -> Tensor:
    """Importance-weighted squared error of both critics.

    J_Q = Σ_i E[w · ½ (y - Q_ψi(s, a))²]

    Args:
      td_errors: `2 x batch`, y - Q_ψi.
      weight: `batch`, importance weights of (10).

    Source: Haarnoja et al. 2018, Eq. 5, times w of RISK-SAC, Eq. 10.
    """
    return 0.5 * (weight * td_errors.square()).mean(dim=1).sum()


def actor_loss(log_prob: Tensor, values: Tensor, temperature: Tensor) -> Tensor:
    """Negative soft value of the policy's own actions, the term in the sum of (4).

    J_π = E[α log π(a|s) - min_i Q_ψi(s, a)],  a ~ π(·|s) reparameterised

    Choice: importance weights are left out here, as in most PER agents; they correct the values' bias.

    Args:
      log_prob: `batch`.
      values: `2 x batch`.
      temperature: α, held constant.

    Source: Haarnoja et al. 2018, Eq. 7-9.
    """
    return (temperature * log_prob - values.amin(dim=0)).mean()


def temperature_loss(log_temperature: Tensor, log_prob: Tensor, target_entropy: float) -> Tensor:
    """Pulls the policy's entropy towards its target.

    J(α) = E[-α (log π(a|s) + H̄)], minimised over log α so that α stays positive

    Args:
      log_temperature: log α.
      log_prob: `batch`, held constant.
      target_entropy: H̄, nats.

    Source: Haarnoja et al. 2018, Eq. 18.
    """
    return -log_temperature.exp() * (log_prob.detach().mean() + target_entropy)


class SacAgent:
    """Policy, twin critics with targets and learned temperature; all noise from one generator."""

    def __init__(self, observation_size: int, action_size: int, config: SacConfig, seed: int) -> None:
        self._config = config
        self._target_entropy = config.target_entropy_per_action * action_size
        self._generator = torch.Generator().manual_seed(seed)
        sizes = (observation_size, action_size, config.hidden_sizes)
        self._policy = Policy(*sizes, self._generator)
        self._critics = TwinCritics(*sizes, self._generator)
        self._targets = copy.deepcopy(self._critics).requires_grad_(False)
        self._log_temperature = torch.tensor(math.log(config.initial_temperature), requires_grad=True)
        self._critic_optimizer = torch.optim.Adam(
            self._critics.parameters(), lr=config.critic_learning_rate, fused=True
        )
        # α rides in the actor's optimiser: one backward pass and one fused step serve both.
        self._actor_parameters = [*self._policy.parameters(), self._log_temperature]
        self._actor_optimizer = torch.optim.Adam(
            [
                {"params": list(self._policy.parameters()), "lr": config.actor_learning_rate},
                {"params": [self._log_temperature], "lr": config.temperature_learning_rate},
            ],
            fused=True,
        )
        self._critic_tensors = [parameter.detach() for parameter in self._critics.parameters()]  # same memory
        self._target_tensors = [parameter.detach() for parameter in self._targets.parameters()]

    @property
    def temperature(self) -> float:
        """α."""
        return self._log_temperature.exp().item()

    @torch.no_grad()
    def act(self, observation: Vector, explore: bool) -> Vector:
        """Action in [-1, 1], `action_size`: a draw from the policy, or tanh of its mean.

        Args:
          observation: `observation_size`.
          explore: draw (Alg. 1, l. 7), or take the mean.
        """
        mean, log_std = self._policy(_row(observation))
        action: Tensor = self._sample(mean, log_std)[0] if explore else torch.tanh(mean)
        return action.squeeze(0).numpy()

    @torch.no_grad()
    def td_error(
        self, observation: Vector, action: Vector, reward: float, next_observation: Vector, terminated: bool
    ) -> float:
        """|δ| of one transition, mean over the two critics; arguments as in `soft_target`, unbatched."""
        target = self._target(
            torch.tensor([reward], dtype=torch.float32), _row(next_observation), torch.tensor([float(terminated)])
        )
        values: Tensor = self._critics(_row(observation), _row(action))
        return (target - values).abs().mean().item()

    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """One step of critics, policy, temperature and target networks (Alg. 1, l. 14).

        Args:
          batch: transitions with their importance weights.
          reward: `batch`, the reward of each under the current dual variable.

        Raises:
          NotFinite: a loss is NaN or infinite.
        """
        td_errors, loss_q = self._update_critics(batch, reward)
        loss_pi, log_prob = self._update_actor(batch.observation)
        torch._foreach_lerp_(self._target_tensors, self._critic_tensors, self._config.target_rate)
        figures = torch.stack((loss_q, loss_pi, self._log_temperature.detach().exp(), -log_prob.mean())).tolist()
        if not all(map(math.isfinite, figures)):
            raise NotFinite(
                f"critic loss, actor loss, temperature and entropy are {figures}; wanted finite numbers."
                " Lower the learning rates of learner.sac or the weights of learner.reward."
            )
        return UpdateResult(
            td_errors=td_errors.abs().mean(dim=0).double().numpy(),
            critic_loss=figures[0],
            actor_loss=figures[1],
            temperature=figures[2],
            entropy=figures[3],
        )

    def state(self) -> dict[str, Any]:
        """Networks, optimisers and generator, copied; tensors and plain values only."""
        return copy.deepcopy(
            {
                "policy": dict(self._policy.state_dict()),
                "critics": dict(self._critics.state_dict()),
                "targets": dict(self._targets.state_dict()),
                "log_temperature": self._log_temperature.detach(),
                "critic_optimizer": self._critic_optimizer.state_dict(),
                "actor_optimizer": self._actor_optimizer.state_dict(),
                "generator": self._generator.get_state(),
            }
        )

    def load(self, state: dict[str, Any]) -> None:
        """Continue from `state()`.

        Raises:
          CheckpointError: the state is of other networks; the agent is not to be used any further.
        """
        state = copy.deepcopy(state)  # the optimisers would share its tensors
        try:
            self._policy.load_state_dict(state["policy"])
            self._critics.load_state_dict(state["critics"])
            self._targets.load_state_dict(state["targets"])
            self._log_temperature.data.copy_(state["log_temperature"])
            self._critic_optimizer.load_state_dict(state["critic_optimizer"])
            self._actor_optimizer.load_state_dict(state["actor_optimizer"])
            self._generator.set_state(state["generator"])
        except (KeyError, RuntimeError, ValueError) as error:
            raise CheckpointError(
                f"agent in the checkpoint does not fit: {error}. Resume with the learner.sac.hidden_sizes of the run"
                " that wrote it."
            ) from error

    def _update_critics(self, batch: Batch, reward: Tensor) -> tuple[Tensor, Tensor]:
        with torch.no_grad():
            target = self._target(reward, batch.next_observation, batch.terminated)
        td_errors = target - self._critics(batch.observation, batch.action)  # 2 x batch
        loss = critic_loss(td_errors, batch.weight)
        self._critic_optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self._critic_optimizer.step()
        return td_errors.detach(), loss.detach()

    def _update_actor(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        action, log_prob = self._sample(*self._policy(observation))
        loss = actor_loss(log_prob, self._critics(observation, action), self._log_temperature.detach().exp())
        self._actor_optimizer.zero_grad()
        # `inputs` keeps gradients out of the critics and saves computing them.
        (loss + temperature_loss(self._log_temperature, log_prob, self._target_entropy)).backward(  # type: ignore[no-untyped-call]
            inputs=self._actor_parameters
        )
        self._actor_optimizer.step()
        return loss.detach(), log_prob.detach()

    def _target(self, reward: Tensor, next_observation: Tensor, terminated: Tensor) -> Tensor:
        next_action, next_log_prob = self._sample(*self._policy(next_observation))
        next_values = self._targets(next_observation, next_action)
        temperature = self._log_temperature.exp()
        return soft_target(reward, terminated, next_values, next_log_prob, temperature, self._config.discount)

    def _sample(self, mean: Tensor, log_std: Tensor) -> tuple[Tensor, Tensor]:
        return tanh_gaussian(mean, log_std, torch.randn(mean.shape, generator=self._generator))


def _row(vector: Vector) -> Tensor:
    """A batch of one, `1 x size`."""
    return torch.from_numpy(np.asarray(vector, np.float32)[None])
