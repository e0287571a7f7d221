"""Normalised layers against torch's own, compiled and not."""

import pytest
import torch
from torch import Tensor
from torch.nn.functional import layer_norm

from risk_sac.agents.normalisation import (
    before_normalised_relu,
    normalised_relu,
    uncompiled_before_normalised_relu,
    uncompiled_normalised_relu,
)

WAYS = pytest.mark.parametrize(
    ("forward", "backward"),
    [(normalised_relu, before_normalised_relu), (uncompiled_normalised_relu, uncompiled_before_normalised_relu)],
    ids=["compiled", "uncompiled"],
)


def drawn(rows: int, width: int) -> tuple[Tensor, Tensor, Tensor]:
    generator = torch.Generator().manual_seed(width)
    raw, gradient = 3.0 * torch.randn(2, rows, width, generator=generator) + 1.0
    return raw, torch.randn(width, generator=generator), gradient


@WAYS
@pytest.mark.parametrize("width", [1, 2, 7, 64, 256])
def test_values_and_gradients_equal_torchs(forward, backward, width: int) -> None:
    raw, bias, gradient = drawn(33, width)
    leaf = raw.clone().requires_grad_()
    expected = torch.relu(layer_norm(leaf + bias, (width,)))
    expected.backward(gradient)
    result, layer = forward(raw, bias)
    torch.testing.assert_close(result, expected.detach(), rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(backward(gradient, layer), leaf.grad, rtol=1e-4, atol=1e-5)


@WAYS
def test_a_row_by_hand(forward, backward) -> None:
    result, layer = forward(torch.tensor([[1.0, 3.0]]), torch.tensor([0.0, 2.0]))  # mean 3, deviation 2
    assert result[0].tolist() == pytest.approx([0.0, 1.0], abs=1e-5)
    assert layer.inverse_deviation.tolist() == pytest.approx([0.5], abs=1e-5)
    # g = (0, 4): (g - 2 - z * 2) / 2 = 0: of two entries either says nothing that the other does not
    assert backward(torch.tensor([[9.0, 4.0]]), layer)[0].tolist() == pytest.approx([0.0, 0.0], abs=1e-4)


@WAYS
def test_a_row_of_equal_entries_stays_finite(forward, backward) -> None:
    result, layer = forward(torch.full((1, 4), 5.0), torch.zeros(4))
    assert result.tolist() == [[0.0] * 4]
    assert torch.isfinite(backward(torch.ones(1, 4), layer)).all()


@WAYS
def test_what_is_not_finite_is_not_hidden(forward, backward) -> None:
    result, _ = forward(torch.tensor([[1.0, float("nan"), 2.0]]), torch.zeros(3))
    assert not torch.isfinite(result).all()
