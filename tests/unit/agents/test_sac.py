"""Losses and targets of SAC and DDPG by hand."""

import pytest
import torch

from risk_sac.agents.agent import critic_loss, td_target
from risk_sac.agents.sac import actor_loss, soft_value, temperature_loss


def test_target_and_soft_value_of_a_hand_computed_case() -> None:
    next_values, log_prob = torch.tensor([[3.0, 3.0], [5.0, 2.0]]), torch.tensor([-2.0, 1.0])
    value = soft_value(next_values, log_prob, torch.tensor(0.5))
    assert value.tolist() == [3.0 + 1.0, 2.0 - 0.5]
    target = td_target(torch.tensor([1.0, 1.0]), torch.tensor([0.0, 1.0]), value, 0.9)
    assert target.tolist() == pytest.approx([1.0 + 0.9 * 4.0, 1.0])


def test_critic_loss_of_a_hand_computed_case() -> None:
    # First critic: ½ mean(1·4, ½·0) = 1; second: ½ mean(1·1, ½·16) = 2.25.
    assert critic_loss(torch.tensor([[2.0, 0.0], [1.0, 4.0]]), torch.tensor([1.0, 0.5])).item() == 3.25


def test_actor_loss_of_a_hand_computed_case() -> None:
    loss = actor_loss(torch.tensor([1.5, -0.5]), torch.tensor([1.5, 0.5]))
    assert loss.item() == pytest.approx((1.5 * -1.5 + 0.5 * 0.5) / 2)


def test_temperature_falls_while_entropy_exceeds_its_target_and_rises_below() -> None:
    for entropy in (3.0, -3.0):
        log_temperature = torch.tensor(-1.3, requires_grad=True)
        temperature = log_temperature.exp()
        temperature_loss(temperature, torch.tensor(entropy), target_entropy=-2.0).backward()
        # dJ/dlog α = α (entropy - H̄)
        assert log_temperature.grad.item() == pytest.approx(temperature.item() * (entropy + 2.0))
