"""Hidden layers that are normalised before their ReLU, and the way back.

Compiled: torch takes three operators there and as many back, and three times as long.

Source: Ba, Kiros and Hinton, "Layer normalization", 2016, without gains and biases of its own.
"""

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from risk_sac.jit import compiled_in_any_order

Rows = NDArray[np.float32]
EPSILON = np.float32(1e-5)  # added to a row's variance, as `nn.LayerNorm` does


class Normalised(NamedTuple):
    """A hidden layer: mean 0 and variance 1 in each row, before the ReLU."""

    scaled: Tensor  # z, `batch x width`
    inverse_deviation: Tensor  # 1/σ, `batch`


def normalised_relu(raw: Tensor, bias: Tensor) -> tuple[Tensor, Normalised]:
    """What the next layer is given, and what the way back needs.

    z = (x + b - mean) / σ,  σ² = mean of (x + b - mean)² + ε over the row

    Args:
      raw: x, `batch x width`; z is written over it.
      bias: b, `width`.

    Returns:
      max(0, z), `batch x width`, and z with 1/σ.
    """
    if raw.is_cuda:
        return uncompiled_normalised_relu(raw, bias)
    result, inverse = torch.empty_like(raw), torch.empty(raw.shape[0])
    _forward(raw.numpy(), bias.numpy(), result.numpy(), inverse.numpy())
    return result, Normalised(raw, inverse)


def before_normalised_relu(gradient: Tensor, layer: Normalised) -> Tensor:
    """Gradient in x, from that in max(0, z).

    ∂L/∂x = (g - mean of g - z · mean of g z) / σ,  g = ∂L/∂z, which is 0 where z is negative

    Args:
      gradient: `batch x width`.
      layer: as `normalised_relu` returned it.

    Returns:
      `batch x width`.
    """
    if gradient.is_cuda:
        return uncompiled_before_normalised_relu(gradient, layer)
    result = torch.empty_like(gradient)
    _backward(gradient.numpy(), layer.scaled.numpy(), layer.inverse_deviation.numpy(), result.numpy())
    return result


def uncompiled_normalised_relu(raw: Tensor, bias: Tensor) -> tuple[Tensor, Normalised]:
    """See `normalised_relu`; on any device."""
    shifted = raw + bias
    inverse = torch.rsqrt(shifted.var(dim=1, correction=0) + float(EPSILON))
    scaled = (shifted - shifted.mean(dim=1, keepdim=True)) * inverse[:, None]
    return scaled.relu(), Normalised(scaled, inverse)


def uncompiled_before_normalised_relu(gradient: Tensor, layer: Normalised) -> Tensor:
    """See `before_normalised_relu`; on any device."""
    slope = gradient * (layer.scaled > 0.0)
    along = (slope * layer.scaled).mean(dim=1, keepdim=True) * layer.scaled
    return (slope - slope.mean(dim=1, keepdim=True) - along) * layer.inverse_deviation[:, None]


@compiled_in_any_order
def _forward(rows: Rows, bias: Rows, result: Rows, inverse_deviation: Rows) -> None:
    count, width = rows.shape
    share = np.float32(1.0) / np.float32(width)
    for i in range(count):
        total = np.float32(0.0)
        for j in range(width):
            shifted = rows[i, j] + bias[j]
            rows[i, j] = shifted
            total += shifted
        mean, squares = total * share, np.float32(0.0)
        for j in range(width):
            centred = rows[i, j] - mean
            rows[i, j] = centred
            squares += centred * centred
        inverse = np.float32(1.0) / np.sqrt(squares * share + EPSILON)
        inverse_deviation[i] = inverse
        for j in range(width):
            rows[i, j] *= inverse
            result[i, j] = max(rows[i, j], np.float32(0.0))


@compiled_in_any_order
def _backward(gradient: Rows, scaled: Rows, inverse_deviation: Rows, result: Rows) -> None:
    rows, width = gradient.shape
    share = np.float32(1.0) / np.float32(width)
    for i in range(rows):
        total, along = np.float32(0.0), np.float32(0.0)
        for j in range(width):
            slope = gradient[i, j] if scaled[i, j] > np.float32(0.0) else np.float32(0.0)
            result[i, j] = slope
            total += slope
            along += slope * scaled[i, j]
        mean, along, inverse = total * share, along * share, inverse_deviation[i]
        for j in range(width):
            result[i, j] = (result[i, j] - mean - scaled[i, j] * along) * inverse
