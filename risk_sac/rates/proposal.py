"""Mixture that importance sampling draws from, fitted to earlier draws.

q(z) = 0.1 N(0, I) + 0.2 N(0, 2² I) + 0.7 Σ_k π_k N(μ_k, Σ_k), in standard normal space

The first term is the declared distribution itself, so that no weight p/q exceeds 10.

Source: Hesterberg 1995, Weighted average importance sampling and defensive mixture distributions; Kurtz and Song
2013, Cross-entropy-based adaptive importance sampling using Gaussian mixture. Shares and levels are choices.

Each stage draws from a proposal that is fitted to the draws before it. A draw counts with the proposal that it was
drawn from, w(z) = a_s p(z) / q_s(z). The mixture of all proposals would vary less, but those fitted to a draw are
denser around it, which biases such weights downwards.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from risk_sac.world.types import Floats

DECLARED, WIDE = 0.1, 0.2  # shares of the mixture
WIDE_DEVIATION = 2.0
MOST_COMPONENTS = 8
PER_COMPONENT = 3  # elite draws for each component and dimension
INFLATION = 1.3  # of a component's variance, since few draws understate it
ELITE = 0.25  # share of the latest draws that a proposal is fitted to until so many fail
ROUNDS = 30  # of EM
TEMPER = 0.5  # exponent of the weights that a proposal is fitted with, so that few draws do not decide it
FARTHEST = 6.0  # of a coordinate; beyond it lie 2e-9 of a normal distribution, and doubles lose its shares
_LOG_2PI = float(np.log(2 * np.pi))


@dataclass(frozen=True)
class Gaussians:
    """A mixture of `k` Gaussians."""

    weights: Floats  # `k`, sums to 1
    means: Floats  # `k x d`
    factors: Floats  # `k x d x d`, lower Cholesky factors of the covariances

    def log_density(self, points: Floats) -> Floats:
        """The mixture's log density, `n`, at points, `n x d`."""
        return _log_sum_exp(self.log_parts(points))

    def log_parts(self, points: Floats) -> Floats:
        """Each component's log density times its weight, `n x k`."""
        offsets = points[None] - self.means[:, None]  # k x n x d
        solved = np.linalg.solve(self.factors, offsets.transpose(0, 2, 1))  # k x d x n
        logs = np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        constant = np.log(self.weights) - logs - 0.5 * points.shape[1] * _LOG_2PI
        parts: Floats = (constant[:, None] - 0.5 * (solved**2).sum(axis=1)).T
        return parts

    def draw(self, random: np.random.Generator) -> Floats:
        """One point, `d`, within `FARTHEST`."""
        number = random.choice(len(self.weights), p=self.weights)
        point = self.means[number] + self.factors[number] @ random.standard_normal(self.means.shape[1])
        within: Floats = np.clip(point, -FARTHEST, FARTHEST)
        return within


def log_normal(points: Floats) -> Floats:
    """Log density, `n`, of the standard normal at points, `n x d`."""
    density: Floats = -0.5 * ((points**2).sum(axis=-1) + points.shape[-1] * _LOG_2PI)
    return density


def defensive(dimension: int, fitted: Gaussians | None = None) -> Gaussians:
    """Returns the proposal; the declared and wide components alone without fitted ones."""
    shares = np.array([DECLARED, WIDE])
    means = np.zeros((2, dimension))
    factors = np.stack([np.eye(dimension), WIDE_DEVIATION * np.eye(dimension)])
    if fitted is None:
        return Gaussians(shares / shares.sum(), means, factors)
    return Gaussians(
        np.concatenate([shares, (1 - shares.sum()) * fitted.weights]),
        np.concatenate([means, fitted.means]),
        np.concatenate([factors, fitted.factors]),
    )


def elite(margins: Floats, failed: np.typing.NDArray[np.bool_], latest: int) -> np.typing.NDArray[np.bool_]:
    """Selects the draws to fit, `n`: failures, and the nearest while few.

    Args:
      margins: `n x r`, of all draws and each requirement; inf where nothing is known.
      failed: `n`.
      latest: number of draws of the latest stage, at the end.
    """
    if failed[-latest:].sum() >= ELITE * latest:
        return failed
    known = margins[-latest:][np.isfinite(margins[-latest:]).all(axis=1)]
    if not len(known):
        return failed
    level = np.quantile(known, ELITE / max(margins.shape[1], 1), axis=0)
    return np.asarray(failed | (margins < level).any(axis=1))


