import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config import METHODS, LearnerConfig, Requirement, RewardConfig
from risk_sac.records import Grade, Severity
from risk_sac.risk import reward
from risk_sac.risk.realism import (
    acceleration_term,
    broken_hard_rule,
    closeness_term,
    jerk_term,
    lateral_accel,
    soft_cost,
)
from risk_sac.world.types import ACCEL, LATERAL, STEP_S, WIDTH
from tests.builders import collision, judgement

CONFIG = RewardConfig(
    valid_collision=10, violation=4, degenerate_collision=2, ttc_weight=0.1, ttc_scale_s=2.0, rss_weight=0.05
)


def test_risk_reward_adds_its_terms():
    dense = 0.1 * math.exp(-0.5)
    assert reward.risk_reward(1.0, -1.0, 1.0, 0.0, 0.0, CONFIG) == pytest.approx(10.05 + dense)
    assert reward.risk_reward(1.0, 1.0, 0.0, 1.0, 0.0, CONFIG) == pytest.approx(dense - 2.0)
    assert reward.risk_reward(1.0, 1.0, 0.0, 0.0, 0.5, CONFIG) == pytest.approx(dense + 2.0)


def test_degenerate_contact_never_pays_more_than_no_contact():
    for ttc_s in (0.0, 0.5, 10.0):
        contact = reward.risk_reward(ttc_s, -1.0, 0.0, 1.0, 0.0, CONFIG)
        assert contact < reward.risk_reward(ttc_s, 1.0, 0.0, 0.0, 0.0, CONFIG)


def test_a_violation_is_paid_once_by_its_depth_and_only_after_the_release():
    counts = {"no_contact": "failure", "on_red": "failure", "gap": "report", "slow": "failure"}
    violated = reward.ViolationDepth(
        [Requirement(name=name, formula="1 > 0", counts=how) for name, how in counts.items()]
    )
    violated.begin(np.array([1.0, 1.0, 1.0, -0.25]))
    steps = [[0.0, 0.4, -2.0, -0.25], [0.0, -0.3, -2.0, 1.0], [0.0, 0.5, 1.0, -0.5], [-1.0, -3.0, 1.0, -0.5]]
    gained = [violated.gained(np.array(robustness)) for robustness in steps]
    assert gained == pytest.approx([0.0, 0.3, 0.25, 0.7])


def test_floats_arrays_and_tensors_agree():
    columns = [[0.5, 3.0], [-1.0, 2.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.4]]
    floats = [reward.risk_reward(*row, CONFIG) for row in zip(*columns, strict=True)]
    arrays = reward.risk_reward(*map(np.array, columns), CONFIG)
    tensors = reward.risk_reward(*(torch.tensor(c, dtype=torch.float64) for c in columns), CONFIG)
    np.testing.assert_allclose(arrays, floats, rtol=1e-15)
    np.testing.assert_allclose(tensors.numpy(), floats, rtol=1e-7)  # torch raises e to a power in single precision


def test_penalised_reward_is_equation_3():
    assert reward.penalised_reward(1.0, 0.4, 2.5) == 0.0
    assert reward.penalised_reward(1.0, 0.4, 0.0) == 1.0


def test_shaped_reward_is_equation_8_to_the_letter_when_nothing_is_terminal():
    # R - γ ρ(s') + ρ(s) = 1 - 0.5 · 3 + 2
    assert reward.shaped_reward(1.0, 2.0, 3.0, 0.5, 0.0) == 1.5


def test_terminal_states_have_potential_zero():
    assert reward.shaped_reward(1.0, 2.0, -3.0, 0.5, 1.0) == 3.0
    shaped = reward.shaped_reward(*(torch.tensor([x, x]) for x in (1.0, 2.0, -3.0)), 0.5, torch.tensor([0.0, 1.0]))
    assert shaped.tolist() == [4.5, 3.0]


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=50), st.floats(0.5, 0.999))
def test_shaping_of_an_episode_telescopes_to_the_first_states_potential(robustness, g):
    """The policy cannot change Σ γ^t F = -φ(s_0), so the optimal policy stays the same."""
    last = len(robustness) - 2
    total = sum(
        g**t * reward.shaped_reward(0.0, robustness[t], robustness[t + 1], g, float(t == last)) for t in range(last + 1)
    )
    assert total == pytest.approx(robustness[0], abs=1e-9)


