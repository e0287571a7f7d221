"""Space-filling scenes: the control that learns nothing from returns."""

import torch
from torch.quasirandom import SobolEngine

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scene_optimizer.base import NOBODY, Encounter, State, check_identity, check_told
from risk_sac.scene_optimizer.objective import RunningMaximum, objective, update_running_maximum
from risk_sac.types import Floats


class SobolSequence:
    """Scrambled Sobol points with a position that can be set."""

    def __init__(self, dimension: int, seed: int) -> None:
        self._dimension = dimension
        self._seed = seed
        self.seek(0)

    @property
    def position(self) -> int:
        """Points drawn so far."""
        return int(self._engine.num_generated)

    def draw(self, count: int = 1) -> torch.Tensor:
        """The next points, `count x d`, in [0, 1]."""
        return self._engine.draw(count, dtype=torch.float64)

    def seek(self, position: int) -> None:
        """Go to where `position` points have been drawn."""
        # A seeded engine owns its generator.
        self._engine = SobolEngine(self._dimension, scramble=True, seed=self._seed)  # type: ignore[no-untyped-call]
        if position:
            self._engine.fast_forward(position)  # type: ignore[no-untyped-call]


class SobolOptimizer:
    """Scenes from a scrambled Sobol sequence; scores them so that every method's records carry f_e."""

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        self._identity: State = {"kind": "sobol", "dimension": dimension, "seed": seed}
        self._dimension = dimension
        self._config = config
        self._sequence = SobolSequence(dimension, seed)
        self._maximum: RunningMaximum | None = None

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        return self._sequence.draw()[0].numpy()

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
        """See `SceneOptimizer.tell`."""
        check_told(u, mean_return, self._dimension)
        if mean_return is None:
            return None
        self._maximum = update_running_maximum(self._maximum, mean_return, self._config.running_maximum_rate)
        return objective(mean_return, self._maximum.smoothed)

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        maximum = None if self._maximum is None else tuple(self._maximum)
        return {**self._identity, "position": self._sequence.position, "maximum": maximum}

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        check_identity(state, self._identity)
        self._sequence.seek(state["position"])
        self._maximum = None if state["maximum"] is None else RunningMaximum(*state["maximum"])