def around(points: Floats, random: np.random.Generator) -> Gaussians | None:
    """Fits Gaussians to bare points, `n x d`; None without any.

    The likelier a point, the more it weighs. Up to `d` points have a Gaussian of unit covariance each.
    """
    size, dimension = points.shape
    if not size or not dimension:
        return None
    likely = log_normal(points)
    fitted = fit(points, np.exp(TEMPER * (likely - likely.max())), random)
    return fitted or Gaussians(np.full(size, 1 / size), points, np.stack([np.eye(dimension)] * size))


def fit(points: Floats, weights: Floats, random: np.random.Generator) -> Gaussians | None:
    """Fits Gaussians to weighted points by EM; None if at most `d`.

    Args:
      points: `n x d`.
      weights: `n`, of the declared distribution over the one that they were drawn from.
      random: chooses the first centres.
    """
    size, dimension = points.shape
    if not dimension or size <= dimension or not weights.sum() > 0:
        return None
    count = int(np.clip(size // (PER_COMPONENT * dimension), 1, MOST_COMPONENTS))
    share = weights / weights.sum()
    means = _centres(points, share, count, random)
    spread = np.cov(points.T, aweights=share, bias=True).reshape(dimension, dimension) + 0.05 * np.eye(dimension)
    mixture = Gaussians(
        np.full(count, 1 / count), means, np.stack([np.linalg.cholesky(spread / count ** (2 / dimension))] * count)
    )
    for _ in range(ROUNDS):
        parts = mixture.log_parts(points)
        taken = np.exp(parts - _log_sum_exp(parts)[:, None]) * share[:, None]  # n x k
        mass = taken.sum(axis=0) + 1e-12
        means = taken.T @ points / mass[:, None]
        covariances = np.empty((count, dimension, dimension))
        for k in range(count):
            offsets = points - means[k]
            effective = mass[k] ** 2 / max(float((taken[:, k] ** 2).sum()), 1e-300)
            scatter = (taken[:, k, None] * offsets).T @ offsets / mass[k]
            # Shrunk towards a unit covariance of few draws: `d + 1` draws count as much as those that there are.
            pull = (dimension + 1) / (dimension + 1 + effective)
            covariances[k] = (1 - pull) * scatter + pull * np.eye(dimension)
        factors: Floats = np.linalg.cholesky(covariances).astype(np.float64)
        mixture = Gaussians(mass / mass.sum(), means, factors)
    return Gaussians(mixture.weights, mixture.means, mixture.factors * np.sqrt(INFLATION))


def _centres(points: Floats, share: Floats, count: int, random: np.random.Generator) -> Floats:
    """First centres, `count x d`: far from each other (k-means++)."""
    chosen = [points[random.choice(len(points), p=share)]]
    for _ in range(count - 1):
        distances = np.min([((points - centre) ** 2).sum(axis=1) for centre in chosen], axis=0) * share
        total = distances.sum()
        chosen.append(points[random.choice(len(points), p=distances / total if total > 0 else share)])
    return np.array(chosen)


def _log_sum_exp(parts: Floats) -> Floats:
    """Log Σ_k exp of `n x k`, `n`."""
    most = parts.max(axis=1)
    total: Floats = most + np.log(np.exp(parts - most[:, None]).sum(axis=1))
    return total


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
    """Returns the number of draws per stage; fewer than ten are one."""
    early = int(draws * EARLY_SHARE)
    return (*[early] * EARLY, draws - EARLY * early) if early else (draws,)


class Stages:
    """Proposals of the stages, each fitted to the draws before it.

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
        """Draws a point, `d`; the same for equal seed and earlier draws.

        Args:
          number: of the draw, from 0.
          known: gives the draws before it; called where a new stage begins.
        """
        stage = self._stage(number)
        if stage >= len(self._proposals):
            self._fit(stage, known())
        return self._proposals[stage].draw(np.random.default_rng((self._seed, number)))

    def start(self, number: int) -> int:
        """Returns the first draw of the stage that a draw belongs to."""
        stage = self._stage(number)
        return self._ends[stage - 1] if stage else 0

    def ratios(self, known: Draws) -> Floats:
        """Computes p(z) / q_s(z), `n`, of the draws by their stages' proposals."""
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
        """Returns a draw's stage, from 0, at most the last one."""
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
