"""What workers say, in the order of its arrival, fenced by attempt; executors share it."""

import contextlib
import queue
import threading
from typing import Generic

from risk_sac.execution.executor import Exited, Word


class Mailbox(Generic[Word]):
    """Many threads bring messages, one takes them; an attempt that was overtaken or has ended is not heard."""

    def __init__(self) -> None:
        self._messages: queue.SimpleQueue[tuple[int, int, Word | Exited] | None] = queue.SimpleQueue()
        self._heard: dict[int, int] = {}  # the one attempt at each run
        self._lock = threading.Lock()

    def admit(self, number: int, attempt: int) -> None:
        """From here on this attempt at the run is heard and no other, not even what waits here of an earlier one.

        Raises:
          ValueError: this attempt or a later one is heard.
        """
        with self._lock:
            heard = self._heard.get(number)
            if heard is not None and attempt <= heard:
                raise ValueError(f"attempt is {attempt}; run {number} is at attempt {heard}, so wanted a later one")
            self._heard[number] = attempt

    def dismiss(self, number: int) -> None:
        """Nothing of this run is heard."""
        with self._lock:
            self._heard.pop(number, None)

    def put(self, number: int, attempt: int, message: Word | Exited) -> None:
        """Brings a message."""
        self._messages.put((number, attempt, message))

    def wake(self) -> None:
        """Lets a waiting `take` return."""
        self._messages.put(None)

    def take(self, timeout_s: float) -> list[tuple[int, Word | Exited]]:
        """What has come since the last call, waiting up to `timeout_s` for something."""
        messages = []
        with contextlib.suppress(queue.Empty):
            brought = self._messages.get(timeout=timeout_s)
            while True:
                if brought is not None and self._passes(*brought):
                    messages.append((brought[0], brought[2]))
                brought = self._messages.get_nowait()
        return messages

    def _passes(self, number: int, attempt: int, message: Word | Exited) -> bool:
        with self._lock:
            passes = self._heard.get(number) == attempt
            if passes and isinstance(message, Exited):
                del self._heard[number]
            return passes
