"""The server's event loop, which lets requests gather while there are many of them and no core is idle.

Whenever it wakes on such a machine, it pushes a worker off its core, finds cold caches there, and leaves cold caches
behind. So it wakes at once as long as that happens rarely, and else at a limited rate, as network cards moderate their
interrupts; but neither for the sake of a few clients that ask as fast as they are answered, nor for what a thread has
found out for a request that has waited already.
"""

import asyncio
import os
import select
import selectors
import time

PERIOD_S = 0.04  # between two times that it wakes, while there is much to do
BURST = 10  # times that it wakes at once before that
WORTH = 3.0  # requests, or the like, that have to gather in the mean
BUSY = 0.75  # of the cores, or there is nobody to be pushed off
TRY_AGAIN_S = 1.0  # after one of them was lacking
WEIGHT = 0.25  # of the newest in that mean


class GatheringSelector(selectors.DefaultSelector):
    """Waits for requests, and then a little for more of them if there were many lately."""

    def __init__(self) -> None:
        super().__init__()
        self._due = 0.0  # when it may look, were it not for the burst
        self._prompt_until = 0.0
        self._gathered = 2 * WORTH

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """What is ready; see `selectors.BaseSelector.select`."""
        began = time.monotonic()
        if (timeout is not None and timeout <= 0) or began < self._prompt_until:
            return super().select(timeout)  # the loop is at work, or there is nothing to gather
        pause_s = self._due - began
        if pause_s > 0:
            threads = next(iter(self.get_map()))  # the file by which they wake the loop, asyncio's first
            if select.select([threads], [], [], pause_s)[0]:
                return super().select(0)
            timeout = None if timeout is None else max(0.0, timeout - pause_s)
        ready = super().select(timeout)
        now = time.monotonic()
        if pause_s > 0:
            self._gathered += WEIGHT * (len(ready) - self._gathered)
            if self._gathered < WORTH or not _busy():
                self._prompt_until, self._gathered = now + TRY_AGAIN_S, 2 * WORTH
        self._due = max(self._due, now - BURST * PERIOD_S) + PERIOD_S
        return ready


def _busy() -> bool:
    """Whether the machine's cores were in use lately."""
    return os.getloadavg()[0] >= BUSY * (os.cpu_count() or 1)


def new_event_loop() -> asyncio.AbstractEventLoop:
    """A loop that waits in this way."""
    return asyncio.SelectorEventLoop(GatheringSelector())
