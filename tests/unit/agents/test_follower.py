import numpy as np
import pytest

from risk_sac.agents.follower import BEHIND_STEPS, ScriptFollower
from risk_sac.observation_layout import PER_ADVERSARY, X_M, Y_M
from risk_sac.scenario.families import FAMILIES
from risk_sac.scripts.motions import SIZE, Genes

MIDDLE = Genes(*[0.5] * SIZE)


def follower(*active: float, family: str = "low") -> ScriptFollower:
    """One whose adversaries are as active as said, at their cue from the first step that counts on."""
    subject = ScriptFollower(FAMILIES[family])
    subject.begin(np.array([MIDDLE._replace(active=share, cue=0.0, drive=0.0) for share in active]).ravel())
    return subject


def observed(*places: tuple[float, float] | None) -> np.ndarray:
    """Neighbours at (x, y), m, at the ego's speed; None: one that has left the net."""
    rows = [[0.0] * PER_ADVERSARY if p is None else [p[0] / X_M, p[1] / Y_M, 0, 0, 1, 0, 0.6, 0, 0, 1] for p in places]
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


def test_an_episode_can_stop_once_all_that_act_have_fallen_behind():
    subject = follower(0.9, 0.0, 0.0)
    for _ in range(BEHIND_STEPS):
        assert not subject.can_stop_early
        subject.act(observed((-7, 3.3), (12, 3.3), (14, -3.3)))
    assert subject.can_stop_early
    subject.begin(np.tile(MIDDLE, 3))
    assert not subject.can_stop_early


def test_an_episode_can_stop_a_while_after_the_last_strike():
    subject, ahead = follower(0.9, 0.0, 0.0), observed((6, 3.3), (12, 3.3), (14, -3.3))
    steps = 0
    while not subject.can_stop_early:
        subject.act(ahead)
        steps += 1
    assert steps == 5 + 20 + 30 + 2  # the cue, the strike, and what may come of it
