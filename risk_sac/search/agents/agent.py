"""Base of the actor-critic agents: interface, losses and checkpoints."""

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.optim import Adam

from risk_sac.config.learner import CriticLoss
from risk_sac.errors import CheckpointError, ConfigError, NotFinite
from risk_sac.search.agents.networks import Mlp
from risk_sac.search.agents.replay import Batch
from risk_sac.search.agents.snapshot import Exploration
from risk_sac.search.frozen_policy import FrozenPolicy
from risk_sac.world.types import Floats, Vector


@dataclass(frozen=True, slots=True)
class UpdateResult:
    """Figures of one update of all networks."""

    td_errors: Floats  # batch; |δ|, mean over the critics
    critic_loss: float
    actor_loss: float
    temperature: float = 0.0  # α after the update; 0 for an agent without
    entropy: float = 0.0  # of the policy over the batch, nats; 0 for a deterministic one


class Agent(ABC):
    """Policy, critics, their optimisers, and the generator of all their noise.

    Attributes:
      parts: networks and optimisers by their name in a checkpoint.
      exploration: how actions are drawn from the policy's outputs.
    """

    parts: Mapping[str, nn.Module | Adam]
    exploration: Exploration
    _policy: Mlp
    _action_size: int
    _generator: torch.Generator

    @property
    def temperature(self) -> float:
        """α; 0 for an agent without."""
        return 0.0

    @abstractmethod
    def act(self, observation: Vector, explore: bool) -> Vector:
        """Returns an action in [-1, 1], `action_size`.

        Args:
          observation: `observation_size`.
          explore: act as in training (Alg. 1, l. 7), or as the frozen policy does.
        """

    @abstractmethod
    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """Makes one step of all networks (Alg. 1, l. 14).

        Args:
          batch: transitions with their importance weights.
          reward: `batch`, the reward of each under the current dual variable.

        Raises:
          NotFinite: a loss is NaN or infinite.
        """

    @abstractmethod
    def _td_errors(self, batch: Batch, reward: Tensor) -> Tensor:
        """Returns y - Q_ψi(s, a), `critics x batch`; only Q has gradients."""

    @torch.no_grad()
    def td_errors(self, batch: Batch, reward: Tensor) -> Floats:
        """Returns |δ|, `batch`, mean over critics; arguments as for `update`."""
        return mean_magnitude(self._td_errors(batch, reward))

    def frozen(self) -> FrozenPolicy:
        """Returns a copy of the policy that neither explores nor learns."""
        layers = tuple(layer.copy() for layer in self._policy.layers())
        return FrozenPolicy(layers, self._action_size, self._policy.normalised)

    def state(self) -> dict[str, Any]:
        """Copies networks, optimisers and generator; tensors and plain values only."""
        states = {name: part.state_dict() for name, part in self.parts.items()}
        return copy.deepcopy(states | {"generator": self._generator.get_state()})

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`.

        Raises:
          CheckpointError: the state is of other networks; the agent must not be used any further.
        """
        state = copy.deepcopy(state)  # an optimiser would share its tensors
        with loading():
            for name, part in self.parts.items():
                part.load_state_dict(state[name])
            self._generator.set_state(state["generator"])


def check_device(field: str, device: str) -> None:
    """Refuses a device that is not there, with a ConfigError."""
    if device == "cuda" and not torch.cuda.is_available():
        raise ConfigError(field, "'cuda', and torch sees no CUDA device here", "'cpu'")


def td_target(reward: Tensor, terminated: Tensor, next_value: Tensor, discount: float) -> Tensor:
    """Target of the critics.

    y = r + γ (1 - terminated) V(s')

    Args:
      reward: `batch`, the reward to be maximised.
      terminated: `batch`, 1 where s' is terminal; 0 where only the time limit was reached.
      next_value: `batch`, V(s') by the target networks.
      discount: γ.

    Returns:
      `batch`.

    Source: Haarnoja et al. 2018, Eq. 2; Lillicrap et al. 2016, Alg. 1.
    """
    return reward + discount * (1.0 - terminated) * next_value


def critic_loss(td_errors: Tensor, weight: Tensor, kind: CriticLoss = "squared") -> Tensor:
    """Importance-weighted error of all critics.

    squared: J_Q = Σ_i E[w · ½ δ²],  δ = y - Q_ψi(s, a)
    huber:   the same where |δ| <= 1, else Σ_i E[w (|δ| - ½)]

    Args:
      td_errors: `critics x batch`, δ.
      weight: `batch`, importance weights of (10).
      kind: of the error.

    Source: Haarnoja et al. 2018, Eq. 5, times w of RISK-SAC, Eq. 10; Fujimoto et al., "An equivalence between loss
    functions and non-uniform sampling in experience replay", 2020, Sec. 5, without weights.
    """
    if kind == "huber":
        errors = functional.huber_loss(td_errors, torch.zeros_like(td_errors), reduction="none")
    else:
        errors = 0.5 * td_errors.square()
    return (weight * errors).mean(dim=1).sum()


def actor_weights(batch: Batch, *, weighted: bool) -> Tensor:
    """Weights of the policy's loss, `batch`, 1 on average."""
    return batch.weight / batch.weight.mean() if weighted else torch.ones_like(batch.weight)


def mean_magnitude(td_errors: Tensor) -> Floats:
    """Returns |δ| for the replay, `batch`, from errors of `critics x batch`."""
    return td_errors.abs().mean(dim=0).double().cpu().numpy()


def all_finite(figures: list[float]) -> list[float]:
    """Returns the figures of an update if all are finite.

    Raises:
      NotFinite: one is NaN or infinite.
    """
    if not all(map(math.isfinite, figures)):
        raise NotFinite(
            f"the losses and what goes with them are {figures}; wanted finite numbers. Lower the learning rates of"
            " learner.agent or the weights of learner.reward."
        )
    return figures


def minimise(loss: Tensor, optimizer: Adam) -> None:
    """Makes one optimiser step; only the optimiser's parameters receive a gradient."""
    parameters = [each for group in optimizer.param_groups for each in group["params"]]
    for parameter, gradient in zip(parameters, torch.autograd.grad(loss, parameters), strict=True):
        parameter.grad = gradient
    optimizer.step()


@torch.no_grad()
def follow(targets: nn.Module, networks: nn.Module, rate: float) -> None:
    """Moves targets towards networks: ψ̄ ← ψ̄ + τ (ψ - ψ̄)."""
    torch._foreach_lerp_(list(targets.parameters()), list(networks.parameters()), rate)


@contextmanager
def loading() -> Iterator[None]:
    """Turns torch's errors about a misfitting state into a CheckpointError."""
    try:
        yield
    except (KeyError, RuntimeError, ValueError) as error:
        raise CheckpointError(
            f"agent in the checkpoint does not fit: {error}. Resume with the learner.agent.hidden_sizes of the run"
            " that wrote it."
        ) from error
