"""Scenes that no search has chosen: each drawn independently of all others, so that bounds may be drawn from them."""

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scene_optimizer.base import NOBODY, Encounter, State, check_identity, check_told
from risk_sac.types import Floats


class IidSampler:
    """Uniform points of the unit cube. A Sobol sequence would fill it more evenly, and its points depend on each other.

    What is told of a scene makes no difference to the next one, and none has a score.
    """

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        self._identity: State = {"kind": "iid", "dimension": dimension, "seed": seed}
        self._dimension, self._seed = dimension, seed
        self._drawn = 0

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`; each point has a generator of its own."""
        generator = np.random.default_rng((self._seed, self._drawn))
        self._drawn += 1
        return generator.random(self._dimension)

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
        """See `SceneOptimizer.tell`; always None."""
        check_told(u, mean_return, self._dimension)
        return None

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {**self._identity, "drawn": self._drawn}

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        check_identity(state, self._identity)
        self._drawn = state["drawn"]
