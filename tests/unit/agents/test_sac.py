import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.agents.networks import bounded_log_std, tanh_gaussian
from risk_sac.agents.sac import Sample, actor_loss, soft_target, temperature_loss


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


def sample_of(raw: torch.Tensor, noise: torch.Tensor) -> Sample:
    mean, raw_log_std = raw.chunk(2, dim=1)
    return Sample(raw, noise, *tanh_gaussian(mean, bounded_log_std(raw_log_std), noise))


def test_actor_loss_of_a_hand_computed_case() -> None:
    log_prob, values, weight = torch.tensor([[-1.0, 1.0], [1.0, 0.0], [1.5, 0.5]])
    still = Sample(torch.zeros(2, 2), torch.zeros(2, 1), torch.tensor([[0.0], [0.5]]), log_prob)
    loss, gradient = actor_loss(still, values, torch.tensor([[2.0], [4.0]]), weight, torch.tensor(0.5))
    assert loss.item() == pytest.approx((1.5 * (-0.5 - 1.0) + 0.5 * (0.5 - 0.0)) / 2)
    # In μ: w (α 2a - Q' (1 - a²)) / 2. In what log σ is squashed from, without noise: -w α 3.5 / 2.
    in_mean, in_log_std = gradient.T
    assert in_mean.tolist() == pytest.approx([1.5 * (0.0 - 2.0) / 2, 0.5 * (0.5 - 3.0) / 2])
    assert in_log_std.tolist() == pytest.approx([-1.5 * 0.5 * 3.5 / 2, -0.5 * 0.5 * 3.5 / 2])


@given(st.integers(0, 1000))
def test_the_gradient_of_the_actor_loss_is_that_of_the_loss(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    raw = torch.randn(7, 6, generator=generator, dtype=torch.float64).mul_(2.0).requires_grad_()
    noise, pull = torch.randn(2, 7, 3, generator=generator, dtype=torch.float64)
    weight, temperature = torch.rand(7, generator=generator, dtype=torch.float64), torch.tensor(0.3)
    sample = sample_of(raw, noise)
    values = (pull * sample.action.square()).sum(dim=1)
    slope = (2.0 * pull * sample.action).detach()
    loss, gradient = actor_loss(sample, values, slope, weight, temperature)
    loss.backward()
    torch.testing.assert_close(gradient.detach(), raw.grad)


def test_temperature_falls_while_entropy_exceeds_its_target_and_rises_below() -> None:
    for entropy, sign in ((3.0, 1.0), (-3.0, -1.0)):
        _, gradient = temperature_loss(torch.tensor(0.2), torch.tensor(entropy), target_entropy=-2.0)
        # dJ/dlog α = α (entropy - H̄)
        assert gradient.item() == pytest.approx(0.2 * (entropy + 2.0))
        assert math.copysign(1.0, gradient.item()) == sign


def test_the_gradient_of_the_temperature_loss_is_that_of_the_loss() -> None:
    log_temperature = torch.tensor(-1.3, requires_grad=True)
    log_prob = torch.tensor([0.4, 2.0, -1.0])
    loss, gradient = temperature_loss(log_temperature.exp(), -log_prob.mean(), target_entropy=2.0)
    loss.backward()
    assert loss.item() == pytest.approx((-math.exp(-1.3) * (log_prob + 2.0)).mean().item())
    assert gradient.item() == pytest.approx(log_temperature.grad.item())
