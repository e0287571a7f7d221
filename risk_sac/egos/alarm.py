"""Interrupts an ego in our own process that does not answer in time.

The alarm is a signal, so it ends loops, sleeping and waiting of Python code, but neither compiled code that never comes
back nor anything outside the main thread; those are left to whoever watches the process.
"""

import signal
import threading
from types import FrameType

_armed = False


class Overdue(BaseException):
    """Raised in the ego's own code, past whatever it does about exceptions."""


def ready() -> bool:
    """Makes the alarm ready; False where nobody can be interrupted, or somebody else uses this signal."""
    if threading.current_thread() is not threading.main_thread():
        return False
    if signal.getsignal(signal.SIGALRM) is not _ring:
        if signal.getsignal(signal.SIGALRM) is not signal.SIG_DFL:
            return False
        signal.signal(signal.SIGALRM, _ring)
    return True


def on(after_s: float) -> None:
    """Raises `Overdue` in so many seconds of real time, and again and again, until it is off."""
    global _armed
    _armed = True
    signal.setitimer(signal.ITIMER_REAL, after_s, after_s)


def off() -> None:
    """Rings no more."""
    global _armed
    _armed = False
    signal.setitimer(signal.ITIMER_REAL, 0.0)


def _ring(number: int, frame: FrameType | None) -> None:
    if _armed:
        raise Overdue
