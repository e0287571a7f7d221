"""Queue of messages that drops those of overtaken attempts; executors share it."""

import contextlib
import queue
import threading

from risk_sac.execution.executor import Exited
from risk_sac.execution.messages import Event


class Mailbox:
    """Queue from many threads to one; messages of an attempt that was overtaken or has ended are dropped."""

    def __init__(self) -> None:
        self._messages: queue.SimpleQueue[tuple[int, int, Event | Exited] | None] = queue.SimpleQueue()
        self._latest: dict[int, int] = {}  # attempt at each run
        self._lock = threading.Lock()

    def admit(self, number: int, attempt: int) -> None:
        """Accepts messages of this attempt at the run only, and drops what waits of an earlier one.

        Raises:
          ValueError: this attempt or a later one is accepted already.
        """
        with self._lock:
            heard = self._latest.get(number)
            if heard is not None and attempt <= heard:
                raise ValueError(f"attempt is {attempt}; run {number} is at attempt {heard}, so wanted a later one")
            self._latest[number] = attempt

    def dismiss(self, number: int) -> None:
        """Drops messages of this run."""
        with self._lock:
            self._latest.pop(number, None)

    def put(self, number: int, attempt: int, message: Event | Exited) -> None:
        """Adds a message."""
        self._messages.put((number, attempt, message))

    def wake(self) -> None:
        """Lets a waiting `take` return."""
        self._messages.put(None)

    def take(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        """Returns messages since the last call, waiting up to `timeout_s` for one."""
        messages = []
        with contextlib.suppress(queue.Empty):
            brought = self._messages.get(timeout=timeout_s)
            while True:
                if brought is not None and self._passes(*brought):
                    messages.append((brought[0], brought[2]))
                brought = self._messages.get_nowait()
        return messages

    def _passes(self, number: int, attempt: int, message: Event | Exited) -> bool:
        with self._lock:
            passes = self._latest.get(number) == attempt
            if passes and isinstance(message, Exited):
                del self._latest[number]
            return passes
