"""Cache of content that takes seconds to make: made on demand, one at a time, the newest kept."""

import threading
from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

import anyio
from anyio import to_thread
from async_lru import alru_cache

from risk_sac.execution.helper import HelperResult, run_helper
from service.errors import BusyError, StorageError
from service.settings import ServiceSettings

AT_ONCE = 1  # of a kind
MOST_WAITING = 16
RETRY_AFTER_S = 2  # in which some of those that wait are made
KEPT = 64  # of pictures and bundles, each of some 150 kB
WALL_S = 300.0  # of a helper; a minimisation or a table of 100,000 episodes takes ten on an idle machine

S = TypeVar("S", bound=Hashable)
"""What the content is made of; equal subjects have the same content."""


class OnDemandCache(Generic[S]):
    """Makes content in its own threads, so that other requests do not wait."""

    def __init__(self, make: Callable[[S], bytes], what: str, kept: int = KEPT) -> None:
        """Makes nothing yet.

        Args:
          make: makes the content of a subject; may take seconds.
          what: names the contents in messages, in the plural.
          kept: how many of the newest are kept.
        """
        self._make, self._what = make, what
        self._threads = anyio.CapacityLimiter(AT_ONCE)
        self._begun = 0  # that are being made, or wait
        self._made = alru_cache(maxsize=kept)(self._queue)  # a second request for the same waits for the first

    async def get(self, subject: S) -> bytes:
        """The content of a subject, or whatever its making raises.

        Raises:
          BusyError: the queue is full.
        """
        return await self._made(subject)

    async def _queue(self, subject: S) -> bytes:
        if self._begun >= AT_ONCE + MOST_WAITING:
            raise BusyError(
                f"{MOST_WAITING} {self._what} wait to be made; wanted fewer", RETRY_AFTER_S, "pictures_busy"
            )
        self._begun += 1
        try:
            return await to_thread.run_sync(self._make, subject, limiter=self._threads)
        finally:
            self._begun -= 1


class Helper:
    """Runs helper processes until it is stopped."""

    def __init__(self, settings: ServiceSettings) -> None:
        self._niceness, self._stopping = settings.worker_niceness, threading.Event()
        self.stopping = self._stopping.is_set

    def stop(self) -> None:
        """Ends the processes at work."""
        self._stopping.set()

    def run(
        self,
        program: str,
        arguments: Sequence[str],
        question: bytes = b"",
        *,
        wall_s: float = WALL_S,
        memory_bytes: int = 0,
    ) -> HelperResult:
        """Runs a program within its time; StorageError if it cannot be started."""
        try:
            return run_helper(
                program,
                arguments,
                question=question,
                wall_s=wall_s,
                memory_bytes=memory_bytes,
                niceness=self._niceness,
                stopping=self.stopping,
            )
        except OSError as error:
            raise StorageError(f"no process can be started for it ({error.strerror})") from error