def test_the_training_reward_is_shaped_only_for_methods_that_shape():
    parts = (1.0, 0.4, 2.0, -3.0)  # R_risk, C_soft, ρ(s), ρ(s')
    config = LearnerConfig.model_validate({"agent": {"discount": 0.5}})
    plain, shaped = (reward.TrainingReward(METHODS[name], config) for name in ("sac-lag", "risk-sac"))
    assert plain(*parts, 0.0, 2.5) == 0.0
    assert shaped(*parts, 0.0, 2.5) == 3.5
    assert shaped(*parts, 1.0, 2.5) == 2.0


def test_the_training_reward_takes_equation_8_to_the_letter_if_told():
    told = {"agent": {"discount": 0.5}, "reward": {"zero_terminal_potential": False}}
    to_the_letter = reward.TrainingReward(METHODS["risk-sac"], LearnerConfig.model_validate(told))
    assert to_the_letter(1.0, 0.4, 2.0, -3.0, 1.0, 2.5) == 3.5


@pytest.mark.parametrize(
    ("grade", "severity", "share"),
    [
        (Grade.PREVENTABLE, Severity.SEVERE, 1.0),
        (Grade.PREVENTABLE, Severity.MINOR, 0.5),
        (Grade.FULL_BRAKING, Severity.MODERATE, 0.5),
        (Grade.UNAVOIDABLE, Severity.MINOR, 0.125),
    ],
)
def test_a_contact_is_worth_less_the_less_it_says_of_the_ego_and_less_again_if_it_is_minor(grade, severity, share):
    assert reward.worth(collision(judgement=judgement(grade, severity=severity)), RewardConfig()) == share


def test_jerk_costs_beyond_what_ordinary_drivers_do():
    # of a limit of 8 m/s² that builds up in 0.4 s: 20 m/s³, of which 15 are free
    assert jerk_term(1.5, 0.0, 8.0) == 0.0
    assert jerk_term(1.75, 0.0, 8.0) == pytest.approx(0.5)
    assert jerk_term(0.0, 1.75, 8.0) == pytest.approx(0.5)
    assert jerk_term(8.0, -8.0, 8.0) == 1.0


def test_acceleration_costs_only_beyond_comfort():
    assert acceleration_term(-4.5, 0.0, 8.0) == 0.0
    assert acceleration_term(-6.25, 0.0, 8.0) == pytest.approx(0.5)  # half way from 4.5 to 8
    assert acceleration_term(8.0, 0.0, 8.0) == 1.0
    assert acceleration_term(9.0, 0.0, 8.0) == 1.0


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_swerving_costs_like_braking(side):
    assert acceleration_term(0.0, side * 0.75, 8.0) == 0.0
    assert acceleration_term(0.0, side * 1.125, 8.0) == pytest.approx(0.5)
    assert acceleration_term(-6.25, side * 1.5, 8.0) == 1.0  # the larger of the two


def test_what_is_across_is_a_vehicles_change_of_lateral_speed_and_a_pedestrians_turn():
    assert lateral_accel(0.5, 0.4, 0.3, 10.0, False) == pytest.approx(1.0)  # 0.1 m/s in 0.1 s
    # 1.5 m/s · 1 rad/s, past the seam at π
    assert lateral_accel(9.0, 9.0, 0.1 - 2 * math.pi, 1.5, True) == pytest.approx(1.5)


def test_closeness_costs_what_is_both_near_and_sudden():
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


def test_soft_cost_is_the_mean_of_the_worst_terms_in_which_jerk_counts_double():
    # jerk 0.5 of the first, excess 0.5 and no jerk of the second, closeness 0.375 of the second
    cost = cost_of((1.75, 20.0, 0.0, 20.0, 0.0, 8.0), (-6.25, 0.5, -6.25, 1.25, 0.0, 8.0))
    assert cost == pytest.approx((2 * 0.5 + 0.5 + 0.375) / 4)


accels, gaps = st.floats(-50, 50), st.floats(0, 100)


@given(st.lists(st.tuples(accels, gaps, accels, gaps, accels, st.floats(0.1, 12)), max_size=6))
def test_soft_cost_stays_in_the_unit_interval(rows):
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
def test_each_hard_rule_is_named(gap_m, ttc_s, rss_margin, in_conflict, rule):
    assert broken_hard_rule(gap_m, ttc_s, rss_margin, in_conflict=in_conflict) == rule
