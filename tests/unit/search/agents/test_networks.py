"""Losses and targets of SAC and DDPG by hand."""

import copy
import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.distributions import Independent, Normal, TanhTransform, TransformedDistribution
from torch.nn.functional import layer_norm

from risk_sac.config import LagrangianConfig
from risk_sac.search.agents.agent import critic_loss, td_target
from risk_sac.search.agents.learner import dual_step
from risk_sac.search.agents.networks import Mlp, bounded_log_std, tanh_gaussian
from risk_sac.search.agents.sac import actor_loss, soft_value, temperature_loss
from risk_sac.search.frozen_policy import LOG_STD_MAX, LOG_STD_MIN


def test_log_prob_of_a_hand_computed_case():
    action, log_prob = tanh_gaussian(torch.tensor([[0.0]]), torch.tensor([[0.0]]), torch.tensor([[1.0]]))
    # tanh(1) = 0.76159; log N(1; 0, 1) = -1.41894; log(1 - tanh(1)²) = -0.86756
    assert action.item() == pytest.approx(0.7615942)
    assert log_prob.item() == pytest.approx(-1.4189385 + 0.8675617)


@given(st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 1), st.floats(-3, 3)), min_size=1, max_size=6))
def test_log_prob_agrees_with_torch_distributions(rows):
    mean, log_std, noise = torch.tensor(rows, dtype=torch.float64).T.unsqueeze(1)  # each 1 x action_size
    base = Independent(Normal(mean, log_std.exp()), 1)
    reference = TransformedDistribution(base, TanhTransform(cache_size=1))
    action, log_prob = tanh_gaussian(mean, log_std, noise)
    unsquashed = mean + log_std.exp() * noise
    expected = base.log_prob(unsquashed) - TanhTransform().log_abs_det_jacobian(unsquashed, action).sum(-1)
    torch.testing.assert_close(log_prob, expected)
    if unsquashed.abs().max() < 5.0:  # beyond, the reference loses digits inverting tanh
        torch.testing.assert_close(log_prob, reference.log_prob(action), rtol=1e-6, atol=1e-6)


def test_log_prob_and_its_gradient_stay_finite_where_tanh_saturates():
    mean = torch.tensor([[40.0, -40.0]], requires_grad=True)
    action, log_prob = tanh_gaussian(mean, torch.zeros(1, 2), torch.zeros(1, 2))
    log_prob.sum().backward()
    assert action.tolist() == [[1.0, -1.0]]
    # log(1 - tanh²(40)) = 2 log 2 - 80
    assert log_prob.item() == pytest.approx(2.0 * (80.0 - 2.0 * math.log(2.0) - 0.5 * math.log(2.0 * math.pi)))
    assert torch.isfinite(mean.grad).all()


