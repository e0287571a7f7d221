"""The control that learns nothing: uniformly random actions behind the learner's verbs."""

from typing import Any

import numpy as np

from risk_sac.agents.replay import Transition, Vector


class RandomAgent:
    """Uniform actions in [-1, 1]; λ and α are 0."""

    device = "cpu"
    dual_variable = 0.0
    temperature = 0.0

    def __init__(self, action_size: int, seed: int) -> None:
        self._action_size = action_size
        self._generator = np.random.default_rng(seed)

    def act(self, observation: Vector, explore: bool = True) -> Vector:
        """The observation makes no difference."""
        return self._generator.uniform(-1.0, 1.0, self._action_size).astype(np.float32)

    def observe(self, transition: Transition) -> None:
        """Forgets it."""

    def update(self) -> None:
        """Nothing to learn."""

    def state(self) -> dict[str, Any]:
        """The generator's position."""
        return {"generator": self._generator.bit_generator.state}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self._generator.bit_generator.state = state["generator"]
