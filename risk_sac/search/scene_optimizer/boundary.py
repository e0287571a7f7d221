"""Proposes the scenes near an ego's boundary between passing and failing."""

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scenario.declared import Slice
from risk_sac.search.encounter import Encounter
from risk_sac.search.scene_optimizer.base import SceneOptimizer, State, sobol_points
from risk_sac.world.types import Bools, Floats

INITIAL = 6  # Sobol points for each parameter; choice
OF_EACH = 2  # outcomes of each class before the first classifier; choice
CANDIDATES = 1024  # Sobol points among which the most ambiguous one is chosen
DRIVER = "r157"  # reference driver whose boundary is sought beside the ego's
OF_DRIVER = 4  # every so many points are the driver's; choice


class BoundarySampler(SceneOptimizer):
    """Sampler of a slice's Sobol points, then a classifier's most ambiguous.

    Every `OF_DRIVER`th point is the most ambiguous one for R157's driver instead of the ego. A candidate whose nearest
    known neighbour was refused is left out. Where points are out, the ambiguity is what they leave.

    Source: straddle, Bryan et al. 2005, on the latent function of a Gaussian-process classifier.
    """

    kind = "boundary"
    tries = 0  # its candidates keep the constraints

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int, slice_: Slice) -> None:
        """Begins without an observation.

        Args:
          dimension: of the scene space.
          config: of scene optimizers.
          seed: of Sobol points and drawn parameters.
          slice_: in which the boundary is sought.
        """
        super().__init__(dimension, config, seed)
        self._slice = slice_
        axes = len(slice_.axes)
        self._points: Floats = np.empty((0, axes))  # n x k
        self._fails: list[bool | None] = []  # None: refused
        self._driver: list[bool | None] = []  # whether R157's driver fails; None: not known
        self._initial = INITIAL * axes
        self._asked, self._filled = 0, 0

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        random = np.random.default_rng((self._seed, self._asked))
        self._asked += 1
        of_driver = self._asked % OF_DRIVER == 0 and _both(self._driver)
        outcomes = self._driver if of_driver else self._fails
        if len(self._points) + len(self.out) < self._initial or not _both(outcomes):
            return self._fill(random)
        return self._whole(self._most_ambiguous(outcomes, int(random.integers(2**31))), random)

    def _fill(self, random: np.random.Generator) -> Floats:
        """Returns the next Sobol point, one that keeps the constraints if possible."""
        axes = self._points.shape[1]
        for _ in range(CANDIDATES):
            point = self._whole(sobol_points(axes, self._seed, self._filled)[0].numpy(), random)
            self._filled += 1
            if self._slice.space.allows(point):
                break
        return point

    def _most_ambiguous(self, outcomes: list[bool | None], seed: int) -> Floats:
        from risk_sac.search.level_set import FailureClassifier, straddle  # here: loading gpytorch takes a second

        known = np.array([outcome is not None for outcome in outcomes])
        fails = np.array([bool(outcome) for outcome in outcomes])
        candidates = sobol_points(self._points.shape[1], seed, count=CANDIDATES).numpy()
        candidates = candidates[self._likely_playable(candidates)]
        out = np.array(self.out).reshape(len(self.out), -1)[:, list(self._slice.columns)] if len(self.out) else None
        scores = straddle(FailureClassifier(self._points[known], fails[known]), candidates, out)
        return np.asarray(candidates[int(scores.argmax())])

    def _likely_playable(self, candidates: Floats) -> Bools:
        """Whether candidates keep the constraints and their nearest tried point was playable."""
        apart = ((candidates[:, None] - self._points[None]) ** 2).sum(axis=2).argmin(axis=1)
        played = np.array([fails is not None for fails in self._fails])[apart]
        if self._slice.space.holds is not None:
            middle = [self._whole(point, np.random.default_rng(self._seed)) for point in candidates]
            played &= np.array([self._slice.space.allows(point) for point in middle])
        return played if played.any() else np.ones(len(candidates), dtype=bool)

    def _whole(self, point: Floats, random: np.random.Generator) -> Floats:
        return self._slice.whole(point, random)

    def _learn(self, point: Floats, mean_return: float | None, score: float | None, encounter: Encounter) -> None:
        self._points = np.concatenate((self._points, point[None, list(self._slice.columns)]))
        wanted, violated = self._slice.config.requirement, encounter.collision or encounter.violations
        fails = encounter.margins[wanted] < 0.0 if wanted in encounter.margins else bool(violated)
        self._fails.append(None if mean_return is None else fails)
        avoided = encounter.avoided_by.get(DRIVER)
        self._driver.append(None if avoided is None else not avoided)

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {
            **super().state(),
            "points": self._points.copy(),
            "fails": list(self._fails),
            "driver": list(self._driver),
            "asked": self._asked,
            "filled": self._filled,
        }

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load(state)
        self._points = np.array(state["points"])  # once a tensor
        self._fails, self._driver = list(state["fails"]), list(state["driver"])
        self._asked, self._filled = state["asked"], state["filled"]


def _both(outcomes: list[bool | None]) -> bool:
    """Whether enough of both classes are known."""
    return outcomes.count(True) >= OF_EACH and outcomes.count(False) >= OF_EACH
