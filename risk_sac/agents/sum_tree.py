"""Exact sum tree for drawing indices in proportion to their priorities."""

import numpy as np
from numpy.typing import NDArray

from risk_sac.jit import compiled
from risk_sac.types import Floats

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
        """The leaves at which the cumulative priority first exceeds the given fractions of the total.

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
    found = np.ones(len(fractions), np.int64)
    level = 1
    while level < first:
        for i in range(len(found)):
            left = 2 * found[i]
            # Rounding may lift the prefix to the end of both children: an empty one is never entered.
            goes_right = np.int64((prefix[i] >= nodes[left]) & (nodes[left + 1] > 0.0))
            prefix[i] -= goes_right * nodes[left]
            found[i] = left + goes_right
        level *= 2
    return found - first
