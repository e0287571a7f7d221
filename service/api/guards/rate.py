"""How many requests per second."""

import time
from collections import Counter
from http import HTTPStatus

from service.api.answers.problems import ProblemError
from service.schemas.problems import Reason


class RateLimit:
    """Counts the requests of each key, and of each address that has none, in windows of a second."""

    def __init__(self, per_second: int) -> None:
        self._per_second = per_second
        self._window = 0
        self._counts = Counter[tuple[str, ...]]()

    def count(self, *who: str) -> None:
        """One more request.

        Raises:
          ProblemError: 429, too many.
        """
        window = int(time.monotonic())
        if window != self._window:
            self._window = window
            self._counts.clear()
        self._counts[who] += 1
        if self._counts[who] > self._per_second:
            detail = f"rate is more than {self._per_second} requests per second; wanted fewer: wait 1 s"
            raise ProblemError(HTTPStatus.TOO_MANY_REQUESTS, Reason.RATE_LIMITED, detail, headers={"Retry-After": "1"})
