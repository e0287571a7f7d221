"""Replay memory, uniform or risk-guided.

The reward is not stored: its parts are, so that the learner forms it with the current dual variable
when it samples.

Source: RISK-SAC, Sec. III-D and Alg. 1, l. 11-13.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from torch import Tensor

from risk_sac.config.learner import ReplayConfig
from risk_sac.errors import CheckpointError, NotFinite
from risk_sac.search.agents.priority import Indices, SumTree, TermScales, importance_weights, priority
from risk_sac.search.agents.transition import Transition
from risk_sac.world.types import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Sampled transitions; float32 tensors with `n` rows."""

    observation: Tensor  # n x observation_size
    action: Tensor  # n x action_size
    risk_reward: Tensor  # n
    cost: Tensor  # n
    robustness: Tensor  # n
    next_robustness: Tensor  # n
    next_observation: Tensor  # n x observation_size
    terminated: Tensor  # n, 0 or 1
    weight: Tensor  # n, importance weights in (0, 1]
    indices: Indices  # n, the slots they came from

    def on(self, device: str) -> "Batch":
        """Returns the same transitions on a device."""
        if device == "cpu":  # where they are sampled
            return self
        tensors = {f.name: getattr(self, f.name).to(device) for f in fields(self) if f.name != "indices"}
        return Batch(**tensors, indices=self.indices)


# Numbers of a transition, behind its vectors in a row.
SCALARS = ("risk_reward", "cost", "robustness", "next_robustness", "terminated")


