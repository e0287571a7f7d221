import pytest
import torch

from risk_sac.agents.ddpg import actor_loss, deterministic_target


def test_deterministic_target_of_a_hand_computed_case() -> None:
    target = deterministic_target(torch.tensor([1.0, 1.0]), torch.tensor([0.0, 1.0]), torch.tensor([3.0, 3.0]), 0.9)
    assert target.tolist() == pytest.approx([1.0 + 0.9 * 3.0, 1.0])


def test_the_gradient_of_the_actor_loss_is_that_of_the_loss() -> None:
    generator = torch.Generator().manual_seed(0)
    raw = torch.randn(7, 3, generator=generator).requires_grad_()
    pull, weight = torch.randn(7, 3, generator=generator), torch.rand(7, generator=generator)
    action = torch.tanh(raw)
    values = (pull * action.square()).sum(dim=1)
    loss, gradient = actor_loss(action, values, (2.0 * pull * action).detach(), weight)
    loss.backward()
    torch.testing.assert_close(gradient.detach(), raw.grad)
