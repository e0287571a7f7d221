"""Questions and answers in turn, over one stream of gRPC; each answer has a deadline.

gRPC knows a deadline of a whole stream only. Here a thread that sleeps through most of it cancels the stream when an
answer is due, so that a question itself sets no timer and wakes nobody.
"""

import math
import threading
import time
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from typing import Any

import grpc


class Late(Exception):
    """No answer came in time."""


class Turns:
    """One stream."""

    def __init__(self, method: Callable[[Iterator[bytes]], Any], deadline_s: float) -> None:
        """Opens it.

        Args:
          method: of a channel, from a stream to a stream.
          deadline_s: for each answer.
        """
        self._deadline_s, self._due_s, self._was_late = deadline_s, math.inf, False
        self._questions: SimpleQueue[bytes | None] = SimpleQueue()
        self._answers = method(iter(self._questions.get, None))
        self._over = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def ask(self, question: bytes) -> bytes:
        """Asks, and returns the answer.

        Raises:
          Late: it does not come in time.
          StopIteration: the stream ends without one.
          grpc.RpcError: the stream breaks.
        """
        self._due_s = time.monotonic() + self._deadline_s
        self._questions.put(question)
        try:
            answer: bytes = next(self._answers)
        except grpc.RpcError as error:
            if self._was_late:
                raise Late from error
            raise
        self._due_s = math.inf
        return answer

    def close(self) -> None:
        """Asks nothing more."""
        self._over.set()
        self._questions.put(None)

    def _watch(self) -> None:
        wait_s = self._deadline_s
        while not self._over.wait(wait_s):
            left_s = self._due_s - time.monotonic()
            if left_s <= 0.0:
                self._was_late = True
                self._answers.cancel()
                return
            wait_s = min(left_s, self._deadline_s)
