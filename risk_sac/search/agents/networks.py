"""Multi-layer perceptrons, and the tanh-Gaussian policy on top of one."""

import math
from collections.abc import Sequence
from itertools import chain, pairwise

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812  # the usual name
from numpy.typing import NDArray
from torch import Tensor, nn

from risk_sac.search.frozen_policy import LOG_STD_HALF, LOG_STD_MIDDLE, Layers, respond
from risk_sac.world.types import Vector


class Mlp(nn.Module):
    """Stacked perceptrons of equal shape with ReLU; one product evaluates all."""

    def __init__(
        self, sizes: Sequence[int], generator: torch.Generator, *, count: int = 1, normalised: bool = False
    ) -> None:
        """Draws every entry from U(-1/√fan_in, 1/√fan_in), as `nn.Linear` does.

        Args:
          sizes: of the input, the hidden layers and the output.
          generator: of the initial values; the network is created on its device.
          count: number of networks.
          normalised: whether each hidden layer has mean 0 and variance 1 before its ReLU (Ba et al., "Layer
            normalization", 2016, without gain and bias).
        """
        super().__init__()
        self.normalised = normalised
        self._count = count
        self._layers: list[tuple[nn.Parameter, nn.Parameter]] = []  # weight, count x in x out; bias, count x 1 x out
        for fan_in, out in pairwise(sizes):
            bound = 1.0 / math.sqrt(fan_in)
            weight, bias = (torch.empty(count, rows, out, device=generator.device) for rows in (fan_in, 1))
            for entries in (weight, bias):
                entries.uniform_(-bound, bound, generator=generator)
            self._layers.append((nn.Parameter(weight), nn.Parameter(bias)))
        self._registered = nn.ParameterList(chain.from_iterable(self._layers))
        # A gain of 1 and a shift of 0 change nothing, but torch's kernel takes twice as long without them.
        self._gains = [(bias.new_ones(bias.shape[-1]), bias.new_zeros(bias.shape[-1])) for _, bias in self._layers]

    def forward(self, inputs: Tensor) -> Tensor:
        """Evaluates all networks.

        Args:
          inputs: `batch x in`.

        Returns:
          `count x batch x out`.
        """
        hidden = inputs.expand(self._count, *inputs.shape)
        for (weight, bias), gain in zip(self._layers[:-1], self._gains, strict=False):
            hidden = torch.bmm(hidden, weight).add_(bias)
            if self.normalised:
                hidden = F.layer_norm(hidden, hidden.shape[-1:], *gain)
            hidden = F.relu(hidden, inplace=True)
        weight, bias = self._layers[-1]
        return torch.bmm(hidden, weight).add_(bias)

    def layers(self) -> Layers:
        """The first network's weights, `in x out`, and biases, `out`: CPU views."""
        layers = [tensor.detach().cpu().numpy()[0] for layer in self._layers for tensor in layer]
        layers[1::2] = [bias[0] for bias in layers[1::2]]
        return layers

    def arrays(self) -> tuple[NDArray[np.float32], ...]:
        """Copies weights, `(count, in, out)`, and biases, `(count, 1, out)`, in turn."""
        return tuple(each.detach().cpu().numpy().copy() for each in chain.from_iterable(self._layers))

    @torch.no_grad()
    def copy_from(self, layers: Layers) -> None:
        """Copies values, as `arrays` returns them, into the parameters."""
        for parameter, layer in zip(chain.from_iterable(self._layers), layers, strict=True):
            parameter.copy_(torch.from_numpy(layer))

    @torch.no_grad()
    def set_last_bias(self, first: int, value: float) -> None:
        """Sets the outputs' biases from the `first` on."""
        self._layers[-1][1][..., first:] = value

    def respond(self, inputs: Vector) -> Tensor:
        """Evaluates the first network for one input, `out`, in numpy for speed.

        Args:
          inputs: `in`.
        """
        return torch.from_numpy(respond(list(self.layers()), inputs, normalised=self.normalised))


def bounded_log_std(raw: Tensor) -> Tensor:
    """Squashes the network's output into [LOG_STD_MIN, LOG_STD_MAX], elementwise and smoothly."""
    return LOG_STD_HALF * torch.tanh(raw) + LOG_STD_MIDDLE


def raw_log_std(deviation: float) -> float:
    """Inverts `bounded_log_std`: returns the network output for a σ within bounds."""
    return math.atanh((math.log(deviation) - LOG_STD_MIDDLE) / LOG_STD_HALF)


def tanh_gaussian(mean: Tensor, log_std: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Reparameterised action and its exact log-probability.

    a = tanh(u),  u = μ + σ ε.
    log π(a|s) = Σ_k [-ε_k²/2 - log σ_k - log(2π)/2 - log(1 - tanh² u_k)].
    log(1 - tanh² u) = 2 (log 2 - u - softplus(-2u)), which stays finite where 1 - tanh² u rounds to 0.

    Args:
      mean: μ, `batch x action_size`.
      log_std: log σ, `batch x action_size`.
      noise: ε, standard normal, `batch x action_size`.

    Returns:
      Action in [-1, 1], `batch x action_size`, and log π(a|s), `batch`.

    Source: Haarnoja et al. 2018, App. C.
    """
    unsquashed = mean + log_std.exp() * noise
    terms = 2.0 * (unsquashed + F.softplus(-2.0 * unsquashed)) - 0.5 * noise.square() - log_std
    constants = 2.0 * math.log(2.0) + 0.5 * math.log(2.0 * math.pi)
    return torch.tanh(unsquashed), terms.sum(dim=-1) - mean.shape[-1] * constants
