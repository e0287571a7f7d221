import copy
import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.distributions import Independent, Normal, TanhTransform, TransformedDistribution

from risk_sac.agents import networks
from risk_sac.agents.networks import (
    LOG_STD_MAX,
    LOG_STD_MIN,
    ONEDNN_FROM,
    Mlp,
    bounded_log_std,
    draw_action,
    tanh_gaussian,
    tanh_gaussian_gradient,
)
from tests.unit.agents.plain import PlainMlp


def test_log_prob_of_a_hand_computed_case() -> None:
    action, log_prob = tanh_gaussian(torch.tensor([[0.0]]), torch.tensor([[0.0]]), torch.tensor([[1.0]]))
    # tanh(1) = 0.76159; log N(1; 0, 1) = -1.41894; log(1 - tanh(1)²) = -0.86756
    assert action.item() == pytest.approx(0.7615942)
    assert log_prob.item() == pytest.approx(-1.4189385 + 0.8675617)


@given(
    st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 1), st.floats(-3, 3)), min_size=1, max_size=6),
)
def test_log_prob_agrees_with_torch_distributions(rows: list[tuple[float, float, float]]) -> None:
    mean, log_std, noise = torch.tensor(rows, dtype=torch.float64).T.unsqueeze(1)  # each 1 x action_size
    base = Independent(Normal(mean, log_std.exp()), 1)
    reference = TransformedDistribution(base, TanhTransform(cache_size=1))
    action, log_prob = tanh_gaussian(mean, log_std, noise)
    unsquashed = mean + log_std.exp() * noise
    expected = base.log_prob(unsquashed) - TanhTransform().log_abs_det_jacobian(unsquashed, action).sum(-1)
    torch.testing.assert_close(log_prob, expected)
    if unsquashed.abs().max() < 5.0:  # beyond, the reference loses digits inverting tanh
        torch.testing.assert_close(log_prob, reference.log_prob(action), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(("mean", "log_std"), [(0.0, 0.0), (0.7, -1.0), (-1.0, 0.3)])
def test_density_integrates_to_one_over_the_actions(mean: float, log_std: float) -> None:
    # Midpoints of a grid over (-1, 1) in a = tanh(u), so the Jacobian is what makes the sum 1.
    count = 400_001
    grid = (torch.arange(count, dtype=torch.float64) + 0.5) * (2.0 / count) - 1.0
    noise = ((torch.atanh(grid) - mean) / math.exp(log_std)).unsqueeze(1)
    action, log_prob = tanh_gaussian(torch.full_like(noise, mean), torch.full_like(noise, log_std), noise)
    torch.testing.assert_close(action.squeeze(1), grid)
    assert log_prob.exp().sum().item() * 2.0 / count == pytest.approx(1.0, abs=1e-4)


def test_log_prob_and_its_gradient_stay_finite_where_tanh_saturates() -> None:
    mean = torch.tensor([[40.0, -40.0]], requires_grad=True)
    action, log_prob = tanh_gaussian(mean, torch.zeros(1, 2), torch.zeros(1, 2))
    log_prob.sum().backward()
    assert action.tolist() == [[1.0, -1.0]]
    # log(1 - tanh²(40)) = 2 log 2 - 80
    assert log_prob.item() == pytest.approx(2.0 * (80.0 - 2.0 * math.log(2.0) - 0.5 * math.log(2.0 * math.pi)))
    assert torch.isfinite(mean.grad).all()


@given(st.floats(-1e6, 1e6))
def test_log_std_stays_within_its_bounds(raw: float) -> None:
    assert LOG_STD_MIN <= bounded_log_std(torch.tensor(raw)).item() <= LOG_STD_MAX


# Narrow layers, one column at the end, and layers wide enough for oneDNN where that is faster.
@pytest.mark.parametrize("normalised", [False, True])
@pytest.mark.parametrize(
    ("sizes", "onednn"),
    [
        ((5, 16, 12, 3), False),
        ((5, 16, 12, 1), False),
        ((130, ONEDNN_FROM, 140, 2), False),
        ((130, ONEDNN_FROM, 140, 2), True),
    ],
    ids=str,
)
def test_values_and_gradients_equal_autograd(
    sizes: tuple[int, ...], onednn: bool, normalised: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(networks, "_onednn_is_faster", lambda: onednn)
    generator = torch.Generator().manual_seed(0)
    network = Mlp(sizes, generator, normalised=normalised)
    plain = PlainMlp(network)
    inputs = torch.randn(ONEDNN_FROM, sizes[0], generator=generator, requires_grad=True)
    slope = torch.randn(ONEDNN_FROM, sizes[-1], generator=generator)
    expected = plain(inputs)
    expected.backward(slope)
    evaluated = network.forward(inputs.detach())
    torch.testing.assert_close(evaluated.output, expected.detach(), rtol=1e-5, atol=1e-5)
    network.backward(evaluated, slope)
    torch.testing.assert_close(network.parameters.grad, plain.gradient(), rtol=1e-5, atol=1e-4)
    columns = slice(2, 5)
    partial = network.input_gradient(evaluated, slope, columns)
    torch.testing.assert_close(partial, inputs.grad[:, columns], rtol=1e-5, atol=1e-5)


def test_a_normalised_layer_has_mean_0_and_variance_1_before_its_relu() -> None:
    network = Mlp((1, 2, 1), torch.Generator().manual_seed(0), normalised=True)
    network.parameters.copy_(torch.tensor([1.0, 3.0, 0.0, 0.0, 1.0, 5.0, 0.5]))  # raw (x, 3x), scaled (-1, 1) for x > 0
    output = network.forward(torch.tensor([[2.0], [70.0], [-4.0]])).output[:, 0]
    assert output.tolist() == pytest.approx([5.5, 5.5, 1.5], abs=1e-4)


def test_a_part_of_a_pass_is_the_pass_of_a_part() -> None:
    generator = torch.Generator().manual_seed(0)
    network = Mlp((5, 16, 12, 3), generator, normalised=True)
    inputs, slope = torch.randn(9, 5, generator=generator), torch.randn(4, 3, generator=generator)
    network.backward(network.forward(inputs[5:]), slope)
    expected = network.parameters.grad.clone()
    network.backward(network.forward(inputs).since(5), slope)
    torch.testing.assert_close(network.parameters.grad, expected)


@given(st.integers(0, 1000))
def test_gradient_through_the_tanh_gaussian_equals_autograd(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    raw = torch.randn(7, 6, generator=generator, dtype=torch.float64).mul_(2.0).requires_grad_()
    noise, slope = torch.randn(2, 7, 3, generator=generator, dtype=torch.float64)
    mean, raw_log_std = raw.chunk(2, dim=1)
    action, log_prob = tanh_gaussian(mean, bounded_log_std(raw_log_std), noise)
    ((slope * action).sum() + 0.3 * log_prob.sum()).backward()
    torch.testing.assert_close(tanh_gaussian_gradient(raw.detach(), noise, action.detach(), slope, 0.3), raw.grad)


def test_initialisation_follows_the_seed_and_leaves_the_global_generator_alone() -> None:
    before = torch.get_rng_state()
    first, same, other = (Mlp((4, 16, 2), torch.Generator().manual_seed(seed)) for seed in (1, 1, 2))
    assert torch.equal(torch.get_rng_state(), before)
    assert torch.equal(first.parameters, same.parameters)
    assert not torch.equal(first.parameters, other.parameters)


def test_initial_weights_fill_the_range_of_a_linear_layer() -> None:
    weight = Mlp((100, 200), torch.Generator().manual_seed(0)).parameters[: 100 * 200]
    assert weight.abs().max().item() == pytest.approx(0.1, rel=1e-3)
    assert weight.std().item() == pytest.approx(0.1 / math.sqrt(3.0), rel=0.02)


def test_a_copy_learns_apart_from_its_original() -> None:
    network = Mlp((3, 4, 1), torch.Generator().manual_seed(0))
    twin = copy.deepcopy(network)
    inputs = torch.ones(1, 3)
    before = network.forward(inputs).output.item()
    twin.parameters.mul_(2.0)  # the layers are views of the flat parameters, in the copy too
    assert twin.forward(inputs).output.item() != pytest.approx(before)
    assert network.forward(inputs).output.item() == before


def test_one_input_gives_what_a_batch_gives() -> None:
    generator = torch.Generator().manual_seed(0)
    network = Mlp((5, 16, 16, 6), generator)
    inputs, noise = torch.randn(40, 5, generator=generator), torch.randn(40, 3, generator=generator)
    raw = network.forward(inputs).output
    mean, raw_log_std = raw.chunk(2, dim=1)
    actions, _ = tanh_gaussian(mean, bounded_log_std(raw_log_std), noise)
    for row in range(40):
        alone = network.respond(inputs[row].numpy())
        assert alone == pytest.approx(raw[row].numpy(), abs=1e-6)
        assert draw_action(alone, noise[row].numpy()) == pytest.approx(actions[row].numpy(), abs=1e-6)
        assert draw_action(alone, noise[row].numpy()).dtype == np.float32


def test_one_input_meets_the_parameters_of_the_moment() -> None:
    network = Mlp((2, 4, 1), torch.Generator().manual_seed(0))
    twin = copy.deepcopy(network)
    network.parameters.zero_()
    assert network.respond(np.ones(2, np.float32)).tolist() == [0.0]
    assert twin.respond(np.ones(2, np.float32)).tolist() != [0.0]
