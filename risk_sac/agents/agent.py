"""What the learner needs of an actor-critic agent, whichever algorithm it runs."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol

from torch import Tensor

from risk_sac.agents.replay import Batch
from risk_sac.errors import CheckpointError, NotFinite
from risk_sac.frozen_policy import FrozenPolicy
from risk_sac.types import Floats, Vector


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdateResult:
    """What one update of all networks found out."""

    td_errors: Floats  # batch; |δ|, mean over the critics
    critic_loss: float
    actor_loss: float
    temperature: float  # α after the update; 0 for an agent without
    entropy: float  # of the policy over the batch, nats; 0 for a deterministic one


class Agent(Protocol):
    """Policy and critics."""

    @property
    def temperature(self) -> float:
        """α; 0 for an agent without."""

    def act(self, observation: Vector, explore: bool) -> Vector:
        """Action in [-1, 1], `action_size`.

        Args:
          observation: `observation_size`.
          explore: act as in training (Alg. 1, l. 7), or as the frozen policy does.
        """

    def frozen(self) -> FrozenPolicy:
        """What acts as this agent does without exploring, and learns no more."""

    def td_errors(self, batch: Batch, reward: Tensor) -> Floats:
        """|δ| of transitions, `batch`, mean over the critics; arguments as for `update`."""

    def update(self, batch: Batch, reward: Tensor) -> UpdateResult:
        """One step of all networks (Alg. 1, l. 14).

        Args:
          batch: transitions with their importance weights.
          reward: `batch`, the reward of each under the current dual variable.

        Raises:
          NotFinite: a loss is NaN or infinite.
        """

    def state(self) -> dict[str, Any]:
        """Networks, optimisers and generator, copied; tensors and plain values only."""

    def load(self, state: dict[str, Any]) -> None:
        """Continue from `state()`.

        Raises:
          CheckpointError: the state is of other networks; the agent is not to be used any further.
        """


def mean_magnitude(td_errors: Tensor) -> Floats:
    """|δ| as the replay takes it, `batch`, from those of each critic, `critics x batch`."""
    return td_errors.abs().mean(dim=0).double().cpu().numpy()


def all_finite(figures: list[float]) -> list[float]:
    """The figures of an update, once they have been found sound.

    Raises:
      NotFinite: one is NaN or infinite.
    """
    if not all(map(math.isfinite, figures)):
        raise NotFinite(
            f"the losses and what goes with them are {figures}; wanted finite numbers. Lower the learning rates of"
            " learner.agent or the weights of learner.reward."
        )
    return figures


@contextmanager
def loading() -> Iterator[None]:
    """Turns what torch says of a state that does not fit into a CheckpointError."""
    try:
        yield
    except (KeyError, RuntimeError, ValueError) as error:
        raise CheckpointError(
            f"agent in the checkpoint does not fit: {error}. Resume with the learner.agent.hidden_sizes of the run"
            " that wrote it."
        ) from error
