"""Multi-layer perceptrons differentiated by hand, and the tanh-Gaussian on top of one.

The networks are small, so much of an update in autograd is bookkeeping between the matrix products. Here the
products are nearly all there is, and each network keeps its parameters in one flat tensor, so that an optimiser or
target-network step is one operation. Agents learn in torch's inference mode: what autograd notes down of each operator,
even where nothing asks for a gradient, is a seventh of an update.
"""

import math
import time
from collections.abc import Callable, Sequence
from functools import cache
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812  # the name all of torch's users know
from torch import Tensor

from risk_sac.agents.normalisation import Normalised, before_normalised_relu, normalised_relu
from risk_sac.frozen_policy import FrozenPolicy, respond
from risk_sac.types import Vector

# Choice: log σ is squashed smoothly into these bounds; a hard clamp has no gradient outside them.
LOG_STD_MIN = -5.0
LOG_STD_MAX = 2.0

# From this width on oneDNN may multiply faster than what `torch.mm` calls: 1.3 times at 128 and twice at 256 where that
# is MKL on an AMD processor, and no faster where it is MKL on an Intel. torch offers it only as this operator, which
# some builds lack.
ONEDNN_FROM = 128
_ONEDNN: bool = torch.backends.mkldnn.is_available()  # type: ignore[no-untyped-call]


class Pass(NamedTuple):
    """An evaluation of a network, with what its gradients need."""

    inputs: list[Tensor]  # of each layer, `batch x width`
    output: Tensor  # `batch x out`
    hidden: list[Normalised]  # each layer but the last; none of a network that is not normalised

    def since(self, row: int) -> "Pass":
        """That of the inputs from a row on."""
        hidden = [Normalised(*(each[row:] for each in layer)) for layer in self.hidden]
        return Pass([each[row:] for each in self.inputs], self.output[row:], hidden)


class Mlp:
    """Perceptron with ReLU between its layers.

    Attributes:
      parameters: all weights and biases, flat; `parameters.grad` is of the same layout and written by `backward`.
    """

    def __init__(self, sizes: Sequence[int], generator: torch.Generator, *, normalised: bool = False) -> None:
        """Draws every entry from U(-1/√fan_in, 1/√fan_in), as `nn.Linear` does.

        Args:
          sizes: of the input, the hidden layers and the output.
          generator: of the initial values; the network lives on its device.
          normalised: whether each hidden layer has mean 0 and variance 1 before its ReLU.
        """
        self._normalised = normalised
        shapes = [shape for fan_in, out in pairwise(sizes) for shape in ((fan_in, out), (out,))]
        ends = [0, *accumulate(math.prod(shape) for shape in shapes)]
        self.parameters = torch.empty(ends[-1], device=generator.device)
        self.parameters.grad = torch.zeros_like(self.parameters)
        places = [(slice(*place), shape) for place, shape in zip(pairwise(ends), shapes, strict=True)]
        views = [self.parameters[place].view(shape) for place, shape in places]
        gradients = [self.parameters.grad[place].view(shape) for place, shape in places]
        self._layers = views
        self._weights, self._biases = views[::2], views[1::2]  # in x out, out
        self._weight_gradients, self._bias_gradients = gradients[::2], gradients[1::2]
        for weight, bias in zip(self._weights, self._biases, strict=True):
            bound = 1.0 / math.sqrt(len(weight))
            weight.uniform_(-bound, bound, generator=generator)
            bias.uniform_(-bound, bound, generator=generator)

    def forward(self, inputs: Tensor) -> Pass:
        """Evaluates the network.

        Args:
          inputs: `batch x in`.
        """
        entering, hidden = [inputs], []
        for weight, bias in zip(self._weights[:-1], self._biases[:-1], strict=True):
            if self._normalised:
                rectified, layer = normalised_relu(_product(entering[-1], weight), bias)
                entering.append(rectified)
                hidden.append(layer)
            else:
                entering.append(_rectified_affine(entering[-1], weight, bias))
        return Pass(entering, _product(entering[-1], self._weights[-1]).add_(self._biases[-1]), hidden)

    def respond(self, inputs: Vector) -> Vector:
        """Evaluates the network for one input; numpy, since for one row torch's operators cost more than what they do.

        It must not be a normalised one.

        Args:
          inputs: `in`.

        Returns:
          `out`.
        """
        if self.parameters.is_cuda:
            return (
                self.forward(torch.from_numpy(np.asarray(inputs, np.float32))[None].to(self.parameters.device))
                .output[0]
                .cpu()
                .numpy()
            )
        return respond([layer.numpy() for layer in self._layers], inputs)

    def frozen(self, action_size: int) -> FrozenPolicy:
        """A copy that acts; the first `action_size` outputs are its means."""
        return FrozenPolicy(tuple(layer.cpu().numpy().copy() for layer in self._layers), action_size)

    def backward(self, evaluated: Pass, gradient: Tensor) -> None:
        """Writes the gradient of a loss in the parameters.

        Args:
          evaluated: as `forward` returned it.
          gradient: of the loss in the output, `batch x out`.
        """
        for layer in reversed(range(len(self._weights))):
            self._weight_gradients[layer].copy_(_product(evaluated.inputs[layer].t(), gradient))
            torch.sum(gradient, dim=0, out=self._bias_gradients[layer])
            if layer:
                gradient = self._through_layer(layer, evaluated, gradient)

    def input_gradient(self, evaluated: Pass, gradient: Tensor, columns: slice) -> Tensor:
        """Gradient of a loss in some columns of the inputs, `batch x columns`; arguments as for `backward`."""
        for layer in reversed(range(1, len(self._weights))):
            gradient = self._through_layer(layer, evaluated, gradient)
        return torch.mm(gradient, self._weights[0][columns].t())

    def _through_layer(self, layer: int, evaluated: Pass, gradient: Tensor) -> Tensor:
        """From the gradient in a layer's outputs to that in the outputs of the one below, before its ReLU."""
        weight = self._weights[layer].t()
        # An outer product where the output has one column, as that of a critic.
        below = gradient * weight if len(weight) == 1 else _product(gradient, weight)
        if self._normalised:
            return before_normalised_relu(below, evaluated.hidden[layer - 1])
        rectified: Tensor = torch.ops.aten.threshold_backward(below, evaluated.inputs[layer], 0)
        return rectified


