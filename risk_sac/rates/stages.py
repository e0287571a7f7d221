"""Stages of importance sampling: each draws from a proposal that is fitted to the draws before it."""

from collections.abc import Callable, Sequence
from itertools import accumulate

import numpy as np

from risk_sac.rates.proposal import Gaussians, defensive, elite, fit, log_normal
from risk_sac.world.types import Floats

EARLY = 5  # stages before the last one, each of a tenth of the draws
EARLY_SHARE = 0.1


def stage_sizes(draws: int) -> tuple[int, ...]:
    """Number of draws of each stage; the last one has at least half of all."""
    early = int(draws * EARLY_SHARE)
    return (*[early] * EARLY, draws - EARLY * early) if early else (draws,)


class Stages:
    """Proposals of the stages, fitted in turn.

    Attributes:
      sizes: draws of each stage.
    """

    def __init__(self, dimension: int, draws: int, seed: int) -> None:
        self.sizes = stage_sizes(draws)
        self._ends = tuple(accumulate(self.sizes))
        self._dimension, self._seed = dimension, seed
        self._proposals: list[Gaussians] = [defensive(dimension)]

    def stage_of(self, number: int) -> int:
        """The stage of a draw, from 0; draws beyond the last one belong to the last stage."""
        return next((stage for stage, end in enumerate(self._ends) if number < end), len(self.sizes) - 1)

    def draw(self, number: int, points: Sequence[Floats], margins: Sequence[float]) -> Floats:
        """The point of a draw, `d`, given all points and margins before it; the same seed gives the same one."""
        return self._proposal(self.stage_of(number), points, margins).draw(np.random.default_rng((self._seed, number)))

    def weights(self, points: Floats, margins: Floats) -> Floats:
        """Weights of the draws so far, `n`, by the balance heuristic.

        w(z) = p(z) / Σ_s (n_s / n) q_s(z)

        Source: Veach and Guibas 1995, Optimally combining sampling techniques for Monte Carlo rendering.
        """
        return self._balanced(points, margins, self.stage_of(len(points) - 1))

    def _balanced(self, points: Floats, margins: Floats, last: int) -> Floats:
        drawn = np.diff(np.minimum((0, *self._ends[: last + 1]), len(points)))
        drawn[-1] += len(points) - drawn.sum()
        logs = np.stack([self._proposal(s, points, margins).log_density(points) for s in range(last + 1)], axis=1)
        with np.errstate(divide="ignore"):
            parts = logs + np.log(drawn / len(points))
        most = parts.max(axis=1)
        weights: Floats = np.exp(log_normal(points) - most) / np.exp(parts - most[:, None]).sum(axis=1)
        return weights

    def _proposal(self, stage: int, points: Sequence[Floats] | Floats, margins: Sequence[float] | Floats) -> Gaussians:
        while len(self._proposals) <= stage:
            following = len(self._proposals)
            end = self._ends[following - 1]
            drawn, known = np.array(points[:end]).reshape(end, -1), np.array(margins[:end])
            weights = self._balanced(drawn, known, following - 1)
            chosen = elite(known, self.sizes[following - 1])
            random = np.random.default_rng((self._seed, following, 1))
            self._proposals.append(defensive(self._dimension, fit(drawn[chosen], weights[chosen], random)))
        return self._proposals[stage]


Margin = Callable[[Floats], float]
