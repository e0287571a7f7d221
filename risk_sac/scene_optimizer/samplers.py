"""Controls that learn nothing from returns: space-filling scenes, and independent ones."""

import numpy as np
import torch
from torch.quasirandom import SobolEngine

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scene_optimizer.base import NOBODY, Encounter, RunningMaximum, State, check_identity, check_told
from risk_sac.types import Floats


def sobol_points(dimension: int, seed: int, skip: int = 0, count: int = 1) -> torch.Tensor:
    """Returns points of a scrambled Sobol sequence, `count x d`, in [0, 1], after the first `skip`."""
    engine = SobolEngine(dimension, scramble=True, seed=seed)  # type: ignore[no-untyped-call]  # has its own generator
    if skip:
        engine.fast_forward(skip)  # type: ignore[no-untyped-call]
    return engine.draw(count, dtype=torch.float64)


class SobolOptimizer:
    """Scenes from a scrambled Sobol sequence; scores them so that every method's records carry f_e."""

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        self._identity: State = {"kind": "sobol", "dimension": dimension, "seed": seed}
        self._dimension, self._seed = dimension, seed
        self._drawn = 0
        self._maximum = RunningMaximum(config.running_maximum_rate)

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        self._drawn += 1
        return sobol_points(self._dimension, self._seed, self._drawn - 1)[0].numpy()

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
        """See `SceneOptimizer.tell`."""
        check_told(u, mean_return, self._dimension)
        return None if mean_return is None else self._maximum.score(mean_return)

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {**self._identity, "drawn": self._drawn, "maximum": self._maximum.state()}

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        check_identity(state, self._identity)
        self._drawn = state["drawn"]
        self._maximum.load(state["maximum"])


class IidSampler:
    """Uniform points, each drawn independently of all others, so that bounds may be drawn from them.

    A Sobol sequence would fill the cube more evenly, but its points depend on each other. No scene has a score.
    """

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        self._identity: State = {"kind": "iid", "dimension": dimension, "seed": seed}
        self._dimension, self._seed = dimension, seed
        self._drawn = 0

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`; each point has a generator of its own."""
        self._drawn += 1
        return np.random.default_rng((self._seed, self._drawn - 1)).random(self._dimension)

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
