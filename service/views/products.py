"""What takes seconds to make: made when it is asked for, one at a time, the newest kept."""

from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import anyio
from anyio import to_thread
from async_lru import alru_cache

from service.errors import ServiceError

AT_ONCE = 1  # of a kind
MOST_WAITING = 16
KEPT = 64  # of pictures and bundles, each of some 150 kB


class TooManyWaiting(ServiceError):
    """Asking again pays once others have theirs."""


S = TypeVar("S", bound=Hashable)
"""What a product is made of; two that are equal make the same product."""


class Products(Generic[S]):
    """Makes products in threads of its own, so that they hold up nothing else that the service does."""

    def __init__(self, make: Callable[[S], bytes], what: str, kept: int = KEPT) -> None:
        """Makes nothing yet.

        Args:
          make: makes one; may take seconds.
          what: they are called, in the plural.
          kept: how many of the newest.
        """
        self._make, self._what = make, what
        self._threads = anyio.CapacityLimiter(AT_ONCE)
        self._begun = 0  # that are being made, or wait
        self._made = alru_cache(maxsize=kept)(self._queue)  # who asks for one that is being made waits for it

    async def product(self, subject: S) -> bytes:
        """The product of a subject, or whatever its making raises.

        Raises:
          TooManyWaiting: for theirs.
        """
        return await self._made(subject)

    async def _queue(self, subject: S) -> bytes:
        if self._begun >= AT_ONCE + MOST_WAITING:
            raise TooManyWaiting(f"{MOST_WAITING} {self._what} wait to be made; wanted fewer")
        self._begun += 1
        try:
            return await to_thread.run_sync(self._make, subject, limiter=self._threads)
        finally:
            self._begun -= 1
