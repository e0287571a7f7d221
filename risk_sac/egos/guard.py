"""Checks ego answers: late, malformed or missing ones make the episode invalid.

Nothing drives in the ego's place, and no rate counts the episode. `DEAD_AFTER` such episodes in a row fail the run.
"""

import contextlib
import itertools
import logging
import math
import os
import signal
import threading
import time
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import numpy as np

from risk_sac.egos.seam import Command, Control, Ego, EpisodeStart, Perceived, Trajectory
from risk_sac.errors import EgoFailed
from risk_sac.host.process_state import handler_of, preserved
from risk_sac.world.types import Floats

DEADLINE, MALFORMED, CRASH = "ego_deadline", "ego_malformed", "ego_crash"  # reasons of an invalid episode
DEAD_AFTER = 5
MOST_POINTS = 1000
LARGEST = 1e9  # of all numbers in an answer: beyond it sums overflow
LONGEST_TEXT = 200

Answer = TypeVar("Answer")
logger = logging.getLogger(__name__)


class Malformed(ValueError):
    """Answer of an ego that is no command."""


class Guarded:
    """An ego whose every answer is checked.

    Attributes:
      took_s: real time that the latest answer took.
    """

    def __init__(self, make: Callable[[], Ego], deadline_s: float, *, foreign: bool = False) -> None:
        """Makes the ego.

        Args:
          make: imports and makes it.
          deadline_s: real time for each answer.
          foreign: whether it is code in our process. Such code is interrupted when it is late, as far as a signal can,
            and runs with its own process-wide settings. Other egos keep their deadline, or are refused afterwards.

        Raises:
          EgoFailed: it cannot be made.
        """
        self.took_s = 0.0
        self._deadline_s, self._foreign, self._state = deadline_s, foreign, preserved()
        with self._state if foreign else contextlib.nullcontext():
            self._ego = self._asked(make)

    @property
    def defect_reached_s(self) -> float | None:
        """See `Planted.reached_s`, of an ego that has defects."""
        reached_s: float | None = self._ego.reached_s  # type: ignore[attr-defined]
        return reached_s

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode.

        Raises:
          EgoFailed: it crashed, or took too long.
        """
        with self._state if self._foreign else contextlib.nullcontext():
            self._asked(lambda: self._ego.reset(episode))

    def act(self, perceived: Perceived) -> Command:
        """Returns a sound command.

        Raises:
          EgoFailed: it crashed, took too long, or answered nonsense.
        """
        with self._state.quick if self._foreign else contextlib.nullcontext():
            return self._asked(lambda: sound(self._ego.act(perceived)))

    def close(self) -> None:
        """Closes the ego; errors are only logged, as its episodes are over."""
        try:
            with self._state if self._foreign else contextlib.nullcontext():
                self._asked(lambda: self._ego.close())
        except EgoFailed as failed:
            logger.warning("closing the ego: %s", failed)

    def _asked(self, question: Callable[[], Answer]) -> Answer:
        began = time.monotonic()
        try:
            if not self._foreign:
                answer = question()
            else:
                try:
                    _confine(self._deadline_s)
                    answer = question()
                finally:
                    _free()
        except BaseException as error:
            _free()  # the alarm may have rung before the `finally` above had put it off
            raise self._failure(error) from error
        self.took_s = time.monotonic() - began
        if self.took_s > self._deadline_s:
            raise EgoFailed(f"the ego took {self.took_s:.2f} s; wanted at most {self._deadline_s:g} s", reason=DEADLINE)
        return answer

    def _failure(self, error: BaseException) -> BaseException:
        if isinstance(error, _Overdue):
            return EgoFailed(f"the ego did not answer within {self._deadline_s:g} s", reason=DEADLINE)
        if isinstance(error, Malformed):
            return EgoFailed(f"the ego answered {error}", reason=MALFORMED)
        by_user = isinstance(error, KeyboardInterrupt) and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        if by_user or (isinstance(error, EgoFailed) and not self._foreign):
            return error
        return EgoFailed(f"the ego crashed: {type(error).__name__}: {_text(error)}{_place(error)}", reason=CRASH)


def sound(answer: object) -> Command:
    """Returns an ego's command in plain numbers.

    Raises:
      Malformed: it is none; whatever reading it raises counts as that.
    """
    try:
        if isinstance(answer, Control):
            return Control(_number(answer.accel_mps2), _number(answer.steering_rad))
        if not isinstance(answer, Trajectory):
            raise Malformed(f"a {type(answer).__name__}; wanted a Control or a Trajectory")
        command = Trajectory(*(_row(name, getattr(answer, name)) for name in Trajectory._fields))
    except (Malformed, _Overdue):
        raise
    except BaseException as error:
        raise Malformed(f"what raises {type(error).__name__} when it is read") from error
    if len({len(row) for row in command}) > 1:
        raise Malformed(f"a trajectory with rows of {[len(row) for row in command]} numbers; wanted as many in each")
    time_s = command.time_s
    if time_s[0] < 0.0 or not (time_s[1:] > time_s[:-1]).all() or command.speed_mps.min() < 0.0:
        raise Malformed("a trajectory whose times do not rise from 0 on, or whose speed is negative")
    return command


def _number(value: Any) -> float:
    number = value.item() if getattr(value, "ndim", None) == 0 else value  # a scalar of numpy or torch
    plain = float(number) if isinstance(number, int | float) and not isinstance(number, bool) else math.nan
    if not abs(plain) <= LARGEST:
        raise Malformed(f"a Control with {_text(value)!r}; wanted numbers from -{LARGEST:g} to {LARGEST:g}")
    return plain


def _row(name: str, values: Any) -> Floats:
    array_like = hasattr(type(values), "__array__")
    if not 2 <= len(values) <= MOST_POINTS:
        raise Malformed(f"a trajectory with {len(values)} numbers as {name}; wanted 2 to {MOST_POINTS}")
    row = np.asarray(values if array_like else list(itertools.islice(values, MOST_POINTS + 1)))
    if row.ndim != 1 or row.dtype.kind not in "iuf" or not (np.abs(row) <= LARGEST).all():
        shape = f"{row.dtype} of shape {row.shape}"
        raise Malformed(f"a trajectory with {shape} as {name}; wanted a row of numbers up to {LARGEST:g}")
    return row.astype(np.float64)


def _text(value: object) -> str:
    try:
        return str(value)[:LONGEST_TEXT]
    except BaseException:  # noqa: BLE001  # it is foreign
        return f"a {type(value).__name__} without a text"


def _place(error: BaseException) -> str:
    """Names file and line that raised; empty if the guard did."""
    *_, last = traceback.extract_tb(error.__traceback__) or [None]
    return f" ({Path(last.filename).name}, line {last.lineno})" if last and last.filename != __file__ else ""


class _Overdue(BaseException):
    """Raised in the ego's own code, past its handlers of `Exception`."""


