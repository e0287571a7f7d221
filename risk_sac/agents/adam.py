"""Adam over flat parameters.

A step takes as long as torch's own, but to make one of those a new process loads a compiler, which takes seconds.

Source: Kingma and Ba, "Adam: a method for stochastic optimization", 2015, Alg. 1.
"""

import math
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

FIRST_DECAY, SECOND_DECAY, EPSILON = 0.9, 0.999, 1e-8  # β1, β2 and ε, the paper's


class Adam:
    """Moves parameters against their gradients, each at a rate of its own."""

    def __init__(self, parameters: Sequence[Tensor], rates: Sequence[float]) -> None:
        """Begins with moments of 0.

        Args:
          parameters: any shapes; `step` reads their `grad`.
          rates: as many, greater than 0.
        """
        self._moved = tuple(zip(parameters, rates, strict=True))
        self._first = [torch.zeros_like(each) for each in parameters]
        self._second = [torch.zeros_like(each) for each in parameters]
        self._steps = 0

    def step(self) -> None:
        """One step.

        m ← β1 m + (1 - β1) g,  v ← β2 v + (1 - β2) g²,  θ ← θ - rate · m̂ / (√v̂ + ε)

        m̂ and v̂ are m / (1 - β1^t) and v / (1 - β2^t).
        """
        self._steps += 1
        first_share, second_share = 1.0 - FIRST_DECAY**self._steps, math.sqrt(1.0 - SECOND_DECAY**self._steps)
        for (parameter, rate), first, second in zip(self._moved, self._first, self._second, strict=True):
            gradient = parameter.grad
            if gradient is None:
                raise RuntimeError("got a parameter without a gradient; write it before a step")
            first.lerp_(gradient, 1.0 - FIRST_DECAY)
            second.mul_(SECOND_DECAY).addcmul_(gradient, gradient, value=1.0 - SECOND_DECAY)
            parameter.addcdiv_(first, second.sqrt().div_(second_share).add_(EPSILON), value=-rate / first_share)

    def state(self) -> dict[str, Any]:
        """Moments and steps; not copied."""
        return {"first": self._first, "second": self._second, "steps": self._steps}

    def load(self, state: dict[str, Any]) -> None:
        """Continue from a copy of `state()`; RuntimeError if the parameters are of another size."""
        for mine, stored in ((self._first, state["first"]), (self._second, state["second"])):
            for one, other in zip(mine, stored, strict=True):
                one.copy_(other)
        self._steps = state["steps"]
