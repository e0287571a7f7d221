import torch

from risk_sac.agents.critics import critic_loss


def test_critic_loss_of_a_hand_computed_case() -> None:
    td_errors = torch.tensor([[2.0, 0.0], [1.0, 4.0]])
    loss, gradient = critic_loss(td_errors, torch.tensor([1.0, 0.5]))
    # First critic: ½ mean(1·4, ½·0) = 1; second: ½ mean(1·1, ½·16) = 2.25.
    assert loss.item() == 3.25
    assert gradient.tolist() == [[-1.0, 0.0], [-0.5, -1.0]]


def test_gradient_of_the_critic_loss_equals_autograd() -> None:
    generator = torch.Generator().manual_seed(0)
    values, target = torch.randn(2, 2, 5, generator=generator)
    weight = torch.rand(5, generator=generator)
    values.requires_grad_()
    critic_loss(target - values, weight)[0].backward()
    torch.testing.assert_close(critic_loss(target - values.detach(), weight)[1], values.grad)
