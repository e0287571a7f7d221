"""Cache of slow content and the helper processes that make it."""

import asyncio
import threading
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import anyio
from anyio import to_thread
from async_lru import alru_cache

from risk_sac.execution.helper import HelperResult, run_helper
from service.errors import BusyError, QuotaError, StorageError
from service.keys import fair_share
from service.settings import ServiceSettings

MOST_WAITING = 16
RETRY_AFTER_S = 2  # in which some of those that wait are made
KEPT = 64  # of pictures and bundles, each of some 150 kB
WALL_S = 300.0  # of a helper; a minimisation or a table of 100,000 episodes takes ten on an idle machine

S = TypeVar("S", bound=Hashable)
"""What the content is made of; equal subjects have the same content."""


@dataclass
class _Waiting(Generic[S]):
    turn: asyncio.Lock = field(default_factory=asyncio.Lock)
    requests: Counter[S] = field(default_factory=Counter)


class OnDemandCache(Generic[S]):
    """Cache of content that it makes in threads, without blocking requests.

    Keys take turns: of each, one subject is made or next to be made.
    """

    def __init__(self, make: Callable[[S], bytes], what: str, kept: int = KEPT, at_once: int = 1) -> None:
        """Makes nothing yet.

        Args:
          make: makes the content of a subject; may take seconds.
          what: names the contents in messages, in the plural.
          kept: how many of the newest are kept.
          at_once: how many are made at once, each for another key.
        """
        self._make, self._what = make, what
        self._at_once, self._threads = at_once, anyio.CapacityLimiter(at_once)
        self._waiting: dict[str | None, _Waiting[S]] = {}  # by key
        self._made = alru_cache(maxsize=kept)(self._make_in_thread)  # a second request for the same waits for the first

    async def get(self, subject: S, key_id: str | None) -> bytes:
        """The content of a subject, or whatever its making raises.

        Raises:
          BusyError: the queue is full.
          QuotaError: the key waits for its share of the queue.
        """
        if self._made.cache_contains(subject):
            return await self._made(subject)
        self._check_room(subject, key_id)
        waiting = self._waiting.setdefault(key_id, _Waiting())
        waiting.requests[subject] += 1
        try:
            async with waiting.turn:
                return await self._made(subject)
        finally:
            waiting.requests -= Counter([subject])
            if not waiting.requests:
                del self._waiting[key_id]

    def _check_room(self, subject: S, key_id: str | None) -> None:
        places = self._at_once + MOST_WAITING
        own = self._waiting.get(key_id, _Waiting()).requests.keys() | {subject}
        share = fair_share(places, len(self._waiting.keys() | {key_id}))
        if key_id is not None and len(own) > share:
            wait = f"{share} {self._what} of this key wait to be made, its share of the queue"
            raise QuotaError(f"{wait}; wanted fewer: ask for one after the other", RETRY_AFTER_S)
        others = sum(len(waiting.requests) for key, waiting in self._waiting.items() if key != key_id)
        if others + len(own) > places:
            raise BusyError(
                f"{MOST_WAITING} {self._what} wait to be made; wanted fewer", RETRY_AFTER_S, "pictures_busy"
            )

    async def _make_in_thread(self, subject: S) -> bytes:
        return await to_thread.run_sync(self._make, subject, limiter=self._threads)


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
