import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.agents.lagrangian import dual_step
from risk_sac.config import LagrangianConfig

CONFIG = LagrangianConfig(initial=0.5, learning_rate=0.1, cost_limit=0.2, maximum=2.0)


def test_dual_step_of_hand_computed_cases() -> None:
    assert dual_step(1.0, 0.7, CONFIG) == pytest.approx(1.05)
    assert dual_step(1.0, 0.1, CONFIG) == pytest.approx(0.99)
    assert dual_step(1.0, 0.2, CONFIG) == 1.0
    assert dual_step(1.0, 1e9, CONFIG) == 2.0
    assert dual_step(2.0, 0.0, CONFIG) == pytest.approx(1.98)  # it comes back from the cap


@given(st.lists(st.floats(0.0, 1e6), max_size=30))
def test_dual_variable_never_goes_negative_nor_above_its_cap(costs: list[float]) -> None:
    dual_variable = CONFIG.initial
    for cost in costs:
        dual_variable = dual_step(dual_variable, cost, CONFIG)
        assert 0.0 <= dual_variable <= CONFIG.maximum