_armed = False
_leave = os._exit


def _confine(deadline_s: float) -> None:
    """Until `_free`, raises `_Overdue` at deadlines and turns `os._exit` into an exception.

    Only in the main thread, and the former where SIGALRM has no other use. A signal ends loops, sleeping and waiting
    of Python code, but not compiled code that never returns.
    """
    global _armed
    if threading.current_thread() is not threading.main_thread():
        return
    os._exit = partial(_refuse, os.getpid())  # type: ignore[assignment]
    handler = handler_of(signal.SIGALRM)
    if handler == signal.SIG_DFL:
        signal.signal(signal.SIGALRM, _ring)
    if handler in (signal.SIG_DFL, _ring):
        _armed = True
        signal.setitimer(signal.ITIMER_REAL, deadline_s, deadline_s)


def _free() -> None:
    global _armed
    if _armed:
        _armed = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        if handler_of(signal.SIGALRM) is not _ring:  # the ego has replaced it
            signal.signal(signal.SIGALRM, _ring)
    os._exit = _leave


def _refuse(owner: int, status: int) -> None:
    if os.getpid() != owner:  # a process that the ego has forked may leave
        _leave(status)
    raise SystemExit(status)


def _ring(number: int, frame: FrameType | None) -> None:
    if _armed:
        raise _Overdue
