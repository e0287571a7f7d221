"""Controls that learn nothing: random actions, and one fixed rule for searches over scenes alone."""

from typing import Any

import numpy as np

from risk_sac.agents.replay import Transition
from risk_sac.observation_layout import PER_ADVERSARY, X_M, Y_M
from risk_sac.records import DrivenBy
from risk_sac.types import Floats, Vector

REDRAWN = 0.1  # share of steps in which an adversary's action is drawn again: it holds for a second on average
AHEAD_M = 5.0  # between the centres: the ego's length
BRAKING = -0.5  # of the limit
ALONG_COS = 0.9  # headings less than about 25 degrees apart


class Control:
    """The learner's verbs for an agent that learns nothing and keeps no state; λ and α are 0.

    Attributes:
      driven_by: what chooses the actions; None: nothing does, or, where there are genes, the sampler knows.
    """

    driven_by: DrivenBy | None = None
    device = "cpu"
    dual_variable = 0.0
    temperature = 0.0
    genes = 0
    can_stop_early = False

    def begin(self, genes: Floats) -> None:
        """Begins an episode."""

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Ignores it."""

    def update(self) -> None:
        """Nothing to learn."""

    def state(self) -> dict[str, Any]:
        """Returns the state that the next episode depends on."""
        return {}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""


class IdleAgent(Control):
    """No actions: SUMO drives the adversary vehicles, and pedestrians stand."""

    def __init__(self, action_size: int, seed: int) -> None:
        self._action = np.zeros(action_size, dtype=np.float32)

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Returns zeros, which the environment ignores."""
        return self._action


class RandomAgent(Control):
    """Uniform actions in [-1, 1], each adversary's held for a while.

    Choice: drawn again in every step they would average out to nothing, since jerk is bounded, and the control would be
    too weak.
    """

    driven_by = DrivenBy.RANDOM

    def __init__(self, action_size: int, seed: int) -> None:
        self._generator = np.random.default_rng(seed)
        self._action = self._draw(action_size // 2)

    def _draw(self, adversaries: int) -> Vector:
        return self._generator.uniform(-1.0, 1.0, (adversaries, 2)).astype(np.float32)

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Draws; the observation makes no difference."""
        redrawn = self._generator.random(len(self._action)) < REDRAWN
        self._action = np.where(redrawn[:, None], self._draw(len(self._action)), self._action)
        return self._action.ravel()

    def state(self) -> dict[str, Any]:
        """The generator's position and the action that is held."""
        return {"generator": self._generator.bit_generator.state, "action": self._action.tolist()}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self._generator.bit_generator.state = state["generator"]
        self._action = np.array(state["action"], dtype=np.float32)


class ScriptedAgent(Control):
    """Fixed rule: a vehicle ahead of the ego cuts in and brakes.

    It drives in the ego's direction. All others keep on.
    """

    driven_by = DrivenBy.SCRIPT

    def __init__(self, action_size: int, seed: int) -> None:
        self._adversaries = action_size // 2

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """Acts on each adversary's part of the observation; nothing is random."""
        seen = observation[: self._adversaries * PER_ADVERSARY].reshape(-1, PER_ADVERSARY)
        x_m, y_m, cos = seen[:, 0] * X_M, seen[:, 1] * Y_M, seen[:, 4]
        ahead = (x_m > AHEAD_M) & (cos > ALONG_COS)
        drive, steer = np.where(ahead, BRAKING, 0.0), np.where(ahead, np.clip(-y_m, -1.0, 1.0), 0.0)
        return np.stack((drive, steer), axis=1).ravel().astype(np.float32)
