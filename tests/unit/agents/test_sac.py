import math

import pytest
import torch

from risk_sac.agents.sac import actor_loss, soft_target, temperature_gradient


def test_soft_target_of_a_hand_computed_case() -> None:
    target = soft_target(
        reward=torch.tensor([1.0, 1.0]),
        terminated=torch.tensor([0.0, 1.0]),
        next_values=torch.tensor([[3.0, 3.0], [5.0, 5.0]]),
        next_log_prob=torch.tensor([-2.0, -2.0]),
        temperature=torch.tensor(0.5),
        discount=0.9,
    )
    assert target.tolist() == pytest.approx([1.0 + 0.9 * (3.0 + 1.0), 1.0])


def test_actor_loss_of_a_hand_computed_case() -> None:
    log_prob, values, weight = torch.tensor([[-1.0, 1.0], [1.0, 0.0], [1.5, 0.5]])
    loss = actor_loss(log_prob, values, weight, torch.tensor(0.5))
    assert loss.item() == pytest.approx((1.5 * (-0.5 - 1.0) + 0.5 * (0.5 - 0.0)) / 2)


def test_temperature_falls_while_entropy_exceeds_its_target_and_rises_below() -> None:
    for entropy, sign in ((3.0, 1.0), (-3.0, -1.0)):
        gradient = temperature_gradient(torch.tensor(0.2), torch.tensor(entropy), target_entropy=-2.0)
        # dJ/dlog α = α (entropy - H̄)
        assert gradient.item() == pytest.approx(0.2 * (entropy + 2.0))
        assert math.copysign(1.0, gradient.item()) == sign


def test_temperature_gradient_is_that_of_its_loss() -> None:
    log_temperature = torch.tensor(-1.3, requires_grad=True)
    log_prob = torch.tensor([0.4, 2.0, -1.0])
    (-log_temperature.exp() * (log_prob + 2.0)).mean().backward()
    gradient = temperature_gradient(log_temperature.detach().exp(), -log_prob.mean(), target_entropy=2.0)
    assert gradient.item() == pytest.approx(log_temperature.grad.item())