def _product(left: Tensor, right: Tensor) -> Tensor:
    """Matrix product by whatever computes it fastest."""
    columns = right.shape[1]
    if columns == 1:
        return torch.mv(left, right[:, 0]).unsqueeze(1)
    if columns >= ONEDNN_FROM and _for_onednn(left, right):
        return _onednn(left, right, None, "none")
    return torch.mm(left, right)


def _rectified_affine(inputs: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """max(0, x W + b)."""
    if _for_onednn(inputs, weight):
        return _onednn(inputs, weight, bias, "relu")
    return torch.addmm(bias, inputs, weight).relu_()


def _onednn(left: Tensor, right: Tensor, bias: Tensor | None, activation: str) -> Tensor:
    result: Tensor = torch.ops.mkldnn._linear_pointwise(left, right.t(), bias, activation, [], "")
    return result


def _for_onednn(left: Tensor, right: Tensor) -> bool:
    wide = _ONEDNN and min(*left.shape, *right.shape) >= ONEDNN_FROM and not left.is_cuda
    return wide and _onednn_is_faster()


@cache
def _onednn_is_faster() -> bool:
    """Measured once in a process.

    Choice: faster by a quarter, each at its best. The two round differently, and processes on one kind of processor are
    to choose alike: none is known on which the difference is near a quarter.
    """
    square = torch.ones(256, 256)
    rounds = [(_seconds(torch.mm, square, square), _seconds(_onednn, square, square, None, "none")) for _ in range(10)]
    plain, onednn = np.min(rounds, axis=0)
    return bool(plain > 1.25 * onednn)


def _seconds(multiply: Callable[..., Tensor], *factors: object) -> float:
    started = time.perf_counter()
    multiply(*factors)
    return time.perf_counter() - started


def bounded_log_std(raw: Tensor) -> Tensor:
    """Squash the network's output into [LOG_STD_MIN, LOG_STD_MAX], elementwise and smoothly."""
    return LOG_STD_MIN + 0.5 * (LOG_STD_MAX - LOG_STD_MIN) * (torch.tanh(raw) + 1.0)


def draw_action(raw: Vector, noise: Vector) -> Vector:
    """Action of one state, as `tanh_gaussian` has it for a batch.

    Args:
      raw: the policy network's output, μ and what `bounded_log_std` squashes, `2 action_size`.
      noise: ε, standard normal, `action_size`; 0 for the middle of the policy.

    Returns:
      Action in [-1, 1], `action_size`.
    """
    mean, raw_log_std = np.split(raw, 2)
    log_std = LOG_STD_MIN + 0.5 * (LOG_STD_MAX - LOG_STD_MIN) * (np.tanh(raw_log_std) + 1.0)
    return np.tanh(mean + np.exp(log_std) * noise)


def tanh_gaussian(mean: Tensor, log_std: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
    """Reparameterised action and its exact log-probability.

    a = tanh(u),  u = μ + σ ε
    log π(a|s) = Σ_k [-ε_k²/2 - log σ_k - log(2π)/2 - log(1 - tanh² u_k)]
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
    log_normal = -0.5 * noise.square() - log_std - 0.5 * math.log(2.0 * math.pi)
    log_jacobian = 2.0 * (math.log(2.0) - unsquashed - F.softplus(-2.0 * unsquashed))
    return torch.tanh(unsquashed), (log_normal - log_jacobian).sum(dim=-1)


def tanh_gaussian_gradient(
    raw: Tensor, noise: Tensor, action: Tensor, action_gradient: Tensor, log_prob_gradient: Tensor | float
) -> Tensor:
    """Gradient of a loss in the policy network's output, from those in the action and in its log-probability.

    ∂a/∂u = 1 - a²,  ∂log π/∂u = 2a,  ∂u/∂μ = 1,  ∂u/∂log σ = σ ε,  ∂log π/∂log σ = 2a σ ε - 1

    Args:
      raw: the network's output, μ and what `bounded_log_std` squashes, `batch x 2 action_size`.
      noise: ε that the action was drawn with, `batch x action_size`.
      action: a, `batch x action_size`.
      action_gradient: ∂L/∂a, `batch x action_size`.
      log_prob_gradient: ∂L/∂log π, the same for the whole batch.

    Returns:
      `batch x 2 action_size`.
    """
    raw_log_std = raw.chunk(2, dim=-1)[1]
    unsquashed = action_gradient * (1.0 - action.square()) + 2.0 * log_prob_gradient * action  # ∂L/∂u
    log_std = unsquashed * bounded_log_std(raw_log_std).exp() * noise - log_prob_gradient
    slope = 0.5 * (LOG_STD_MAX - LOG_STD_MIN) * (1.0 - torch.tanh(raw_log_std).square())
    return torch.cat((unsquashed, log_std * slope), dim=-1)