class UniformReplay:
    """Ring buffer of transitions, drawn uniformly.

    A transition is one packed row, so that a batch is one gather.

    Every replay memory has these methods.
    """

    def __init__(self, observation_size: int, action_size: int, config: ReplayConfig) -> None:
        self._widths = [observation_size, action_size, observation_size, len(SCALARS)]
        self._rows = np.zeros((config.capacity, sum(self._widths)), np.float32)
        self._next = 0
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def add(self, transition: Transition) -> int:
        """Stores a transition, over the oldest when full; returns its slot."""
        scalars = [getattr(transition, name) for name in SCALARS]
        parts = (transition.observation, transition.action, transition.next_observation, scalars)
        row = np.concatenate(parts, dtype=np.float32)
        if not np.isfinite(row).all():
            raise NotFinite(f"wanted a transition of finite numbers, got {transition}. Check the environment.")
        slot = self._next
        self._rows[slot] = row
        self._next = (slot + 1) % len(self._rows)
        self._size = max(self._size, slot + 1)
        return slot

    def take_unmeasured(self, most: int) -> Batch | None:
        """Returns new transitions, oldest first, whose |δ| `update` needs before drawing.

        None once all were taken, or if |δ| makes no difference to what is drawn, as here.
        """
        return None

    def sample(self, batch_size: int, generator: np.random.Generator) -> Batch:
        """Draws with replacement from one or more transitions, all measured."""
        return self.gather(generator.integers(len(self), size=batch_size), np.ones(batch_size))

    def update(self, indices: Indices, td_errors: Floats) -> None:
        """Ignores the measured |δ|, which other memories use.

        Of a repeated index the last one holds.
        """

    def state(self) -> dict[str, Any]:
        """Returns what sampling depends on, filled part only: tensors and plain values."""
        return {"rows": torch.from_numpy(self._rows[: self._size].copy()), "next": self._next}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`; raises CheckpointError if it is of another shape."""
        rows = state["rows"].numpy()
        capacity, width = self._rows.shape
        if rows.shape[1] != width or len(rows) > capacity or not 0 <= state["next"] < capacity:
            raise CheckpointError(
                f"replay rows in the checkpoint are {rows.shape} with the next at {state['next']}; wanted at most"
                f" {self._rows.shape}. Resume with the sizes and replay.capacity of the run that wrote it."
            )
        self._size, self._next = len(rows), int(state["next"])
        self._rows[: self._size] = rows

    def newest(self, count: int) -> Indices:
        """Returns the slots of the newest transitions, oldest of them first."""
        return np.arange(self._next - count, self._next) % len(self._rows)

    def gather(self, indices: Indices, weight: Floats) -> Batch:
        """Returns the transitions at `indices`, with their importance weights."""
        rows = torch.from_numpy(self._rows.take(indices, axis=0))
        observation, action, next_observation, scalars = torch.split(rows, self._widths, dim=1)
        return Batch(
            observation=observation,
            action=action,
            next_observation=next_observation,
            weight=torch.from_numpy(weight.astype(np.float32)),
            indices=indices,
            **dict(zip(SCALARS, scalars.unbind(dim=1), strict=True)),
        )


class RiskPrioritizedReplay:
    """RPER: transitions are drawn in proportion to (9) and weighted by (10).

    The measured terms of (9) are kept for every transition, so each leaf of the tree equals (9) under the current
    scales once its |δ| is measured. The scales are taken from all stored terms again, and the tree is rebuilt, whenever
    the number of additions has doubled or grown by RESCALE_EVERY.

    Choice: |δ| is measured of all new transitions together, just before the next draw, the first that it can affect
    (the paper does it one by one at insertion).
    """

    # About 1 ms of work for 100,000 stored, spread over this many additions.
    RESCALE_EVERY = 1000

    def __init__(self, observation_size: int, action_size: int, config: ReplayConfig) -> None:
        self._config = config
        self._storage = UniformReplay(observation_size, action_size, config)
        self._terms = np.zeros((3, config.capacity))  # |δ|, R̂, -ρ
        self._tree = SumTree(config.capacity)
        self._scales = TermScales(np.zeros(3), np.zeros(3))
        self._additions = 0
        self._unmeasured = 0  # how many of the newest transitions lack |δ|
        self._rescale_at = 1

    def __len__(self) -> int:
        return len(self._storage)

    def add(self, transition: Transition) -> None:
        """Stores a transition; it is drawn once its |δ| is measured."""
        terms = (0.0, transition.accumulated_reward, -transition.robustness)
        if not np.isfinite(terms).all():
            raise NotFinite(f"R̂ and -ρ are {terms[1:]}; wanted finite numbers. Check the reward and the monitor.")
        self._terms[:, self._storage.add(transition)] = terms
        self._additions += 1
        self._unmeasured = min(self._unmeasured + 1, self._config.capacity)

    def take_unmeasured(self, most: int) -> Batch | None:
        """See `UniformReplay.take_unmeasured`; all importance weights are 1."""
        if not self._unmeasured:
            return None
        indices = self._storage.newest(self._unmeasured)[:most]
        self._unmeasured -= len(indices)
        return self._storage.gather(indices, np.ones(len(indices)))

    def sample(self, batch_size: int, generator: np.random.Generator) -> Batch:
        """Draws by priority, one transition per slice of `batch_size` equal ones.

        Choice: stratified, as Schaul et al. do; the expected count of a transition stays batch_size · P(i).
        """
        fractions = (np.arange(batch_size) + generator.random(batch_size)) / batch_size
        indices = self._tree.find(fractions)
        probabilities = self._tree[indices] / self._tree.total
        return self._storage.gather(indices, importance_weights(probabilities, len(self), self._config.correction))

    def update(self, indices: Indices, td_errors: Floats) -> None:
        """See `UniformReplay.update`."""
        if not np.isfinite(td_errors).all():
            raise NotFinite(f"|δ| are {td_errors}; wanted finite numbers. Lower the learning rates.")
        self._terms[0, indices] = td_errors
        if self._additions < self._rescale_at:
            self._tree.set(indices, priority(self._terms.take(indices, axis=1), self._scales, self._config))
            return
        self._rescale_at = self._additions + min(self._additions, self.RESCALE_EVERY)
        self._scales = TermScales.of(self._terms[:, : len(self)])
        self._rebuild()

    def state(self) -> dict[str, Any]:
        """See `UniformReplay.state`."""
        return {
            "storage": self._storage.state(),
            "terms": torch.from_numpy(self._terms[:, : len(self)].copy()),
            "lowest": torch.from_numpy(self._scales.lowest.copy()),
            "inverse_spread": torch.from_numpy(self._scales.inverse_spread.copy()),
            "additions": self._additions,
            "unmeasured": self._unmeasured,
            "rescale_at": self._rescale_at,
        }

    def load(self, state: dict[str, Any]) -> None:
        """See `UniformReplay.load`."""
        self._storage.load(state["storage"])
        self._terms[:, : len(self)] = state["terms"].numpy()
        self._scales = TermScales(state["lowest"].numpy(), state["inverse_spread"].numpy())
        self._additions = int(state["additions"])
        self._unmeasured = int(state["unmeasured"])
        self._rescale_at = int(state["rescale_at"])
        self._rebuild()

    def _rebuild(self) -> None:
        self._tree.rebuild(priority(self._terms[:, : len(self)], self._scales, self._config))
