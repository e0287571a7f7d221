"""Adam against torch's own."""

import copy

import pytest
import torch
from torch import Tensor

from risk_sac.agents.adam import Adam

RATES = (1e-3, 3e-4)


def parameters() -> list[Tensor]:
    return [torch.linspace(-1.0, 1.0, 50), torch.tensor([0.5])]


def pushed(moved: list[Tensor], seed: int) -> None:
    """Gives every parameter a gradient."""
    generator = torch.Generator().manual_seed(seed)
    for each in moved:
        each.grad = 10.0 ** (seed % 5 - 2) * torch.randn(each.shape, generator=generator)


def test_moves_as_torchs_own() -> None:
    ours, theirs = parameters(), parameters()
    adam = Adam(ours, RATES)
    groups = [{"params": [each], "lr": rate} for each, rate in zip(theirs, RATES, strict=True)]
    reference = torch.optim.Adam(groups)
    for seed in range(200):
        pushed(ours, seed)
        pushed(theirs, seed)
        adam.step()
        reference.step()
    for mine, other, before in zip(ours, theirs, parameters(), strict=True):
        assert torch.allclose(mine, other, rtol=1e-5, atol=1e-6)
        assert not torch.allclose(mine, before, rtol=1e-2)


def test_goes_on_from_its_state_bit_for_bit() -> None:
    ours = parameters()
    adam = Adam(ours, RATES)
    for seed in range(5):
        pushed(ours, seed)
        adam.step()
    again = [each.clone() for each in ours]
    resumed = Adam(again, RATES)
    resumed.load(copy.deepcopy(adam.state()))
    for seed in range(5, 9):
        pushed(ours, seed)
        pushed(again, seed)
        adam.step()
        resumed.step()
    assert all(map(torch.equal, ours, again))


def test_a_parameter_without_a_gradient_is_refused() -> None:
    with pytest.raises(RuntimeError, match="gradient"):
        Adam(parameters(), RATES).step()
