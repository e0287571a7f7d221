"""Checks every answer of an ego; an answer that is late, malformed or missing makes the episode invalid.

Nothing drives in the ego's place, and no rate counts the episode. `DEAD_AFTER` such episodes in a row fail the run.
"""

import math
import signal
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

import numpy as np

from risk_sac.egos.seam import Command, Control, Ego, Episode, Perceived, Trajectory
from risk_sac.errors import EgoFailed

DEADLINE, MALFORMED, CRASH = "ego_deadline", "ego_malformed", "ego_crash"  # reasons of an invalid episode
DEAD_AFTER = 5
MOST_POINTS = 1000

Told = TypeVar("Told")
Answer = TypeVar("Answer")


class Guarded:
    """An ego whose every answer is checked."""

    def __init__(self, ego: Ego, deadline_s: float, *, interrupted: bool = False) -> None:
        """Wraps an ego.

        Args:
          ego: that drives.
          deadline_s: real time for each answer.
          interrupted: whether a late ego is interrupted, as far as a signal can; else it keeps its deadline itself, or
            is refused after it has answered.
        """
        self._ego, self._deadline_s, self._interrupted = ego, deadline_s, interrupted
        self._alarmed = False

    def reset(self, episode: Episode) -> None:
        """Begins an episode.

        Raises:
          EgoFailed: it crashed, or took too long.
        """
        self._alarmed = self._interrupted and _ready()
        self._asked(self._ego.reset, episode)

    def act(self, perceived: Perceived) -> Command:
        """Returns a sound command.

        Raises:
          EgoFailed: it crashed, took too long, or answered nonsense.
        """
        began = time.monotonic()
        command = self._asked(self._ego.act, perceived)
        took_s = time.monotonic() - began
        if took_s > self._deadline_s:
            raise EgoFailed(f"the ego took {took_s:.2f} s; wanted at most {self._deadline_s:g} s", reason=DEADLINE)
        wrong = complaint(command)
        if wrong:
            raise EgoFailed(f"the ego answered {wrong}", reason=MALFORMED)
        return command

    def close(self) -> None:
        """Closes the ego."""
        self._ego.close()

    def _asked(self, question: Callable[[Told], Answer], told: Told) -> Answer:
        try:
            if not self._alarmed:
                return question(told)
            _alarm(self._deadline_s)
            try:
                return question(told)
            finally:
                _alarm(0.0)
        except EgoFailed:
            raise
        except _Overdue as overdue:
            _alarm(0.0)  # it may have rung before the `finally` above had put it off
            raise EgoFailed(f"the ego did not answer within {self._deadline_s:g} s", reason=DEADLINE) from overdue
        except Exception as error:
            raise EgoFailed(f"the ego crashed: {type(error).__name__}: {error}", reason=CRASH) from error


def complaint(command: object) -> str:
    """Returns what is wrong with an answer; empty if nothing is."""
    if isinstance(command, Control):
        try:
            sound = math.isfinite(command.accel_mps2) and math.isfinite(command.steering_rad)
        except TypeError:
            sound = False
        return "" if sound else f"{command!r}; wanted finite numbers"
    if not isinstance(command, Trajectory):
        return f"a {type(command).__name__}; wanted a Control or a Trajectory"
    shapes = {np.shape(row) for row in command}
    if len(shapes) != 1 or len(shape := shapes.pop()) != 1 or not 2 <= shape[0] <= MOST_POINTS:
        return f"a trajectory of shapes {[np.shape(row) for row in command]}; wanted four rows of 2 to {MOST_POINTS}"
    try:
        finite = bool(np.isfinite(np.array(command, dtype=np.float64)).all())
    except (TypeError, ValueError):
        finite = False
    if not finite:
        return "a trajectory with what is no finite number"
    if not (np.diff(command.time_s) > 0).all() or command.time_s[0] < 0 or np.min(command.speed_mps) < 0:
        return "a trajectory whose times do not rise from 0 on, or whose speed is negative"
    return ""


class _Overdue(BaseException):
    """Raised in the ego's own code, past its handlers of `Exception`."""


_armed = False


def _ready() -> bool:
    """Installs the signal handler; False outside the main thread, or if the signal has another use.

    A signal ends loops, sleeping and waiting of Python code, but not compiled code that never returns.
    """
    if threading.current_thread() is not threading.main_thread():
        return False
    if signal.getsignal(signal.SIGALRM) is not _ring:
        if signal.getsignal(signal.SIGALRM) is not signal.SIG_DFL:
            return False
        signal.signal(signal.SIGALRM, _ring)
    return True


def _alarm(after_s: float) -> None:
    """Raises `_Overdue` after each such time, in s; 0 turns it off."""
    global _armed
    _armed = after_s > 0.0
    signal.setitimer(signal.ITIMER_REAL, after_s, after_s)


def _ring(number: int, frame: FrameType | None) -> None:
    if _armed:
        raise _Overdue
