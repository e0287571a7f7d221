"""Interface and objective of scene optimizers; Sobol and i.i.d. sampling.

Source: RISK-SAC, Sec. III-E.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.errors import CheckpointError, NotFinite, SceneError
from risk_sac.records import DrivenBy
from risk_sac.scenario.declared import SceneLaw
from risk_sac.search.encounter import NO_ENCOUNTER, Encounter
from risk_sac.world.types import Floats

if TYPE_CHECKING:
    from torch import Tensor

State = dict[str, Any]
"""Arrays, tensors and plain values only, which a checkpoint can hold."""
# Choice: the paper leaves ε open. Mean returns per step are of order 0.1, so 1e-3 is negligible there and keeps f
# readable while M̄ passes through zero.
EPSILON = 1e-3


def objective(mean_return: float | Floats, running_maximum: float) -> Floats:
    """Computes f_e, an episode's distance below the best returns; smaller is riskier.

    f_e(ξ) = max(0, M̄_e - R̄_e(ξ)) / (|M̄_e| + ε)                                  (11)

    Args:
        mean_return: R̄_e, one value or an array of any shape.
        running_maximum: M̄_e.

    Returns:
        f_e >= 0, shaped like `mean_return`; NaN where that is NaN.
    """
    return np.asarray(np.maximum(0.0, running_maximum - mean_return) / (abs(running_maximum) + EPSILON))


class RunningMaximum:
    """Largest mean return so far, raw and smoothed.

    M_e = max(M_{e-1}, R̄_e)
    M̄_e = M̄_{e-1} + rate · (M_e - M̄_{e-1}),  M̄_1 = R̄_1

    Choice: the paper says only "smoothed running maximum". Averaging M_e in every episode, and not only in those that
    set a record, brings M̄ up to a lone high return within about 1/rate episodes; otherwise every return above a
    lagging M̄ would share f = 0 for good.
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self.largest: float | None = None  # M_e; None before the first episode
        self.smoothed = 0.0  # M̄_e, which never falls and never exceeds M_e

    def score(self, mean_return: float) -> float:
        """Follows the mean return R̄_e of an episode, and returns its f_e."""
        if self.largest is None:
            self.largest = self.smoothed = mean_return
        else:
            self.largest = max(self.largest, mean_return)
            self.smoothed = min(self.largest, self.smoothed + self._rate * (self.largest - self.smoothed))
        return float(objective(mean_return, self.smoothed))

    def state(self) -> tuple[float | None, float]:
        """Returns plain values to continue from."""
        return self.largest, self.smoothed

    def load(self, state: tuple[float | None, float]) -> None:
        """Continues from `state()`."""
        self.largest, self.smoothed = state


