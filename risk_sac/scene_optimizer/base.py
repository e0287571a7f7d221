"""The seam between Algorithm 1 and whatever proposes its scenes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from risk_sac.errors import CheckpointError, NotFinite, SceneError
from risk_sac.records import Collision
from risk_sac.types import Floats

State = dict[str, Any]
"""Tensors and plain values only, so that `torch.load(weights_only=True)` reads it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Encounter:
    """Whom the ego met in an episode."""

    collision: Collision | None = None
    encounters_s: Mapping[str, float] = field(default_factory=dict)
    """Adversary → its smallest time to encounter while ahead and in sight, the ego on the move; who never was is left
    out."""


NOBODY = Encounter()


class SceneOptimizer(Protocol):
    """Proposes points of the unit cube, and learns from what came of them.

    A point is a scene and, where the adversaries follow scripts, their genes behind it.
    """

    def ask(self) -> Floats:
        """The next point to try.

        Returns:
            `d`, in [0, 1].
        """

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
        """Score a finished episode.

        Args:
            u: `d`, in [0, 1]; need not come from `ask`.
            mean_return: R̄_e, mean shaped reward per step; None if C_hard rejected the scene.
            encounter: whom the ego met.

        Returns:
            f_e (Eq. 11), or None for a rejected scene, which has no return to score.

        Raises:
            NotFinite: u or mean_return is NaN or infinite.
            SceneError: u is not a point of the unit cube.
        """

    def state(self) -> State:
        """Everything needed to continue exactly here."""

    def load(self, state: State) -> None:
        """Continue exactly where `state` was taken.

        Raises:
            CheckpointError: the state is of an optimiser of another kind, dimension or seed.
        """


def check_told(u: Floats, mean_return: float | None, dimension: int) -> Floats:
    """Copy of a told scene, once it and its return have been found sound (see `SceneOptimizer.tell`)."""
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
    """Refuse the state of another optimiser; `wanted` holds kind, dimension and seed."""
    for name, value in wanted.items():
        if state.get(name) != value:
            raise CheckpointError(f"the scene optimiser's {name} is {state.get(name)!r} in the state; wanted {value!r}")
