"""Ctrl-C and its kin as a question to ask at a good moment."""

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

STOPPING = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def stop_signal(numbers: Sequence[signal.Signals] = STOPPING) -> Iterator[Callable[[], bool]]:
    """Turns the first of the signals into an answer; a second one acts as always."""
    stopping = False

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal stopping
        stopping = True
        signal.signal(number, earlier[signal.Signals(number)])

    earlier = {number: signal.getsignal(number) for number in numbers}
    for number in earlier:
        signal.signal(number, stop)
    try:
        yield lambda: stopping
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)