@pytest.mark.parametrize("normalised", [False, True])
def test_stacked_networks_equal_separate_ones_in_values_and_gradients(normalised):
    generator = torch.Generator().manual_seed(0)
    stacked = Mlp((5, 16, 12, 3), generator, count=2, normalised=normalised)
    inputs, slope = torch.randn(9, 5, generator=generator), torch.randn(2, 9, 3, generator=generator)
    output = stacked(inputs)
    found = torch.autograd.grad(output, list(stacked.parameters()), slope)
    for each in range(2):
        separate = [parameter[each].detach().clone().requires_grad_() for parameter in stacked.parameters()]
        hidden = inputs
        for weight, bias in zip(separate[:-2:2], separate[1:-2:2], strict=True):
            hidden = hidden @ weight + bias
            hidden = torch.relu(layer_norm(hidden, hidden.shape[1:]) if normalised else hidden)
        expected = hidden @ separate[-2] + separate[-1]
        torch.testing.assert_close(output[each], expected)
        gradients = torch.autograd.grad(expected, separate, slope[each])
        for one, other in zip(found, gradients, strict=True):
            torch.testing.assert_close(one[each], other, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("normalised", [False, True])
def test_one_input_gives_what_a_batch_gives_even_after_a_copy_or_a_change(normalised):
    generator = torch.Generator().manual_seed(0)
    network = Mlp((5, 16, 16, 6), generator, normalised=normalised)
    twin = copy.deepcopy(network)
    for parameter in twin.parameters():
        parameter.data.mul_(2.0)
    inputs = torch.randn(40, 5, generator=generator)
    for each in (network, twin):
        batch = each(inputs)[0].detach().numpy()
        alone = np.stack([each.respond(row.numpy()).numpy() for row in inputs])
        np.testing.assert_allclose(alone, batch, atol=1e-5)
    assert not torch.allclose(network(inputs), twin(inputs))


def test_target_and_soft_value_of_a_hand_computed_case():
    next_values, log_prob = torch.tensor([[3.0, 3.0], [5.0, 2.0]]), torch.tensor([-2.0, 1.0])
    value = soft_value(next_values, log_prob, torch.tensor(0.5))
    assert value.tolist() == [3.0 + 1.0, 2.0 - 0.5]
    target = td_target(torch.tensor([1.0, 1.0]), torch.tensor([0.0, 1.0]), value, 0.9)
    assert target.tolist() == pytest.approx([1.0 + 0.9 * 4.0, 1.0])


def test_critic_loss_of_a_hand_computed_case():
    # First critic: ½ mean(1·4, ½·0) = 1; second: ½ mean(1·1, ½·16) = 2.25.
    assert critic_loss(torch.tensor([[2.0, 0.0], [1.0, 4.0]]), torch.tensor([1.0, 0.5])).item() == 3.25


def test_a_huber_loss_is_linear_in_errors_above_1():
    # First critic: mean(1·1.5, ½·0) = 0.75; second: mean(1·½, ½·3.5) = 1.125.
    td_errors, weight = torch.tensor([[2.0, 0.0], [1.0, -4.0]]), torch.tensor([1.0, 0.5])
    assert critic_loss(td_errors, weight, "huber").item() == 0.75 + 1.125


def test_actor_loss_of_a_hand_computed_case():
    loss = actor_loss(torch.tensor([1.5, -0.5]), torch.tensor([1.5, 0.5]))
    assert loss.item() == pytest.approx((1.5 * -1.5 + 0.5 * 0.5) / 2)


def test_temperature_falls_while_entropy_exceeds_its_target_and_rises_below():
    for entropy in (3.0, -3.0):
        log_temperature = torch.tensor(-1.3, requires_grad=True)
        temperature = log_temperature.exp()
        temperature_loss(temperature, torch.tensor(entropy), target_entropy=-2.0).backward()
        # dJ/dlog α = α (entropy - H̄)
        assert log_temperature.grad.item() == pytest.approx(temperature.item() * (entropy + 2.0))


CONFIG = LagrangianConfig(initial=0.5, learning_rate=0.1, cost_limit=0.2, maximum=2.0)


def test_dual_step_of_hand_computed_cases():
    assert dual_step(1.0, 0.7, CONFIG) == pytest.approx(1.05)
    assert dual_step(1.0, 0.1, CONFIG) == pytest.approx(0.99)
    assert dual_step(1.0, 0.2, CONFIG) == 1.0
    assert dual_step(1.0, 1e9, CONFIG) == 2.0
    assert dual_step(2.0, 0.0, CONFIG) == pytest.approx(1.98)  # it comes back from the cap


@given(st.lists(st.floats(0.0, 1e6), max_size=30))
def test_dual_variable_never_goes_negative_nor_above_its_cap(costs):
    dual_variable = CONFIG.initial
    for cost in costs:
        dual_variable = dual_step(dual_variable, cost, CONFIG)
        assert 0.0 <= dual_variable <= CONFIG.maximum


@given(st.floats(-1e6, 1e6))
def test_log_std_stays_within_its_bounds(raw):
    assert LOG_STD_MIN <= bounded_log_std(torch.tensor(raw)).item() <= LOG_STD_MAX
