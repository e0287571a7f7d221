import math
import signal
import time

import numpy as np
import pytest

from risk_sac.egos.guard import Guarded, complaint
from risk_sac.egos.seam import Control, Trajectory
from risk_sac.errors import EgoFailed

ROW = np.array([0.0, 1.0])


class Answering:
    def __init__(self, answer):
        self.answer = answer

    def reset(self, episode):
        pass

    def act(self, perceived):
        return self.answer() if callable(self.answer) else self.answer


def late():
    time.sleep(0.05)
    return Control(0.0)


def crash():
    raise ZeroDivisionError("by me")


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (late, "ego_deadline"),
        (crash, "ego_crash"),
        (None, "ego_malformed"),
        ((1.0, 0.0), "ego_malformed"),
        (Control(math.nan, 0.0), "ego_malformed"),
        (Control(0.0, math.inf), "ego_malformed"),
        (Control("fast", 0.0), "ego_malformed"),
        (Control(None, 0.0), "ego_malformed"),
        (Trajectory(ROW, ROW, ROW, np.array([1.0])), "ego_malformed"),
        (Trajectory(ROW[::-1], ROW, ROW, ROW), "ego_malformed"),
        (Trajectory(ROW, ROW, ROW, -ROW), "ego_malformed"),
        (Trajectory(ROW, ROW * math.nan, ROW, ROW), "ego_malformed"),
        (Trajectory(ROW, np.array(["a", "b"]), ROW, ROW), "ego_malformed"),
        (Trajectory(ROW[:1], ROW[:1], ROW[:1], ROW[:1]), "ego_malformed"),
        (Trajectory(None, None, None, None), "ego_malformed"),
    ],
)
def test_whatever_is_wrong_with_an_answer_has_a_reason(answer, reason):
    with pytest.raises(EgoFailed) as failed:
        Guarded(Answering(answer), 0.01 if answer is late else 60.0).act(None)
    assert failed.value.reason == reason


@pytest.mark.parametrize("sound", [Control(-3.0), Control(1, 0), Trajectory(ROW, ROW, ROW, ROW)])
def test_a_sound_answer_passes(sound):
    assert complaint(sound) == ""


def loops():
    while True:
        try:
            time.sleep(60)
        except Exception:  # noqa: BLE001
            continue


def spins():
    while True:
        pass


@pytest.mark.timeout(900, method="thread")  # the other method has the signal for itself
@pytest.mark.parametrize("never", [loops, spins])
def test_an_ego_of_ours_that_never_answers_is_interrupted(never):
    ego = Guarded(Answering(never), 0.05, interrupted=True)
    ego.reset(None)
    with pytest.raises(EgoFailed, match=r"within 0\.05 s") as failed:
        ego.act(None)
    assert failed.value.reason == "ego_deadline"
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.timeout(900, method="thread")
def test_whoever_uses_the_signal_keeps_it():
    before = signal.signal(signal.SIGALRM, signal.SIG_IGN)
    try:
        ego = Guarded(Answering(late), 60.0, interrupted=True)
        ego.reset(None)
        assert ego.act(None) == Control(0.0)
        assert signal.getsignal(signal.SIGALRM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGALRM, before)
