"""An ego's fault invalidates its episode and never ends the run."""

import math
import os
import signal
import sys
import time

import numpy as np
import pytest
import torch

from risk_sac.egos.guard import LARGEST, MOST_POINTS, Guarded
from risk_sac.egos.seam import Control, Trajectory
from risk_sac.errors import EgoFailed

ROW = np.array([0.0, 1.0])


class Answering:
    """Ego that gives the same answer to every call."""

    def __init__(self, answer):
        self.answer = answer

    def reset(self, episode):
        return self.act(None)

    def act(self, perceived):
        return self.answer() if callable(self.answer) else self.answer

    def close(self):
        return self.act(None)


def guarded(answer, deadline_s=60.0, *, foreign=True):
    return Guarded(lambda: Answering(answer), deadline_s, foreign=foreign)


def late():
    time.sleep(0.05)
    return Control(0.0)


class Silent(Exception):
    """An error that has no text."""

    def __str__(self):
        sys.exit(0)


class Answer(BaseException):
    """An error that no handler of `Exception` sees."""


def raising(error):
    def answer():
        raise error

    return answer


CRASHES = [
    raising(ZeroDivisionError("by me")),
    raising(Silent()),
    raising(Answer()),
    raising(GeneratorExit()),
    raising(MemoryError()),
    raising(EgoFailed("of its own", reason="ego_unheard_of")),
    lambda: sys.exit(0),
    lambda: os._exit(0),
    lambda: Answering(0).nothing,
]


class Spy(float):
    """A number that cannot be read."""

    def __float__(self):
        raise RuntimeError("by me")


class Changing(Control):
    """A command that cannot be read."""

    @property
    def accel_mps2(self):
        sys.exit(0)


MALFORMED = [
    None,
    (1.0, 0.0),
    (Control(0.0) for _ in range(3)),
    {"accel_mps2": 1.0},
    *(Control(each, 0.0) for each in (math.nan, 10**400, 2 * LARGEST, "fast", "1", None, True, np.True_, 1j, [1.0])),
    *(Control(0.0, each) for each in (math.inf, np.float32("nan"), np.array([1.0]), Spy(1.0), torch.tensor(math.nan))),
    Changing(0.0, 0.0),
    Trajectory(ROW, ROW, ROW, np.array([1.0])),
    Trajectory(ROW[::-1], ROW, ROW, ROW),
    Trajectory(ROW - 1.0, ROW, ROW, ROW),
    Trajectory(ROW, ROW, ROW, -ROW),
    *(
        Trajectory(ROW, row, ROW, ROW)
        for row in (
            ROW * math.nan,
            np.array(["1", "2"]),
            ["1", "2"],
            [10**400, 1],
            [True, False],
            ROW * 1j,
            ROW[:1],
            np.eye(2),
            None,
            3.0,
            range(MOST_POINTS + 1),
            (each for each in (1.0, 2.0)),
            [Spy(1.0), Spy(2.0)],
        )
    ),
]


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (late, "ego_deadline"),
        *((each, "ego_crash") for each in CRASHES),
        *((each, "ego_malformed") for each in MALFORMED),
    ],
)
def test_whatever_is_wrong_with_an_answer_has_a_reason(answer, reason):
    ego = guarded(answer, 0.01 if answer is late else 60.0)
    with pytest.raises(EgoFailed) as failed:
        ego.act(None)
    assert failed.value.reason == reason
    assert len(str(failed.value)) < 500


def test_a_crash_names_the_file_and_line():
    line = raising.__code__.co_firstlineno + 2
    with pytest.raises(EgoFailed, match=rf"ZeroDivisionError: by me \(test_guard\.py, line {line}\)$"):
        guarded(CRASHES[0]).act(None)


@pytest.mark.parametrize("crash", CRASHES)
def test_an_ego_that_fails_while_it_is_made_begun_or_closed_is_no_end_of_the_run(crash, caplog):
    ego = guarded(crash)
    with pytest.raises(EgoFailed, match="crashed"):
        ego.reset(None)
    ego.close()
    assert "closing the ego" in caplog.text
    with pytest.raises(EgoFailed, match="crashed"):
        Guarded(crash, 60.0, foreign=True)


def test_an_ego_that_was_interrupted_by_the_user_is_not_blamed():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    try:
        with pytest.raises(KeyboardInterrupt):
            guarded(raising(KeyboardInterrupt())).act(None)
        signal.signal(signal.SIGINT, lambda *_: None)  # as while a run listens to it
        with pytest.raises(EgoFailed, match="crashed"):
            guarded(raising(KeyboardInterrupt())).act(None)
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_process_that_the_ego_forks_may_leave():
    def forks():
        child = os.fork()
        if not child:
            os._exit(7)
        return Control(float(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])))

    assert guarded(forks).act(None) == Control(7.0)


def test_what_an_ego_sets_holds_for_it_alone(tmp_path):
    def doubles():
        seen = torch.get_default_dtype(), os.getcwd()
        torch.set_default_dtype(torch.float64)
        os.chdir(tmp_path)
        return Control(float(seen == (torch.float64, str(tmp_path))))

    here, ego = os.getcwd(), guarded(doubles)
    assert [ego.act(None), ego.act(None)] == [Control(0.0), Control(1.0)]
    assert (torch.get_default_dtype(), os.getcwd()) == (torch.float32, here)


def loops():
    while True:
        try:
            time.sleep(60)
        except Exception:  # noqa: BLE001
            continue


def spins():
    while True:
        pass


def ignores_signals():
    signal.signal(signal.SIGALRM, signal.SIG_IGN)
    return Control(0.0)


@pytest.mark.timeout(900, method="thread")  # the other method has the signal for itself
@pytest.mark.parametrize("never", [loops, spins])
def test_an_ego_of_ours_that_never_answers_is_interrupted(never):
    guarded(ignores_signals).act(None)  # another ego before it
    for question in ("act", "reset"):
        with pytest.raises(EgoFailed, match=r"within 0\.05 s") as failed:
            getattr(guarded(never, 0.05), question)(None)
        assert failed.value.reason == "ego_deadline"
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.timeout(900, method="thread")
def test_whoever_uses_the_signal_keeps_it():
    before = signal.signal(signal.SIGALRM, signal.SIG_IGN)
    try:
        assert guarded(late).act(None) == Control(0.0)
        assert signal.getsignal(signal.SIGALRM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGALRM, before)
