from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.env.observation_layout import MOTION_PER_ADVERSARY, PER_ADVERSARY, X_M, Y_M
from risk_sac.risk.reward import shaped_reward
from risk_sac.scenario.families import FAMILIES
from risk_sac.search.agents.controls import Decision, Held, RandomAgent, ScriptedAgent, ScriptFollower
from risk_sac.search.scripts import SIZE, Genes

NOTHING = np.zeros(1, dtype=np.float32)
ADVERSARIES = 3


def played(agent: RandomAgent, steps: int) -> np.ndarray:
    """`steps x adversaries x 2`."""
    return np.array([agent.act(NOTHING) for _ in range(steps)]).reshape(steps, ADVERSARIES, 2)


def test_a_restored_agent_goes_on_as_the_one_that_was_saved():
    agent = RandomAgent(2 * ADVERSARIES, seed=3)
    played(agent, 7)
    state = agent.state()
    expected = played(agent, 100)
    restored = RandomAgent(2 * ADVERSARIES, seed=4)
    restored.load(state)
    assert np.array_equal(played(restored, 100), expected)


def seen(x_m: float, y_m: float, cos: float) -> list[float]:
    return [x_m / X_M, y_m / Y_M, 0.0, 0.0, cos, *[0.0] * (PER_ADVERSARY - 5)]


def test_those_ahead_cut_in_and_brake_and_all_others_keep_on():
    ahead_left, beside, oncoming, crossing = seen(12, 3.5, 1), seen(2, -3.5, 1), seen(40, 3.5, -1), seen(20, 5, 0)
    observation = np.array([*ahead_left, *beside, *oncoming, *crossing, 0.5, 0.5], np.float32)
    action = ScriptedAgent(8, seed=0).act(observation)
    assert action.tolist() == [-0.5, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    in_the_path = ScriptedAgent(2, seed=0).act(np.array(seen(12, 0.25, 1), np.float32))
    assert in_the_path.tolist() == [-0.5, -0.25]


def test_an_action_is_held_and_an_episode_begins_with_a_new_one():
    held, drawn = Held(3), iter(np.arange(10.0))

    def acts(steps):
        return [float(held.act(lambda: np.array([next(drawn)]))[0]) for _ in range(steps)]

    assert acts(7) == [0, 0, 0, 1, 1, 1, 2]
    held.begin()
    assert acts(4) == [3, 3, 3, 4]


def test_three_steps_make_one_transition(transition):
    decision = Decision(3, 0.5)
    steps = [
        transition(value, risk_reward=value, cost=cost, robustness=value, next_robustness=value + 1.0)
        for value, cost in ((1.0, 0.4), (2.0, 0.2), (4.0, 0.8))
    ]
    assert [decision.add(step) for step in steps[:2]] == [None, None]
    made = decision.add(steps[2])
    assert made.risk_reward == 1.0 + 0.5 * 2.0 + 0.25 * 4.0
    assert made.cost == pytest.approx(0.4 + 0.5 * 0.2 + 0.25 * 0.8)
    assert (made.robustness, made.next_robustness) == (1.0, 5.0)
    assert made.observation[0] == 1.0
    assert made.next_observation[0] == 5.0
    np.testing.assert_allclose(made.action, np.mean([step.action for step in steps], axis=0))
    assert decision.add(steps[0]) is None  # the next decision


def test_the_end_of_the_world_completes_a_decision_and_that_of_the_horizon_forgets_it(transition):
    decision = Decision(3, 0.5)
    decision.add(transition(1.0))
    ended = decision.add(transition(2.0, terminated=True))
    assert (ended.risk_reward, ended.terminated) == (1.0 + 0.5 * 2.0, True)
    decision.add(transition(8.0))
    decision.begin()  # the horizon cut the decision off
    first, *others = (decision.add(transition(value)) for value in (1.0, 2.0, 4.0))
    assert first is None
    assert others[0] is None
    assert others[1] is not None
    assert others[1].risk_reward == 1.0 + 0.5 * 2.0 + 0.25 * 4.0


@given(robustness=st.lists(st.floats(-3, 3), min_size=5, max_size=5))
def test_shaping_of_a_decision_is_the_discounted_sum_of_its_steps(robustness):
    """sum_i g^i (g phi_{i+1} - phi_i) = g^k phi_k - phi_0."""
    discount = 0.9
    pairs = list(pairwise(robustness))
    each = [shaped_reward(0.0, before, after, discount, 0.0) for before, after in pairs]
    of_all = shaped_reward(0.0, robustness[0], robustness[-1], discount ** len(pairs), 0.0)
    assert sum(discount**i * one for i, one in enumerate(each)) == pytest.approx(of_all)


MIDDLE = Genes(*[0.5] * SIZE)


def follower(*active: float, family: str = "low") -> ScriptFollower:
    """Follower whose adversaries are active as given, cued from the first step."""
    subject = ScriptFollower(FAMILIES[family])
    subject.begin(np.array([MIDDLE._replace(active=share, cue=0.0, drive=0.0) for share in active]).ravel())
    return subject


def observed(*places: tuple[float, float] | None) -> np.ndarray:
    """Neighbours at (x, y), m, at the ego's speed; None has left."""
    rows = np.zeros((len(places), PER_ADVERSARY))
    for row, place in zip(rows, places, strict=True):
        if place is not None:
            row[:MOTION_PER_ADVERSARY] = [place[0] / X_M, place[1] / Y_M, 0, 0, 1, 0, 0.6, 0, 0, 1]
    return np.array([*np.ravel(rows), 0.6], np.float32)


def test_who_has_left_the_net_does_nothing():
    action = follower(0.9, 0.9, 0.9).act(observed(None, (12, 3.3), None)).reshape(-1, 2)
    assert not action[[0, 2]].any()
    assert action[1].any()


def test_it_strikes_at_its_cue_and_begins_anew_with_every_episode():
    subject, ahead = follower(0.9, 0.0, 0.0), observed((6, 3.3), (12, 3.3), (14, -3.3))
    drives = [subject.act(ahead)[0] for _ in range(10)]
    assert drives == pytest.approx([0.0] * 5 + [-1.0] * 5, abs=1e-6)  # 6 m ahead is where it wants to be
    subject.begin(np.tile(MIDDLE, 3))
    assert subject.act(ahead)[0] == pytest.approx(0.0, abs=1e-6)


def test_an_episode_can_stop_a_while_after_the_last_strike():
    subject, ahead = follower(0.9, 0.0, 0.0), observed((6, 3.3), (12, 3.3), (14, -3.3))
    steps = 0
    while not subject.can_stop_early:
        subject.act(ahead)
        steps += 1
    assert steps == 5 + 20 + 30 + 2  # the cue, the strike, and what may come of it
