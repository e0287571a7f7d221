import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.risk.realism import (
    acceleration_term,
    broken_hard_rule,
    closeness_term,
    jerk_term,
    lateral_accel,
    soft_cost,
)
from risk_sac.types import ACCEL, LATERAL, STEP_S, WIDTH


def test_jerk_costs_beyond_what_ordinary_drivers_do() -> None:
    # of a limit of 8 m/s² that builds up in 0.4 s: 20 m/s³, of which 15 are free
    assert jerk_term(1.5, 0.0, 8.0) == 0.0
    assert jerk_term(1.75, 0.0, 8.0) == pytest.approx(0.5)
    assert jerk_term(0.0, 1.75, 8.0) == pytest.approx(0.5)
    assert jerk_term(8.0, -8.0, 8.0) == 1.0


def test_acceleration_costs_only_beyond_comfort() -> None:
    assert acceleration_term(-4.5, 0.0, 8.0) == 0.0
    assert acceleration_term(-6.25, 0.0, 8.0) == pytest.approx(0.5)  # half way from 4.5 to 8
    assert acceleration_term(8.0, 0.0, 8.0) == 1.0
    assert acceleration_term(9.0, 0.0, 8.0) == 1.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_swerving_costs_like_braking(side: float) -> None:
    assert acceleration_term(0.0, side * 0.75, 8.0) == 0.0
    assert acceleration_term(0.0, side * 1.125, 8.0) == pytest.approx(0.5)
    assert acceleration_term(-6.25, side * 1.5, 8.0) == 1.0  # the larger of the two


def test_what_is_across_is_a_vehicles_change_of_lateral_speed_and_a_pedestrians_turn() -> None:
    assert lateral_accel(0.5, 0.4, 0.3, 10.0, False) == pytest.approx(1.0)  # 0.1 m/s in 0.1 s
    # 1.5 m/s · 1 rad/s, past the seam at π
    assert lateral_accel(9.0, 9.0, 0.1 - 2 * math.pi, 1.5, True) == pytest.approx(1.5)


def test_closeness_costs_what_is_both_near_and_sudden() -> None:
    assert closeness_term(0.5, 1.25) == pytest.approx(0.375)  # nearness 0.75, closing at 7.5 of 15 m/s
    assert closeness_term(0.5, 0.5) == 0.0  # near, standing
    assert closeness_term(0.5, 2.0) == pytest.approx(0.75)
    assert closeness_term(30.0, 33.0) == 0.0  # fast, far
    assert closeness_term(0.5, 0.2) == 0.0  # opening
    assert closeness_term(0.0, 9.0) == 1.0


def cost_of(*adversaries: tuple[float, ...]) -> float:
    """C_soft; of each acceleration and gap, now and before, lateral acceleration and limit."""
    rows = np.array(adversaries).reshape(-1, 6).T
    accel, gap, accel_before, gap_before, across, limit = rows
    n = len(accel)
    now, before = np.zeros((WIDTH + 1, n + 1)), np.zeros((WIDTH + 1, n + 1))
    now[ACCEL, 1:], before[ACCEL, 1:], now[LATERAL, 1:] = accel, accel_before, across * STEP_S
    kind = np.zeros(n + 1, dtype=np.int8)
    return soft_cost(np.arange(1, n + 1), limit, kind, now, gap, before, gap_before)


def test_soft_cost_is_the_mean_of_the_worst_terms_in_which_jerk_counts_double() -> None:
    # jerk 0.5 of the first, excess 0.5 and no jerk of the second, closeness 0.375 of the second
    cost = cost_of((1.75, 20.0, 0.0, 20.0, 0.0, 8.0), (-6.25, 0.5, -6.25, 1.25, 0.0, 8.0))
    assert cost == pytest.approx((2 * 0.5 + 0.5 + 0.375) / 4)


accels, gaps = st.floats(-50, 50), st.floats(0, 100)


@given(st.lists(st.tuples(accels, gaps, accels, gaps, accels, st.floats(0.1, 12)), max_size=6))
def test_soft_cost_stays_in_the_unit_interval(rows: list[tuple[float, ...]]) -> None:
    assert 0.0 <= cost_of(*rows) <= 1.0


@pytest.mark.parametrize(
    ("gap_m", "ttc_s", "rss_margin", "in_conflict", "rule"),
    [
        (0.2, 10.0, 1.0, False, "initial_gap"),
        (5.0, 0.9, 1.0, False, "initial_ttc"),
        (5.0, 2.0, -0.1, False, "initial_rss"),
        (5.0, 2.0, 0.1, True, "initial_conflict"),
        (0.5, 1.0, 0.0, False, None),
    ],
)
def test_each_hard_rule_is_named(
    gap_m: float, ttc_s: float, rss_margin: float, in_conflict: bool, rule: str | None
) -> None:
    assert broken_hard_rule(gap_m, ttc_s, rss_margin, in_conflict=in_conflict) == rule
