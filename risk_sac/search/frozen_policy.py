"""Runs a policy that no longer learns, as plain arrays, without torch."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from risk_sac.errors import NotFinite
from risk_sac.world.types import Vector

# Choice: log σ is squashed smoothly into these bounds; a hard clamp has no gradient outside them.
LOG_STD_MIN = -5.0
LOG_STD_MAX = 2.0
LOG_STD_MIDDLE, LOG_STD_HALF = 0.5 * (LOG_STD_MAX + LOG_STD_MIN), 0.5 * (LOG_STD_MAX - LOG_STD_MIN)
EPSILON = 1e-5  # added to a variance, as `torch.nn.functional.layer_norm` does
Layers = Sequence[NDArray[np.float32]]
"""Weights, `in x out`, and biases, `out`, in turn."""


@dataclass(frozen=True, slots=True)
class FrozenPolicy:
    """Policy without exploration: tanh of a perceptron with ReLU between layers.

    Attributes:
      normalised: whether each hidden layer is, see `respond`.
    """

    layers: tuple[NDArray[np.float32], ...]
    action_size: int
    """The first of the network's outputs; a tanh-Gaussian's log σ follow."""
    normalised: bool = False

    def __call__(self, observation: Vector) -> Vector:
        """Action in [-1, 1], `action_size`.

        Raises:
          NotFinite: a weight of the network is not finite.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            action = np.tanh(respond(self.layers, observation, normalised=self.normalised)[: self.action_size])
        if not np.isfinite(action).all():
            raise NotFinite("the policy acts by no number")
        return action

    def check(self, observation_size: int) -> None:
        """Refuses arrays that are no network from an observation to an action.

        Raises:
          ValueError: saying what they are.
        """
        shapes = [layer.shape for layer in self.layers]
        weights, biases = shapes[::2], shapes[1::2]
        if (
            not shapes
            or len(weights) != len(biases)
            or any(len(weight) != 2 or bias != weight[1:] for weight, bias in zip(weights, biases, strict=True))
            or any(below[1] != above[0] for below, above in pairwise(weights))
            or weights[0][0] != observation_size
            or weights[-1][1] not in (self.action_size, 2 * self.action_size)
        ):
            raise ValueError(f"a policy of shapes {shapes}; wanted from {observation_size} to {self.action_size}")
        if not all(layer.dtype == np.float32 and np.isfinite(layer).all() for layer in self.layers):
            raise ValueError("a policy of other than finite numbers in 32 bits")


def respond(layers: Layers, inputs: Vector, *, normalised: bool = False) -> Vector:
    """Evaluates a perceptron for one input.

    Args:
      layers: of the network.
      inputs: `in`.
      normalised: whether each hidden layer has mean 0 and variance 1 before its ReLU.

    Returns:
      `out`.
    """
    weights, biases = layers[::2], layers[1::2]
    activation = np.asarray(inputs, np.float32)
    for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
        activation = activation @ weight + bias
        if normalised:
            activation = (activation - activation.mean()) / np.sqrt(activation.var() + EPSILON)
        activation = np.maximum(activation, 0.0)
    return np.asarray(activation @ weights[-1] + biases[-1])


def network(stacked: Layers) -> Layers:
    """Returns the first network of `count x in x out` weights and `count x 1 x out` biases."""
    return [layer[0].reshape(layer.shape[1:] if k % 2 == 0 else -1) for k, layer in enumerate(stacked)]
