"""Follows a campaign: its stream of events, and its state by polling."""

import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import httpx

from risk_sac.client.transport import Overdue, StreamLost, Transport, Unreachable, read
from risk_sac.records import FINAL, Campaign

AWAY_S = 120.0  # how long a service that was there may be away, as when it is restarted
SILENCE_S = 45.0  # three times what the service leaves between two signs of life
LOOK_S = 1.0  # between two looks at a campaign, and between two streams of events


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """An event of a campaign."""

    id: str  # opaque; the stream goes on after it
    name: str  # episode | failure (instead of it) | state
    data: dict[str, Any]

    @property
    def last(self) -> bool:
        """Whether the campaign has ended with it."""
        return self.name == "state" and self.data.get("run_id") is None and self.data.get("state") in FINAL


def events(transport: Transport, path: str, last_event_id: str | None, away_s: float) -> Iterator[Event]:
    """Yields the events of the campaign at a path; see `Client.events`."""
    patience_s = transport.patience_s
    while True:
        heard = False
        try:
            for message in transport.listen(
                f"{path}/events", last_event_id, silence_s=SILENCE_S, patience_s=patience_s
            ):
                event = Event(id=message.id, name=message.event, data=json.loads(message.data))
                heard, last_event_id = True, event.id or last_event_id
                yield event
                if event.last:
                    return
            # A stream also ends when the service stops; the next one continues it.
            if not heard and read(Campaign, transport.ask("GET", path, patience_s=away_s)).ended:
                return
        except StreamLost:
            pass
        patience_s = away_s
        time.sleep(LOOK_S)


def follow(transport: Transport, path: str, timeout_s: float | None, away_s: float) -> Iterator[Campaign]:
    """Yields the states of the campaign at a path; see `Client.follow`."""
    deadline = math.inf if timeout_s is None else time.monotonic() + timeout_s
    patience_s, headers = transport.patience_s, dict[str, str]()
    known: Campaign | None = None
    while (left_s := deadline - time.monotonic()) > 0:
        try:
            response = transport.ask("GET", path, headers=headers, patience_s=min(patience_s, left_s))
        except Unreachable:
            if time.monotonic() < deadline:
                raise
            break
        if response.status_code != httpx.codes.NOT_MODIFIED:
            campaign = read(Campaign, response)
            if campaign != known:
                yield campaign
            if campaign.ended:
                return
            patience_s, headers, known = away_s, {"If-None-Match": response.headers.get("etag", "")}, campaign
        time.sleep(min(LOOK_S, max(0.0, deadline - time.monotonic())))
    raise Overdue(f"it did not end within {timeout_s:g} s; it goes on, and can be followed again")
