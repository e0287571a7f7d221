"""Bayesian optimisation of scenes with BoTorch."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.search.encounter import Encounter
from risk_sac.search.scene_optimizer.archive import DiscountedBandit
from risk_sac.search.scene_optimizer.base import SceneOptimizer, State, objective, sobol_points
from risk_sac.world.types import Floats

REFIT_SHARE = 5  # a new fit is due once this part of the kept observations is new
ANYWHERE, NEAR = 0, 1  # arms of the bandit
BEST = 8  # scenes that one is looked for near to
NEAR_CANDIDATES, NEAR_DEVIATIONS = 64, (0.02, 0.05, 0.1)
CHANGED = 10  # coordinates that differ from the best scene's, on average


class BotorchOptimizer(SceneOptimizer):
    """Sobol scenes, then those of largest log expected improvement (Gaussian process).

    Choice: the policy changes under the optimiser, so only the newest `config.window` observations are kept, and a
    share `config.exploration` of scenes is drawn at random.

    Choice: in 18 dimensions a smooth model does not tell the few scenes around a failure from noise. So some scenes are
    small steps from one of the best, the one of largest posterior mean. A bandit chooses between these and expected
    improvement anywhere by the scores of each.
    Source: Eriksson et al. 2019, Scalable global optimization via local Bayesian optimization; the bandit is ours.

    Every random number of an ask derives from the seed and the number of asks, so the generator has no state to save.
    """

    tries = 5  # each is an optimisation
    kind = "botorch"

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:  # Alg. 1, l. 1
        super().__init__(dimension, config, seed)
        self._points: Floats = np.empty((0, dimension))  # n x d, oldest first, n <= window
        self._returns: Floats = np.empty(0)  # n, R̄_e; NaN = rejected
        self._asked, self._told, self._filled = 0, 0, 0  # filled: Sobol scenes so far
        self._fitted_at = 0  # value of _told at the last refit
        self._hyperparameters: dict[str, Any] | None = None
        self._bandit = DiscountedBandit(discount=0.95, prior_worth=0.25, prior_cost=5.0, least=0.05)
        self._arm: int | None = None  # that proposed the scene which is out

    def ask(self) -> Floats:  # Alg. 1, l. 4
        """See `SceneOptimizer.ask`."""
        random = np.random.default_rng((self._seed, self._asked))
        self._asked += 1
        if self._told < self._config.initial_scenes:
            return self._fill()
        if random.random() < self._config.exploration:
            return random.random(self._dimension)
        values = -self.scores()  # f_e is minimised; this is the only change of its sign
        if np.ptp(values) == 0:  # nothing tells the scenes apart yet, so keep filling the space
            return self._fill()
        return self._propose(values, random)

    @property
    def origin(self) -> Mapping[str, Any]:
        """See `SceneOptimizer.origin`: the arm."""
        return {"arm": self._arm}

    @origin.setter
    def origin(self, origin: Mapping[str, Any]) -> None:
        self._arm = origin.get("arm")

    def _learn(  # Alg. 1, l. 21-22
        self, point: Floats, mean_return: float | None, score: float | None, encounter: Encounter
    ) -> None:
        value = np.nan if mean_return is None else mean_return
        self._points = np.concatenate((self._points, point[None]))[-self._config.window :]
        self._returns = np.append(self._returns, value)[-self._config.window :]
        self._told += 1
        if self._arm is not None:
            self._bandit.tell(self._arm, 0.0 if score is None else max(0.0, 1.0 - score))
            self._arm = None

    def scores(self) -> Floats:
        """Returns f_e of every kept observation, oldest first, `n`.

        M̄_e moves, so all are computed against the current one. Choice: a rejected scene counts as bad as the worst
        scored one (1 if there is none). So the model learns to avoid C_hard without the cliff in f that a fixed large
        penalty would fit.
        """
        scores = objective(self._returns, self._maximum.smoothed)
        rejected = np.isnan(scores)
        worst = scores[~rejected].max() if not rejected.all() else 1.0
        return np.where(rejected, worst, scores)

    def _fill(self) -> Floats:
        self._filled += 1
        return sobol_points(self._dimension, self._seed, self._filled - 1)[0].numpy()

    def _propose(self, values: Floats, random: np.random.Generator) -> Floats:
        # Here, because loading them takes seconds, and the first scenes need no model.
        import torch

        from risk_sac.search.scene_optimizer.gaussian_process import (
            believe,
            best_by_mean,
            condition,
            fit,
            maximise_expected_improvement,
        )

        points, targets, seed = torch.from_numpy(self._points), torch.from_numpy(values), int(random.integers(2**31))
        # Each observation changes the fit less as they accumulate, while a fit's price grows with them.
        due = max(self._config.refit_every, len(values) // REFIT_SHARE)
        if self._hyperparameters is None or self._told - self._fitted_at >= due:
            self._hyperparameters = fit(points, targets, self._hyperparameters, seed)
            self._fitted_at = self._told
        model = condition(points, targets, self._hyperparameters)
        if len(self.out):
            model = believe(model, points, targets, torch.from_numpy(np.array(self.out)), self._hyperparameters)
        self._arm = NEAR if random.random() < self._bandit.probability else ANYWHERE
        near = torch.from_numpy(self._steps_from_one_of_the_best(values, random))
        if self._arm == NEAR:
            return best_by_mean(model, near).numpy()
        anywhere = sobol_points(self._dimension, seed, count=self._config.candidates)
        return maximise_expected_improvement(model, torch.cat((anywhere, near))).numpy()

    def _steps_from_one_of_the_best(self, values: Floats, random: np.random.Generator) -> Floats:
        """Takes sparse Gaussian steps from a best scene, `NEAR_CANDIDATES x d`."""
        best = np.argsort(-values, kind="stable")[:BEST]
        centre = self._points[best[random.integers(len(best), size=2).min()]]  # the better, the likelier
        step = random.choice(NEAR_DEVIATIONS) * random.standard_normal((NEAR_CANDIDATES, self._dimension))
        changed = random.random(step.shape) < CHANGED / self._dimension
        nearby: Floats = np.clip(centre + np.where(changed, step, 0.0), 0.0, 1.0)
        return nearby

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {
            **super().state(),
            "points": self._points.copy(),
            "returns": self._returns.copy(),
            "asked": self._asked,
            "told": self._told,
            "filled": self._filled,
            "fitted_at": self._fitted_at,
            "hyperparameters": self._hyperparameters,
            "bandit": self._bandit.state(),
        }

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load(state)
        self._points, self._returns = np.array(state["points"]), np.array(state["returns"])  # once tensors
        self._asked, self._told, self._filled = state["asked"], state["told"], state["filled"]
        self._fitted_at = state["fitted_at"]
        self._hyperparameters = state["hyperparameters"]
        self._bandit.load(state["bandit"])
