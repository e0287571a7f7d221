import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.agents.lagrangian import DualVariable, dual_step
from risk_sac.config import LagrangianConfig
from risk_sac.errors import NotFinite

CONFIG = LagrangianConfig(initial=0.5, learning_rate=0.1, cost_limit=0.2, maximum=2.0)


def test_dual_step_of_hand_computed_cases() -> None:
    assert dual_step(1.0, 0.7, CONFIG) == pytest.approx(1.05)
    assert dual_step(1.0, 0.1, CONFIG) == pytest.approx(0.99)
    assert dual_step(1.0, 0.2, CONFIG) == 1.0


@given(st.lists(st.floats(0.0, 1e6), max_size=30))
def test_dual_variable_never_goes_negative_nor_above_its_cap(costs: list[float]) -> None:
    dual = DualVariable(CONFIG, enabled=True)
    for cost in costs:
        dual.update(cost)
        assert 0.0 <= dual.value <= CONFIG.maximum


def test_dual_variable_returns_from_the_cap() -> None:
    dual = DualVariable(CONFIG, enabled=True)
    dual.update(1e9)
    assert dual.value == 2.0
    dual.update(0.0)
    assert dual.value == pytest.approx(1.98)


def test_dual_variable_stays_zero_without_a_constraint() -> None:
    dual = DualVariable(CONFIG, enabled=False)
    dual.update(1.0)
    assert dual.value == 0.0


def test_dual_variable_refuses_a_cost_that_is_no_number() -> None:
    with pytest.raises(NotFinite, match="nan"):
        DualVariable(CONFIG, enabled=False).update(float("nan"))
