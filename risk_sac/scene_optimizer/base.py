"""The seam between Algorithm 1 and what proposes its scenes, and the score that all of them share.

Source: RISK-SAC, Sec. III-E.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, overload

import numpy as np

from risk_sac.errors import CheckpointError, NotFinite, SceneError
from risk_sac.records import Collision
from risk_sac.types import Floats

State = dict[str, Any]
"""Tensors and plain values only, so that `torch.load(weights_only=True)` reads it."""
# Choice: the paper leaves ε open. Mean returns per step are of order 0.1, so 1e-3 is negligible there and keeps f
# readable while M̄ passes through zero.
EPSILON = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter:
    """What the ego met in an episode.

    Attributes:
      collision: its contact, if there was one.
      encounters_s: smallest time to encounter by adversary, s, while that is ahead and in sight and the ego moves.
    """

    collision: Collision | None = None
    encounters_s: Mapping[str, float] = field(default_factory=dict)


NOBODY = Encounter()


class SceneOptimizer(Protocol):
    """Proposes points of the unit cube, and learns from their scores.

    A point is a scene and, where the adversaries follow scripts, their genes behind it.
    """

    def ask(self) -> Floats:
        """Returns the next point to try, `d`, in [0, 1]."""

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
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

    def state(self) -> State:
        """Returns all that is needed to continue exactly here."""

    def load(self, state: State) -> None:
        """Continues exactly where `state` was taken.

        Raises:
            CheckpointError: the state is of an optimiser of another kind, dimension or seed.
        """


@overload
def objective(mean_return: float, running_maximum: float) -> float: ...
@overload
def objective(mean_return: Floats, running_maximum: float) -> Floats: ...
def objective(mean_return: float | Floats, running_maximum: float) -> float | Floats:
    """How far an episode stays below the best returns, f_e; smaller is riskier.

    f_e(ξ) = max(0, M̄_e - R̄_e(ξ)) / (|M̄_e| + ε)                                  (11)

    Args:
        mean_return: R̄_e, one value or an array of any shape.
        running_maximum: M̄_e.

    Returns:
        f_e >= 0, shaped like `mean_return`; NaN where that is NaN.
    """
    score = np.maximum(0.0, running_maximum - mean_return) / (abs(running_maximum) + EPSILON)
    return score if isinstance(mean_return, np.ndarray) else float(score)


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
        return objective(mean_return, self.smoothed)

    def state(self) -> tuple[float | None, float]:
        """Returns plain values to continue from."""
        return self.largest, self.smoothed

    def load(self, state: tuple[float | None, float]) -> None:
        """Continues from `state()`."""
        self.largest, self.smoothed = state


def check_told(u: Floats, mean_return: float | None, dimension: int) -> Floats:
    """Returns a copy of u; raises as `SceneOptimizer.tell`."""
    point = np.array(u, dtype=np.float64)
    if point.shape != (dimension,):
        raise SceneError(f"u has shape {point.shape}; wanted ({dimension},), one coordinate per scene parameter")
    if not np.isfinite(point).all():
        raise NotFinite(f"u is {point.tolist()}; wanted finite coordinates")
    if point.min() < 0 or point.max() > 1:
        raise SceneError(f"u spans [{point.min():g}, {point.max():g}]; wanted coordinates in [0, 1]")
    if mean_return is not None and not math.isfinite(mean_return):
        raise NotFinite(f"mean_return is {mean_return}; wanted a finite number, or None for a rejected scene")
    return point


def check_identity(state: State, wanted: State) -> None:
    """Refuses the state of another optimiser; `wanted` holds kind, dimension and seed."""
    for name, value in wanted.items():
        if state.get(name) != value:
            raise CheckpointError(f"the scene optimiser's {name} is {state.get(name)!r} in the state; wanted {value!r}")
