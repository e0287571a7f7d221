"""Event streams: rendered once for all followers, without needless database queries."""

import asyncio
import base64
import binascii
import logging
import re
from collections.abc import AsyncIterator
from dataclasses import dataclass

import anyio
from async_lru import alru_cache
from sse_starlette import ServerSentEvent
from starlette.concurrency import run_in_threadpool

from risk_sac.records import Episode, Outcome, StateChange, wire
from service.errors import NotFoundError, StorageError
from service.store.reading import Store

logger = logging.getLogger(__name__)

TICK_S = 1.0  # between two looks at a campaign's revision
RETRY_MS = 1000  # after which a client whose connection broke comes back
BATCH = 100  # events at most at once
KEPT = 64  # batches
_ID = re.compile(r"(\w+)-([1-9]\d{0,17})", re.ASCII)  # campaign; sequence of an event


@dataclass(frozen=True, slots=True)
class Chunk:
    """Batch of events as sent."""

    data: bytes
    position: int  # sequence of the last event that has been told then; 0: none
    more: bool  # whether more has happened since
    ended: bool  # whether it ends with the campaign's final state


class Streams:
    """Shared polling of all followers, so that they request the same batches."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._chunks = alru_cache(maxsize=KEPT)(self._chunk)

    async def follow(
        self, campaign_id: str, position: int, stopping: anyio.Event, *, ended: bool
    ) -> AsyncIterator[bytes]:
        """Yields events after a position, until the campaign or the server ends.

        At most one batch is buffered for a slow client.

        Args:
          campaign_id: of the campaign.
          position: sequence of the last event sent, 0 for none.
          stopping: set when the server stops.
          ended: whether the campaign had already ended; its final state itself may be older than the record of changes.
        """
        yield ServerSentEvent(retry=RETRY_MS, sep="\n").encode()
        try:
            while not stopping.is_set():
                revision = await self._revision(campaign_id)
                chunk = await self._chunks(campaign_id, position, revision)
                if chunk.data:
                    yield chunk.data
                if chunk.ended or (ended and not chunk.more):
                    return
                position = chunk.position
                if not chunk.more:
                    await self._change(campaign_id, revision, stopping)
        except NotFoundError:
            return
        except StorageError as error:
            logger.warning("a stream of events ends: %s", error, extra={"campaign": campaign_id})

    async def _revision(self, campaign_id: str) -> str:
        """Returns the campaign's revision; uses a thread only for a database query."""
        known = self._store.known_revision(campaign_id)
        return known if known is not None else await run_in_threadpool(self._store.revision, campaign_id)

    async def _change(self, campaign_id: str, revision: str, stopping: anyio.Event) -> None:
        loop = asyncio.get_running_loop()
        while not stopping.is_set() and self._store.known_revision(campaign_id) == revision:
            await asyncio.sleep(TICK_S - loop.time() % TICK_S)

    async def _chunk(self, campaign_id: str, position: int, revision: str) -> Chunk:
        return await run_in_threadpool(self._render, campaign_id, position)

    def _render(self, campaign_id: str, position: int) -> Chunk:
        page = self._store.events(campaign_id, after=position, limit=BATCH)
        data = b"".join(_event(campaign_id, at, event) for at, event in enumerate(page.items, position + 1))
        last = page.items[-1] if page.items else None
        ended = isinstance(last, StateChange) and last.ends_campaign
        return Chunk(data, position + len(page.items), page.last is not None, ended)


def decode_position(store: Store, campaign_id: str, event_id: str) -> int | None:
    """Returns the position of the campaign's event id; None if unknown."""
    try:
        text = base64.b64decode(event_id.encode("ascii"), altchars=b"-_", validate=True).decode("ascii")
    except (UnicodeError, binascii.Error):
        return None
    match = _ID.fullmatch(text)
    if match is None or match[1] != campaign_id:
        return None
    position = int(match[2])
    return position if store.events(campaign_id, after=position - 1, limit=1).items else None


def _event(campaign_id: str, position: int, event: Episode | StateChange) -> bytes:
    name = "state"
    if isinstance(event, Episode):
        found = event.outcome is Outcome.FAILURE and event.phase != "iid"
        name = "failure" if found else "episode"
    id_ = base64.urlsafe_b64encode(f"{campaign_id}-{position}".encode()).decode()  # opaque to clients
    return ServerSentEvent(wire(event).decode(), event=name, id=id_, sep="\n").encode()
