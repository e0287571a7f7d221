"""Clients that follow a campaign's events, break off now and then, and go on where they were."""

import asyncio
import re
from collections import Counter
from dataclasses import asdict, dataclass, field
from random import Random
from typing import Any

from tests.load.wire import HOST, Streaming, WireError, get

AGAIN_S = 0.2  # after a stream has ended
ARRIVAL_S = 2.0  # within which clients come, not all at the same moment
_EPISODE = re.compile(rb'"id":"([^"]+)-(\d+)"')  # run and phase; index


@dataclass(slots=True)
class Follower:
    """One client, and what it was told. Episodes of a run come in order, so each shows what is missing before it."""

    campaign: str
    last_id: str | None = None
    episodes: int = 0
    changes: int = 0
    repeated: int = 0
    missing: int = 0
    connections: int = 0
    over: bool = False  # the campaign has ended, and all was told
    errors: Counter[str] = field(default_factory=Counter)
    next_index: dict[str, int] = field(default_factory=dict)  # by run and phase

    @classmethod
    def restored(cls, state: dict[str, Any]) -> "Follower":
        """The follower that `state` was made of."""
        return cls(**state | {"errors": Counter(state["errors"])})

    def state(self) -> dict[str, Any]:
        """All of it as JSON."""
        return asdict(self)

    def told(self, block: bytes) -> None:
        """One block of the stream: an event, or a comment that keeps it alive."""
        fields = dict(line.split(b": ", 1) for line in block.split(b"\n") if b": " in line[1:])
        if b"id" not in fields:
            return
        self.last_id = fields[b"id"].decode()
        if fields[b"event"] == b"state":
            self.changes += 1
            return
        found = _EPISODE.search(fields[b"data"])
        if found is None:
            self.errors["an event that names no episode"] += 1
            return
        run, index = found[1].decode(), int(found[2])
        expected = self.next_index.get(run, 0)
        self.episodes += 1
        self.missing += max(0, index - expected)
        self.repeated += index < expected
        self.next_index[run] = max(expected, index + 1)


async def follow(follower: Follower, port: int, stays_s: float, chance: Random) -> None:
    """Follow until the campaign ends or this task is cancelled.

    Args:
      follower: where it begins, and what it is told.
      port: of the service.
      stays_s: how long it keeps a connection, in the mean, before it breaks off.
      chance: says when.
    """
    await asyncio.sleep(chance.uniform(0, ARRIVAL_S))
    while not follower.over:
        headers = [f"Last-Event-ID: {follower.last_id}"] if follower.last_id else []
        request = get(port, f"/v1/campaigns/{follower.campaign}/events", "Accept: text/event-stream", *headers)
        await _follow_once(follower, port, request, stays_s * chance.uniform(0.5, 1.5))


async def _follow_once(follower: Follower, port: int, request: bytes, stays_s: float) -> None:
    loop = asyncio.get_running_loop()
    stream: Streaming | None = None
    try:
        _, stream = await loop.create_connection(lambda: Streaming(request, follower.told), HOST, port)
        follower.connections += 1
        done, _ = await asyncio.wait([stream.over], timeout=stays_s)
        if not done:
            return
        status = stream.over.result()
        follower.over = status == 204
        if status not in (200, 204):
            follower.errors[f"status {status}"] += 1
    except (OSError, WireError) as error:
        follower.errors[f"{type(error).__name__} {error}"] += 1
    finally:
        if stream is not None:
            stream.close()
    await asyncio.sleep(AGAIN_S)
