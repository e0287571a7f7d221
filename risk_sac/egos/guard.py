"""A dead ego never becomes a good one: whatever is wrong with its answer ends the episode, and nobody drives instead.

The episode is then *invalid*, with one of these reasons, and no rate counts it. `DEAD_AFTER` of them in a row fail
the run.
"""

import math
import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from risk_sac.egos import alarm
from risk_sac.egos.seam import Command, Control, Ego, Episode, Perceived, Trajectory
from risk_sac.errors import EgoFailed

DEADLINE, MALFORMED, CRASH = "ego_deadline", "ego_malformed", "ego_crash"
DEAD_AFTER = 5
MOST_POINTS = 1000

Told = TypeVar("Told")
Answer = TypeVar("Answer")


class Guarded:
    """An ego whose every answer is checked."""

    def __init__(self, ego: Ego, deadline_s: float, *, interrupted: bool = False) -> None:
        """Wraps it.

        Args:
          ego: who drives.
          deadline_s: for each answer, of real time.
          interrupted: whether it is interrupted then, as far as `risk_sac.egos.alarm` can; else it keeps its deadline
            itself, or is asked to the end and then refused.
        """
        self._ego, self._deadline_s, self._interrupted = ego, deadline_s, interrupted
        self._alarmed = False

    def reset(self, episode: Episode) -> None:
        """Begins an episode.

        Raises:
          EgoFailed: it crashed, or took too long.
        """
        self._alarmed = self._interrupted and alarm.ready()
        self._asked(self._ego.reset, episode)

    def act(self, perceived: Perceived) -> Command:
        """Its command, which is sound.

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
        """Lets go of what it holds."""
        self._ego.close()

    def _asked(self, question: Callable[[Told], Answer], told: Told) -> Answer:
        try:
            return self._in_time(question, told) if self._alarmed else question(told)
        except EgoFailed:
            raise
        except alarm.Overdue as overdue:
            alarm.off()  # it may have rung while it was put off
            said = f"the ego did not answer within {self._deadline_s:g} s"
            raise EgoFailed(said, reason=DEADLINE) from overdue
        except Exception as error:
            raise _crashed(error) from error

    def _in_time(self, question: Callable[[Told], Answer], told: Told) -> Answer:
        alarm.on(self._deadline_s)
        try:
            return question(told)
        finally:
            alarm.off()


def complaint(command: object) -> str:
    """What is wrong with an answer; empty if nothing is."""
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


def _crashed(error: Exception) -> EgoFailed:
    return EgoFailed(f"the ego crashed: {type(error).__name__}: {error}", reason=CRASH)
