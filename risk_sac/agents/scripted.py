"""The control that follows a script, for searches over scenes alone."""

from typing import Any

import numpy as np

from risk_sac.agents.replay import Transition
from risk_sac.observation_layout import PER_ADVERSARY, X_M, Y_M
from risk_sac.types import Floats, Vector

AHEAD_M = 5.0  # between the centres: the ego's length
BRAKING = -0.5  # of the limit
ALONG_COS = 0.9  # headings less than about 25 degrees apart


class ScriptedAgent:
    """Whoever drives ahead of the ego in its direction moves into its path and brakes; all others keep on.

    λ and α are 0.
    """

    device = "cpu"
    dual_variable = 0.0
    temperature = 0.0
    genes = 0
    can_stop_early = False

    def __init__(self, action_size: int, seed: int) -> None:
        self._adversaries = action_size // 2

    def begin(self, genes: Floats) -> None:
        """An episode begins; there are no genes."""

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Acts on what `risk_sac.observation` says of each adversary; nothing is random."""
        seen = observation[: self._adversaries * PER_ADVERSARY].reshape(-1, PER_ADVERSARY)
        x_m, y_m, cos = seen[:, 0] * X_M, seen[:, 1] * Y_M, seen[:, 4]
        ahead = (x_m > AHEAD_M) & (cos > ALONG_COS)
        drive, steer = np.where(ahead, BRAKING, 0.0), np.where(ahead, np.clip(-y_m, -1.0, 1.0), 0.0)
        return np.stack((drive, steer), axis=1).ravel().astype(np.float32)

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Forgets it."""

    def update(self) -> None:
        """Nothing to learn."""

    def state(self) -> dict[str, Any]:
        """Nothing to keep."""
        return {}

    def load(self, state: dict[str, Any]) -> None:
        """Nothing to restore."""
