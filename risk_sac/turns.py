"""Who makes the next episode of a search that two share: whoever yields more of late, for what it costs."""

import numpy as np

from risk_sac.records import Collision
from risk_sac.verdicts.distinct import DistinctFailures

NEW, NEW_PREVENTABLE = 1.0, 4.0  # what a distinct failure is worth, and one that is preventable besides
# Of what an earlier episode counts, after another one by the same searcher: scripts that find something in one episode
# of thirty may well go without for fifty, and must not be given up for that.
KEPT = 0.995
EXPECTED, EXPECTED_STEPS = 0.05, 1000.0  # worth per steps, of who has not been tried; as much as that is it believed
LEAST = 0.01  # of what is spent, for either; more would be lost on a policy that yields nothing


class Turns:
    """A bandit with two arms. Their yields are worth per step; the chances go by the yields' squares.

    So a learner begins to act often when what scripts find for the asking runs out, and not before. The same episodes
    told of in the same order lead to the same turns.
    """

    def __init__(self, costs: tuple[float, float], seed: int) -> None:
        """Begins without experience.

        Args:
          costs: of an environment step, of each searcher; only their ratio counts.
          seed: of the draws.
        """
        self._costs = costs
        self._random = np.random.default_rng(seed)
        self._worth, self._spent = [0.0, 0.0], [0.0, 0.0]
        self._found, self._preventable = DistinctFailures(), DistinctFailures()

    def next(self) -> int:
        """Whose turn it is, 0 or 1."""
        return int(self._random.random() < self.share)

    @property
    def share(self) -> float:
        """The chance of searcher 1, whose episodes are taken to be as long as the other's."""
        first, second = (
            ((worth + EXPECTED) / (spent + EXPECTED_STEPS)) ** 2
            for worth, spent in zip(self._worth, self._spent, strict=True)
        )
        return min(max(second / (first + second), self._chance_of(LEAST)), self._chance_of(1.0 - LEAST))

    def tell(self, searcher: int, steps: int, collision: Collision | None) -> None:
        """Takes note of an episode.

        Args:
          searcher: who made it.
          steps: of the environment.
          collision: how it ended.
        """
        worth = 0.0
        if collision is not None and collision.valid:
            worth += NEW * self._found.add(collision)
            if collision.preventable:
                worth += NEW_PREVENTABLE * self._preventable.add(collision)
        self._worth[searcher] = KEPT * self._worth[searcher] + worth
        self._spent[searcher] = KEPT * self._spent[searcher] + self._costs[searcher] * steps

    def _chance_of(self, spent: float) -> float:
        """The chance of searcher 1 that lets it spend this share."""
        first, second = self._costs
        return spent * first / (spent * first + (1.0 - spent) * second)
