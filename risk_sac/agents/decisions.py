"""Holds a decision for several environment steps; merges them into one transition.

Choice: the policy acts every 0.5 s, though it is asked in every step of 0.1 s. Adversaries have bounded jerk, so noise
that is redrawn in every step averages out, and a policy explores next to nothing. The outcome of an attack of several
seconds is learnt over a fifth of the steps.

Source: Sutton, Precup and Singh, "Between MDPs and semi-MDPs", 1999, for options that last a fixed time.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from risk_sac.agents.replay import Transition
from risk_sac.types import Vector


class Held:
    """An action that is held for a number of steps."""

    def __init__(self, steps: int) -> None:
        self._steps = steps
        self.begin()

    def begin(self) -> None:
        """An episode begins: the next action is a new one."""
        self._action: Vector | None = None
        self._left = 0

    def act(self, decide: Callable[[], Vector]) -> Vector:
        """The action of this step; `decide` is asked for one where the last was held for long enough."""
        if self._action is None or not self._left:
            self._action, self._left = decide(), self._steps
        self._left -= 1
        return self._action


class Decision:
    """Merges the environment steps of a decision into one transition.

    R = Σ_i γ^i r_i, costs alike, over the k steps of the decision; the following return is discounted by γ^k. So the
    shaping of (6) needs no sum: γ^k φ(s_k) - φ(s_0) equals the sum of the steps' own terms.

    Choice: for a decision of other drivers, which act in every step, the action is the mean of theirs.
    """

    def __init__(self, steps: int, discount: float) -> None:
        """Args: k, and γ of one environment step."""
        self._steps = steps
        self._weights = discount ** np.arange(steps)
        self.begin()

    def begin(self) -> None:
        """An episode begins; what the last one left unfinished, cut off by its horizon, is forgotten."""
        self._taken: list[Transition] = []

    def add(self, step: Transition) -> Transition | None:
        """Adds a step; returns the transition that it completes, if any.

        It is complete by the number of steps or by the end of the world.
        """
        self._taken.append(step)
        if len(self._taken) < self._steps and not step.terminated:
            return None
        taken, self._taken = self._taken, []
        weights = self._weights[: len(taken)]
        return replace(
            step,
            observation=taken[0].observation,
            action=np.mean([each.action for each in taken], axis=0, dtype=np.float32),
            risk_reward=float(weights @ [each.risk_reward for each in taken]),
            cost=float(weights @ [each.cost for each in taken]),
            robustness=taken[0].robustness,
        )
