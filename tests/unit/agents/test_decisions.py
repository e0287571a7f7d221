from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.agents.decisions import Decision, Held
from risk_sac.agents.replay import Transition
from risk_sac.risk.reward import shaped_reward

Make = Callable[..., Transition]


def test_an_action_is_held_and_an_episode_begins_with_a_new_one() -> None:
    held, drawn = Held(3), iter(np.arange(10.0))

    def acts(steps: int) -> list[float]:
        return [float(held.act(lambda: np.array([next(drawn)]))[0]) for _ in range(steps)]

    assert acts(7) == [0, 0, 0, 1, 1, 1, 2]
    held.begin()
    assert acts(4) == [3, 3, 3, 4]


def test_three_steps_make_one_transition(transition: Make) -> None:
    decision = Decision(3, 0.5)
    steps = [
        transition(value, risk_reward=value, cost=cost, robustness=value, next_robustness=value + 1.0)
        for value, cost in ((1.0, 0.4), (2.0, 0.2), (4.0, 0.8))
    ]
    assert [decision.add(step) for step in steps[:2]] == [None, None]
    made = decision.add(steps[2])
    assert made is not None
    assert made.risk_reward == 1.0 + 0.5 * 2.0 + 0.25 * 4.0
    assert made.cost == pytest.approx(0.4 + 0.5 * 0.2 + 0.25 * 0.8)
    assert (made.robustness, made.next_robustness) == (1.0, 5.0)
    assert made.observation[0] == 1.0
    assert made.next_observation[0] == 5.0
    np.testing.assert_allclose(made.action, np.mean([step.action for step in steps], axis=0))
    assert decision.add(steps[0]) is None  # the next decision


def test_the_end_of_the_world_completes_a_decision_and_that_of_the_horizon_forgets_it(transition: Make) -> None:
    decision = Decision(3, 0.5)
    decision.add(transition(1.0))
    ended = decision.add(transition(2.0, terminated=True))
    assert ended is not None
    assert (ended.risk_reward, ended.terminated) == (1.0 + 0.5 * 2.0, True)
    decision.add(transition(8.0))
    decision.begin()  # the horizon cut the decision off
    first, *others = (decision.add(transition(value)) for value in (1.0, 2.0, 4.0))
    assert first is None
    assert others[0] is None
    assert others[1] is not None
    assert others[1].risk_reward == 1.0 + 0.5 * 2.0 + 0.25 * 4.0


@given(robustness=st.lists(st.floats(-3, 3), min_size=5, max_size=5))
def test_shaping_of_a_decision_is_the_discounted_sum_of_its_steps(robustness: list[float]) -> None:
    """sum_i g^i (g phi_{i+1} - phi_i) = g^k phi_k - phi_0."""
    discount = 0.9
    pairs = list(pairwise(robustness))
    each = [shaped_reward(0.0, before, after, discount, 0.0) for before, after in pairs]
    of_all = shaped_reward(0.0, robustness[0], robustness[-1], discount ** len(pairs), 0.0)
    assert sum(discount**i * one for i, one in enumerate(each)) == pytest.approx(of_all)
