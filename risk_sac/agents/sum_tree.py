"""Exact sum tree for drawing indices in proportion to their priorities."""

import numpy as np
import torch
from numpy.typing import NDArray

from risk_sac.types import Floats

Indices = NDArray[np.int64]

# A binary tree needs 17 dependent numpy calls per direction at 100,000 leaves. Two levels need one scan of
# the block sums and one of a block's leaves; 32 balances the two for 10,000 to 1,000,000 leaves.
BLOCK = 32


class SumTree:
    """Priorities at the leaves, sums of 32 leaves above them, the total at the root.

    Every operation is vectorised over its indices and in double precision. A changed leaf's block is
    summed anew from its leaves, and the root from its blocks, so rounding never accumulates.
    """

    def __init__(self, capacity: int) -> None:
        blocks = -(-capacity // BLOCK)
        self._leaves = np.zeros((blocks, BLOCK))
        self._flat = self._leaves.reshape(-1)  # a view
        self._block_sums = np.zeros(blocks)
        self._ends = np.zeros(blocks + 1)  # scratch: 0, then the cumulative block sums
        # Torch scans three to eight times as fast as numpy; these share memory with the arrays above.
        self._sums_view = torch.from_numpy(self._block_sums)
        self._ends_view = torch.from_numpy(self._ends)[1:]

    @property
    def total(self) -> float:
        """Sum of all priorities."""
        return float(self._block_sums.sum())

    def __getitem__(self, indices: Indices) -> Floats:
        return self._flat[indices]

    def set(self, indices: Indices, priorities: Floats) -> None:
        """Overwrite priorities; of a repeated index the last value holds.

        Args:
          indices: `n`, each in [0, capacity).
          priorities: `n`, at least 0 and finite.
        """
        self._flat[indices] = priorities
        blocks = indices // BLOCK
        self._block_sums[blocks] = self._leaves[blocks].sum(axis=1)

    def rebuild(self, priorities: Floats) -> None:
        """Set leaves 0 to n - 1 and zero the rest.

        Args:
          priorities: `n`, at most the capacity.
        """
        self._flat[: len(priorities)] = priorities
        self._flat[len(priorities) :] = 0.0
        self._block_sums[:] = self._leaves.sum(axis=1)

    def find(self, fractions: Floats) -> Indices:
        """The leaves at which the cumulative priority first exceeds the given fractions of the total.

        A leaf of priority 0 is never returned. The total must be positive.

        Args:
          fractions: `n`, in [0, 1).

        Returns:
          `n` leaf indices.
        """
        torch.cumsum(self._sums_view, 0, out=self._ends_view)
        ends = self._ends
        # Rounding may lift a prefix to its end; just below it, the search stops at a positive priority.
        prefixes = np.minimum(fractions * ends[-1], np.nextafter(ends[-1], 0.0))
        blocks = ends[1:].searchsorted(prefixes, side="right")
        leaf_ends = torch.cumsum(torch.from_numpy(self._leaves.take(blocks, axis=0)), 1).numpy()  # n x BLOCK
        within = np.minimum(prefixes - ends[blocks], np.nextafter(leaf_ends[:, -1], 0.0))
        found: Indices = blocks * BLOCK + (leaf_ends > within[:, None]).argmax(axis=1)
        return found
