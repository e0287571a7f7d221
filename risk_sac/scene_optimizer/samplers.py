"""Controls that learn nothing from returns: space-filling scenes, and independent ones."""

import numpy as np
import torch
from torch.quasirandom import SobolEngine

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scene_optimizer.base import NO_ENCOUNTER, Encounter, SceneOptimizer, State
from risk_sac.types import Floats


def sobol_points(dimension: int, seed: int, skip: int = 0, count: int = 1) -> torch.Tensor:
    """Returns points of a scrambled Sobol sequence, `count x d`, in [0, 1], after the first `skip`."""
    engine = SobolEngine(dimension, scramble=True, seed=seed)  # type: ignore[no-untyped-call]  # has its own generator
    if skip:
        engine.fast_forward(skip)  # type: ignore[no-untyped-call]
    return engine.draw(count, dtype=torch.float64)


class SobolOptimizer(SceneOptimizer):
    """Scenes from a scrambled Sobol sequence; scores them so that every method's records carry f_e."""

    kind = "sobol"

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        super().__init__(dimension, config, seed)
        self._drawn = 0

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        self._drawn += 1
        return self._point(self._drawn - 1)

    def _point(self, number: int) -> Floats:
        return sobol_points(self._dimension, self._seed, number)[0].numpy()

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {**super().state(), "drawn": self._drawn}

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load(state)
        self._drawn = state["drawn"]


class IidSampler(SobolOptimizer):
    """Uniform points, each drawn independently of all others, so that bounds may be drawn from them.

    A Sobol sequence would fill the cube more evenly, but its points depend on each other. No scene has a score.
    """

    kind = "iid"

    def _point(self, number: int) -> Floats:
        return np.random.default_rng((self._seed, number)).random(self._dimension)

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NO_ENCOUNTER) -> None:
        """See `SceneOptimizer.tell`; always None."""
        super().tell(u, mean_return, encounter)

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load({"maximum": self._maximum.state(), **state})  # which older checkpoints lack
