"""Bayesian optimisation of scenes with BoTorch."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scene_optimizer.bandit import DiscountedBandit
from risk_sac.scene_optimizer.base import NOBODY, Encounter, State, check_identity, check_told
from risk_sac.scene_optimizer.objective import RunningMaximum, objective, update_running_maximum
from risk_sac.scene_optimizer.sobol import SobolSequence
from risk_sac.types import Floats

if TYPE_CHECKING:
    from risk_sac.scene_optimizer.surrogate import Hyperparameters

NEIGHBOURS = 64  # candidates around the best scenes; Sobol points alone are sparse in 12 dimensions
PARENTS = 4
REFIT_SHARE = 5  # a new fit is due once this part of the kept observations is new
DEVIATIONS = (0.1, 0.05, 0.025, 0.0125)  # of the steps to neighbours, one round after another
BEST = 8  # scenes that one is looked for near to
NEAR_DEVIATIONS = (0.02, 0.05, 0.1)
CHANGED = 10  # coordinates, of those near ones, on average


class BotorchOptimizer:
    """Sobol scenes first, then those of largest log expected improvement under a Gaussian process.

    Choice: the policy changes under the optimiser, so only the newest `config.window` observations are kept, and a
    share `config.exploration` of scenes is drawn at random. The acquisition is maximised by rounds of ever smaller
    Gaussian steps around its best candidates: they come within a few tenths of a nat of what gradient ascent reaches,
    at a fraction of its price. Near one of the best scenes the model's mean is maximised instead, over small steps from
    that one alone. A bandit chooses.

    Every random number of an ask derives from the seed and the number of asks, so the generator has no state to save
    and neither reads nor moves a global one.
    """

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:  # Alg. 1, l. 1
        self._identity: State = {"kind": "botorch", "dimension": dimension, "seed": seed}
        self._dimension = dimension
        self._config = config
        self._seed = seed
        self._sobol = SobolSequence(dimension, seed)
        self._points: Floats = np.empty((0, dimension))  # n x d, oldest first, n <= window
        self._returns: Floats = np.empty(0)  # n, R̄_e; NaN = rejected
        self._maximum: RunningMaximum | None = None
        self._asked = 0
        self._told = 0
        self._fitted_at = 0  # value of _told at the last refit
        self._hyperparameters: Hyperparameters | None = None
        self._reach = DiscountedBandit(discount=0.95, prior_worth=0.25, prior_cost=5.0, least=0.05)
        self._near: bool | None = None  # how the scene that is out was looked for, if the model proposed it

    def ask(self) -> Floats:  # Alg. 1, l. 4
        """See `SceneOptimizer.ask`."""
        random = np.random.default_rng((self._seed, self._asked))
        self._asked += 1
        if self._told < self._config.initial_scenes:
            return self._sobol.draw()[0].numpy()
        if random.random() < self._config.exploration:
            return random.random(self._dimension)
        values = self._values()
        if np.ptp(values) == 0:  # nothing tells the scenes apart yet, so keep filling the space
            return self._sobol.draw()[0].numpy()
        return self._propose(values, random)

    def tell(  # Alg. 1, l. 21-22
        self, u: Floats, mean_return: float | None, encounter: Encounter = NOBODY
    ) -> float | None:
        """See `SceneOptimizer.tell`."""
        point = check_told(u, mean_return, self._dimension)
        value = np.nan if mean_return is None else mean_return
        self._points = np.concatenate((self._points, point[None]))[-self._config.window :]
        self._returns = np.append(self._returns, value)[-self._config.window :]
        self._told += 1
        score = None
        if mean_return is not None:
            self._maximum = update_running_maximum(self._maximum, mean_return, self._config.running_maximum_rate)
            score = objective(mean_return, self._maximum.smoothed)
        if self._near is not None:
            self._reach.tell(int(self._near), 0.0 if score is None else max(0.0, 1.0 - score))
            self._near = None
        return score

    def scores(self) -> Floats:
        """f_e of every kept observation, oldest first, `n`.

        M̄_e moves, so all are recomputed against the current one. Choice: a rejected scene is stated to be as bad as
        the worst scored one (1 if there is none), so that the model learns to avoid C_hard without the cliff in f
        that a fixed large penalty would fit.
        """
        smoothed = 0.0 if self._maximum is None else self._maximum.smoothed
        scores = objective(self._returns, smoothed)
        rejected = np.isnan(scores)
        worst = scores[~rejected].max() if not rejected.all() else 1.0
        return np.where(rejected, worst, scores)

    def _values(self) -> Floats:
        return -self.scores()  # f_e is minimised; this is the only change of its sign

    def _propose(self, values: Floats, random: np.random.Generator) -> Floats:
        from risk_sac.scene_optimizer import surrogate  # here, because BoTorch is slow to load, and many runs need none

        points, targets = torch.from_numpy(self._points), torch.from_numpy(values)
        if self._hyperparameters is None or self._told - self._fitted_at >= self._refit_after():
            self._hyperparameters = surrogate.fit(points, targets, self._hyperparameters)
            self._fitted_at = self._told
        model = surrogate.condition(points, targets, self._hyperparameters)
        posterior = surrogate.Posterior(model)
        acquisition = posterior.log_expected_improvement
        self._near = bool(random.random() < self._reach.probability)
        if self._near:
            candidates = torch.from_numpy(self._steps_from_one_of_the_best(values, random))
            scores, _ = posterior(candidates)
        else:
            everywhere = SobolSequence(self._dimension, int(random.integers(2**31))).draw(self._config.candidates)
            candidates = torch.cat((everywhere, _neighbours(points, targets, DEVIATIONS[0], random)))
            scores = acquisition(candidates)
            for deviation in DEVIATIONS:
                near = _neighbours(candidates, scores, deviation, random)
                candidates, scores = torch.cat((candidates, near)), torch.cat((scores, acquisition(near)))
        proposal: Floats = candidates[scores.argmax()].numpy()
        return proposal

    def _steps_from_one_of_the_best(self, values: Floats, random: np.random.Generator) -> Floats:
        """Small Gaussian steps in some of the coordinates, `NEIGHBOURS x d`; the better a scene, the likelier it is."""
        best = np.argsort(-values, kind="stable")[:BEST]
        centre = self._points[best[random.integers(len(best), size=2).min()]]
        step = random.choice(NEAR_DEVIATIONS) * random.standard_normal((NEIGHBOURS, self._dimension))
        changed = random.random(step.shape) < CHANGED / self._dimension
        nearby: Floats = np.clip(centre + np.where(changed, step, 0.0), 0.0, 1.0)
        return nearby

    def _refit_after(self) -> int:
        # Each observation changes the fit less as they accumulate, while a fit's price grows with them.
        return max(self._config.refit_every, len(self._returns) // REFIT_SHARE)

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {
            **self._identity,
            "position": self._sobol.position,
            "points": torch.from_numpy(self._points.copy()),
            "returns": torch.from_numpy(self._returns.copy()),
            "maximum": None if self._maximum is None else tuple(self._maximum),
            "asked": self._asked,
            "told": self._told,
            "fitted_at": self._fitted_at,
            "hyperparameters": None if self._hyperparameters is None else dict(self._hyperparameters),
            "reach": self._reach.state(),
        }

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        check_identity(state, self._identity)
        self._sobol.seek(state["position"])
        self._points = state["points"].numpy().copy()
        self._returns = state["returns"].numpy().copy()
        self._maximum = None if state["maximum"] is None else RunningMaximum(*state["maximum"])
        self._asked, self._told, self._fitted_at = state["asked"], state["told"], state["fitted_at"]
        self._hyperparameters = None if state["hyperparameters"] is None else dict(state["hyperparameters"])
        if "reach" in state:  # older checkpoints have none
            self._reach.load(state["reach"])


def _neighbours(points: Tensor, scores: Tensor, deviation: float, random: np.random.Generator) -> Tensor:
    """Gaussian steps from the points of largest score, kept in the unit cube, `NEIGHBOURS x d`."""
    parents = points[scores.argsort(descending=True, stable=True)[:PARENTS]]
    parents = parents[torch.arange(NEIGHBOURS) % len(parents)]
    return (parents + deviation * torch.from_numpy(random.standard_normal(parents.shape))).clamp_(0.0, 1.0)