class SceneOptimizer(ABC):
    """Proposes points of the unit cube, and learns from their scores.

    A point is a scene and, where the adversaries follow scripts, their genes behind it.

    Attributes:
      driven_by: where the genes of the point that was proposed last come from; None before the first one.
      out: points that were asked for and are not told yet, where several are played at a time.
    """

    kind: ClassVar[str]
    tries: ClassVar[int] = 1000  # further points that it may be asked for where one breaks the scenario's constraints
    points: int | None = None  # number of different ones; None: there is no end
    driven_by: DrivenBy | None = None
    out: Sequence[Floats] = ()

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        self._dimension, self._config, self._seed = dimension, config, seed
        self._maximum = RunningMaximum(config.running_maximum_rate)

    @property
    def origin(self) -> Mapping[str, Any]:
        """Origin of the point that was asked for last, as plain values.

        Where others were asked for since, it is set again before the point is told; to nothing before a point that
        another sampler has proposed.
        """
        return {}

    @origin.setter
    def origin(self, origin: Mapping[str, Any]) -> None:
        del origin  # most samplers remember nothing

    def waits(self, out: int) -> bool:
        """Whether the next point depends on results that are out."""
        return False

    @abstractmethod
    def ask(self) -> Floats:
        """Returns the next point to try, `d`, in [0, 1]."""

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NO_ENCOUNTER) -> float | None:
        """Scores a finished episode.

        Args:
            u: `d`, in [0, 1]; need not come from `ask`.
            mean_return: R̄_e, mean shaped reward per step; None if C_hard rejected the scene.
            encounter: what the ego met.

        Returns:
            f_e (Eq. 11), or None for a rejected scene, which has no return to score.

        Raises:
            NotFinite: u or mean_return is NaN or infinite.
            SceneError: u is not a point of the unit cube.
        """
        point = np.array(u, dtype=np.float64)
        if point.shape != (self._dimension,):
            expected = f"({self._dimension},), one coordinate per scene parameter"
            raise SceneError(f"u has shape {point.shape}; wanted {expected}")
        if not np.isfinite(point).all():
            raise NotFinite(f"u is {point.tolist()}; wanted finite coordinates")
        if point.min() < 0 or point.max() > 1:
            raise SceneError(f"u spans [{point.min():g}, {point.max():g}]; wanted coordinates in [0, 1]")
        if mean_return is not None and not math.isfinite(mean_return):
            raise NotFinite(f"mean_return is {mean_return}; wanted a finite number, or None for a rejected scene")
        score = None if mean_return is None else self._maximum.score(mean_return)
        self._learn(point, mean_return, score, encounter)
        return score

    def _learn(  # noqa: B027  # controls learn nothing
        self, point: Floats, mean_return: float | None, score: float | None, encounter: Encounter
    ) -> None:
        """Learns from an episode; arguments as for `tell`, and its result."""

    def state(self) -> State:
        """Returns all that an exact continuation needs; taken between two episodes."""
        return {**self._identity(), "maximum": self._maximum.state()}

    def load(self, state: State) -> None:
        """Continues exactly where `state` was taken.

        Raises:
            CheckpointError: the state is of an optimiser of another kind, dimension or seed.
        """
        for name, expected in self._identity().items():
            if state.get(name) != expected:
                got = state.get(name)
                raise CheckpointError(f"the scene optimiser's {name} is {got!r} in the state; wanted {expected!r}")
        self._maximum.load(state["maximum"])

    def _identity(self) -> State:
        return {"kind": self.kind, "dimension": self._dimension, "seed": self._seed}


def sobol_points(dimension: int, seed: int, skip: int = 0, count: int = 1) -> "Tensor":
    """Returns scrambled Sobol points, `count x d`, in [0, 1], after `skip`."""
    import torch  # here, because loading it takes a second, and most samplers draw no such points
    from torch.quasirandom import SobolEngine

    engine = SobolEngine(dimension, scramble=True, seed=seed)  # type: ignore[no-untyped-call]  # has its own generator
    if skip:
        engine.fast_forward(skip)  # type: ignore[no-untyped-call]
    return engine.draw(count, dtype=torch.float64)


class SobolOptimizer(SceneOptimizer):
    """Sampler of scrambled Sobol scenes, scored so that records have f_e."""

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
    """Independent points of the declared distribution, as statistical bounds need.

    A Sobol sequence would fill the cube more evenly, but its points depend on each other. No scene has a score.
    """

    kind = "iid"

    def __init__(
        self, dimension: int, config: SceneOptimizerConfig, seed: int, declared: SceneLaw | None = None
    ) -> None:
        """Prepares; without a declared distribution all points are as likely."""
        super().__init__(dimension, config, seed)
        self._declared = declared

    def _point(self, number: int) -> Floats:
        shares = np.random.default_rng((self._seed, number)).random(self._dimension)
        return shares if self._declared is None else self._declared.unit(shares)

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NO_ENCOUNTER) -> None:
        """See `SceneOptimizer.tell`; always None."""
        super().tell(u, mean_return, encounter)

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load({"maximum": self._maximum.state(), **state})  # which older checkpoints lack
