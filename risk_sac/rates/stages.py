"""Stages of importance sampling: each draws from a proposal that is fitted to the draws before it.

A draw counts with the proposal that it was drawn from, w(z) = a_s p(z) / q_s(z). The mixture of all proposals would
vary less, but those fitted to a draw are denser around it, which biases such weights downwards.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from risk_sac.rates.proposal import TEMPER, around, defensive, elite, fit, log_normal
from risk_sac.world.types import Floats

EARLY = 5  # stages before the last one, each of a tenth of the draws, and so the last of half of them
EARLY_SHARE = 0.1


@dataclass(frozen=True)
class Draws:
    """Outcomes of the first draws.

    Attributes:
      points: `n x d`, in standard normal space.
      margins: `n x r`, of each requirement, smaller nearer to a failure; inf where nothing is known.
      failed: `n` of bool.
    """

    points: Floats
    margins: Floats
    failed: np.typing.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.points)

    def first(self, count: int) -> "Draws":
        """The first of them."""
        return Draws(self.points[:count], self.margins[:count], self.failed[:count])


def stage_sizes(draws: int) -> tuple[int, ...]:
    """Number of draws of each stage; fewer than ten draws are one stage."""
    early = int(draws * EARLY_SHARE)
    return (*[early] * EARLY, draws - EARLY * early) if early else (draws,)


class Stages:
    """Proposals of the stages, each fitted once the draws before it are there.

    Attributes:
      sizes: draws of each stage.
    """

    def __init__(self, dimension: int, draws: int, seed: int, earlier: Floats | None = None) -> None:
        """Prepares the first proposal.

        Args:
          dimension: `d`.
          draws: of the whole run.
          seed: of all draws.
          earlier: `n x d`, points that failed before this run. The first proposal is fitted to them; no estimate counts
            them.
        """
        self.sizes = stage_sizes(draws)
        self._ends = tuple(accumulate(self.sizes))
        self._dimension, self._seed = dimension, seed
        first = None if earlier is None else around(earlier, np.random.default_rng((seed, 0, 1)))
        self._proposals = [defensive(dimension, first)]

    def draw(self, number: int, known: Callable[[], Draws]) -> Floats:
        """The point of a draw, `d`; the same seed and earlier draws give the same one.

        Args:
          number: of the draw, from 0.
          known: gives the draws before it; called where a new stage begins.
        """
        stage = self._stage(number)
        if stage >= len(self._proposals):
            self._fit(stage, known())
        return self._proposals[stage].draw(np.random.default_rng((self._seed, number)))

    def start(self, number: int) -> int:
        """Returns the number of the first draw in the stage of a draw."""
        stage = self._stage(number)
        return self._ends[stage - 1] if stage else 0

    def ratios(self, known: Draws) -> Floats:
        """p(z) / q_s(z) of the draws so far, `n`, each with the proposal of its own stage."""
        ratios, stages = np.empty(len(known)), self._stages(len(known))
        for stage in np.unique(stages):
            drawn = known.points[stages == stage]
            self._fit(int(stage), known)
            density = self._proposals[stage].log_density(drawn)
            ratios[stages == stage] = np.exp(log_normal(drawn) - density)
        return ratios

    def trust(self, count: int) -> Floats:
        """a_s of each of so many draws, `n`, of mean 1.

        Choice: in proportion to the square root of the stage's number, since later proposals are better.
        """
        trust = np.sqrt(self._stages(count) + 1.0)
        return np.asarray(trust / trust.mean())

    def _stages(self, count: int) -> np.typing.NDArray[np.int_]:
        return np.array([self._stage(number) for number in range(count)], dtype=int)

    def _stage(self, number: int) -> int:
        """The stage of a draw, from 0; draws beyond the last one belong to the last stage."""
        return next((stage for stage, end in enumerate(self._ends) if number < end), len(self.sizes) - 1)

    def _fit(self, stage: int, known: Draws) -> None:
        """Fits the proposals up to a stage's, unless they are."""
        while len(self._proposals) <= stage:
            following = len(self._proposals)
            before = known.first(self._ends[following - 1])
            chosen = elite(before.margins, before.failed, self.sizes[following - 1])
            weights = self.ratios(before)[chosen] ** TEMPER
            fitted = fit(before.points[chosen], weights, np.random.default_rng((self._seed, following, 1)))
            self._proposals.append(defensive(self._dimension, fitted))


def draws_of(points: Sequence[Floats], margins: Sequence[Mapping[str, float]], failed: Sequence[bool]) -> Draws:
    """Stacks draws.

    Args:
      points: each `d`.
      margins: requirement → robustness of those that count; empty where nothing was played.
      failed: whether a valid violation made the episode a failure.
    """
    names = sorted({name for known in margins for name in known})
    rows = [[known.get(name, math.inf) for name in names] for known in margins]
    count = len(points)
    return Draws(
        np.array(points, dtype=np.float64).reshape(count, -1) if count else np.empty((0, 0)),
        np.array(rows, dtype=np.float64).reshape(count, len(names)),
        np.array(failed, dtype=bool),
    )
