import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.config import METHODS, LearnerConfig, Requirement, RewardConfig
from risk_sac.records import Grade, Severity
from risk_sac.risk import reward
from risk_sac.risk.reward import (
    broken_hard_rule,
)
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
    """The policy cannot change Σ γ^t F = -φ(s_0); its optimum stays."""
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
