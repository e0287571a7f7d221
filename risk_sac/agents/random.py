"""The control that learns nothing: uniformly random actions behind the learner's verbs."""

from typing import Any

import numpy as np

from risk_sac.agents.replay import Transition
from risk_sac.types import Floats, Vector

REDRAWN = 0.1  # share of steps in which an adversary's action is drawn anew: it holds for a second on average


class RandomAgent:
    """Uniform actions in [-1, 1], each adversary's held for a while; λ and α are 0.

    Choice: drawn anew in every step they would average out to nothing, since jerk is bounded, and the control would be
    a straw man.
    """

    device = "cpu"
    dual_variable = 0.0
    temperature = 0.0
    genes = 0
    can_stop_early = False

    def __init__(self, action_size: int, seed: int) -> None:
        self._generator = np.random.default_rng(seed)
        self._action = self._draw(action_size // 2)

    def _draw(self, adversaries: int) -> Vector:
        return self._generator.uniform(-1.0, 1.0, (adversaries, 2)).astype(np.float32)

    def begin(self, genes: Floats) -> None:
        """An episode begins; there are no genes."""

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """The observation makes no difference."""
        redrawn = self._generator.random(len(self._action)) < REDRAWN
        self._action = np.where(redrawn[:, None], self._draw(len(self._action)), self._action)
        return self._action.ravel()

    def observe(self, transition: Transition, *, own: bool = True) -> None:
        """Forgets it."""

    def update(self) -> None:
        """Nothing to learn."""

    def state(self) -> dict[str, Any]:
        """The generator's position and the action that is held."""
        return {"generator": self._generator.bit_generator.state, "action": self._action.tolist()}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self._generator.bit_generator.state = state["generator"]
        self._action = np.array(state["action"], dtype=np.float32)
