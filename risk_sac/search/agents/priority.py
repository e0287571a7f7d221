"""Risk-prioritised replay: priorities, a sum tree and importance weights."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from risk_sac.config.learner import ReplayConfig
from risk_sac.world.jit import compiled
from risk_sac.world.types import Floats

Indices = NDArray[np.int64]


class SumTree:
    """Binary tree of priorities; a node holds the sum of its children.

    The leaves hold the priorities. A node above a changed leaf is summed again from its children, in double precision,
    so rounding never accumulates.
    """

    def __init__(self, capacity: int) -> None:
        self._first = 1 << max(capacity - 1, 0).bit_length()  # of the leaves; the root is node 1
        self._nodes = np.zeros(2 * self._first)
        self._leaves = self._nodes[self._first :]  # a view

    @property
    def total(self) -> float:
        """Sum of all priorities."""
        return float(self._nodes[1])

    def __getitem__(self, indices: Indices) -> Floats:
        return self._leaves[indices]

    def set(self, indices: Indices, priorities: Floats) -> None:
        """Overwrite priorities; of a repeated index the last value holds.

        Args:
          indices: `n`, each in [0, capacity).
          priorities: `n`, at least 0 and finite.
        """
        _set(self._nodes, self._first, indices, priorities)

    def rebuild(self, priorities: Floats) -> None:
        """Set leaves 0 to n - 1 and zero the rest.

        Args:
          priorities: `n`, at most the capacity.
        """
        self._leaves[: len(priorities)] = priorities
        self._leaves[len(priorities) :] = 0.0
        _sum(self._nodes, self._first)

    def find(self, fractions: Floats) -> Indices:
        """Finds leaves where cumulative priority first exceeds these fractions of the total.

        A leaf of priority 0 is never returned. The total must be positive.

        Args:
          fractions: `n`, in [0, 1).

        Returns:
          `n` leaf indices.
        """
        return _find(self._nodes, self._first, fractions)


@compiled
def _set(nodes: Floats, first: int, indices: Indices, priorities: Floats) -> None:
    for i in range(len(indices)):
        node = first + indices[i]
        nodes[node] = priorities[i]
        while node > 1:
            node //= 2
            nodes[node] = nodes[2 * node] + nodes[2 * node + 1]


@compiled
def _sum(nodes: Floats, first: int) -> None:
    for node in range(first - 1, 0, -1):
        nodes[node] = nodes[2 * node] + nodes[2 * node + 1]


@compiled
def _find(nodes: Floats, first: int, fractions: Floats) -> Indices:
    # All descend together, level by level: the processor waits for many nodes of the tree at once.
    prefix = fractions * nodes[1]
    positions = np.ones(len(fractions), np.int64)
    level = 1
    while level < first:
        for i in range(len(positions)):
            left = 2 * positions[i]
            # Rounding may lift the prefix to the end of both children: an empty one is never entered.
            goes_right = np.int64((prefix[i] >= nodes[left]) & (nodes[left + 1] > 0.0))
            prefix[i] -= goes_right * nodes[left]
            positions[i] = left + goes_right
        level *= 2
    return positions - first


# No term counts for more than ten average ones, so that one outlier cannot fill the batch.
TERM_CAP = 10.0


@dataclass(frozen=True, slots=True)
class TermScales:
    """Affine map of each term of (9) to a common scale.

    Choice: a term x becomes (x - min x) / (mean x - min x), clipped to [0, 10]. It is then never negative
    and 1 on average, so w1 : w2 : w3 are the shares of all sampling that the three terms decide. A term
    that is the same for all transitions tells them apart in nothing and becomes 0.
    """

    lowest: Floats  # 3
    inverse_spread: Floats  # 3; 0 for a constant term

    @classmethod
    def of(cls, terms: Floats) -> Self:
        """Returns scales of the stored terms, `3 x n`, n ≥ 1."""
        lowest = terms.min(axis=1)
        spread = terms.mean(axis=1) - lowest
        # Rounding in the mean of equal numbers is no spread.
        real = spread > 1e-9 * np.maximum(1.0, np.abs(lowest))
        return cls(lowest, np.divide(1.0, spread, out=np.zeros_like(spread), where=real))


def priority(terms: Floats, scales: TermScales, config: ReplayConfig) -> Floats:
    """Priorities of transitions.

    p_i = max(ε, w1 |δ_i| + w2 R̂_i + w3 (-ρ_i)), each term on its common scale             (9)

    Deviation: the paper adds raw terms, which differ in scale and can be negative, and has no floor ε.

    Args:
      terms: `3 x n`: |δ|, R̂ and -ρ(Φ, s), as measured.
      scales: their common scale.
      config: w1, w2, w3 and ε.

    Returns:
      `n`, at least ε > 0.
    """
    weights = config.td_weight, config.return_weight, config.robustness_weight
    return _priorities(terms, scales.lowest, scales.inverse_spread, weights, config.priority_floor)


@compiled
def _priorities(
    terms: Floats, lowest: Floats, inverse_spread: Floats, weights: tuple[float, float, float], floor: float
) -> Floats:
    # A loop: of a batch, numpy's dozen calls cost more than what they do.
    priorities = np.empty(terms.shape[1])
    for i in range(len(priorities)):
        weighted = 0.0
        for term in range(len(weights)):
            scaled = (terms[term, i] - lowest[term]) * inverse_spread[term]
            weighted += weights[term] * min(max(scaled, 0.0), TERM_CAP)
        priorities[i] = max(weighted, floor)
    return priorities


def importance_weights(probabilities: Floats, size: int, correction: float) -> Floats:
    """Importance weights of sampled transitions.

    w_i = (1 / (N P(i)))^η / max_j w_j                                                (10)

    Deviation: divided by the largest weight of the batch, so that weights only ever shorten a step.

    Args:
      probabilities: P(i) > 0 of the sampled transitions, `n`.
      size: N, transitions stored.
      correction: η in [0, 1].

    Returns:
      `n`, in (0, 1].
    """
    weights = (size * probabilities) ** -correction
    return np.asarray(weights / weights.max(), np.float64)
