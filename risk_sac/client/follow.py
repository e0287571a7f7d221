"""A campaign as it changes: by its stream of events while there is one, by asking now and then otherwise.

Events only say when to look. What is shown comes from the campaign itself, so lost streams, restarts of the service
and repeated events cannot make it wrong.
"""

import math
import time
from collections.abc import Iterator
from contextlib import closing

from risk_sac.client.errors import Overdue, Refused, StreamLost, UnexpectedAnswer, Unreachable, retry_after_s
from risk_sac.client.transport import Transport, read
from risk_sac.records import Campaign

AWAY_S = 120.0  # how long a service that was there may be away, as when it is restarted
SILENCE_S = 45.0  # three times what the service leaves between two signs of life
LOOK_S = 0.5  # between two looks, however many events there are
POLL_S, LONGEST_POLL_S = 1.0, 60.0  # between two looks without a stream: by default, and at most


class Follower:
    """Looks at one campaign, again and again."""

    def __init__(self, transport: Transport, path: str, *, timeout_s: float | None, away_s: float) -> None:
        self._transport = transport
        self._path = path
        self._timeout_s = timeout_s
        self._patience_s = transport.patience_s  # until it was seen once
        self._away_s = away_s  # from then on
        self._began = self._looked = time.monotonic()
        self._poll_s = POLL_S
        self._tag: str | None = None
        self._streaming = True
        self._last_event_id: str | None = None

    def changes(self) -> Iterator[Campaign]:
        """The campaign now, and whenever it has changed, until it has ended.

        Raises:
          Overdue: the time is up.
          ClientError: the campaign is unknown, or the service stayed away.
        """
        try:
            yield from self._changes()
        except Unreachable:
            self._left_s()  # not the service's fault if there was no time left for an answer
            raise

    def _changes(self) -> Iterator[Campaign]:
        campaign = self._look(None)
        yield campaign
        self._patience_s = self._away_s
        while not campaign.ended:
            for _ in self._occasions():
                before, campaign = campaign, self._look(campaign)
                if campaign != before:
                    yield campaign
                if campaign.ended:
                    break

    def _occasions(self) -> Iterator[None]:
        """When to look: as events come in, and once they come no more."""
        if self._streaming:
            yield from self._events()
        # Where there was a stream it can be had again as soon as the service is back.
        time.sleep(min(POLL_S if self._streaming else self._poll_s, self._left_s()))
        yield

    def _events(self) -> Iterator[None]:
        events = self._transport.listen(
            f"{self._path}/events",
            self._last_event_id,
            silence_s=min(SILENCE_S, self._left_s()),
            patience_s=self._bounded_patience_s(),
        )
        try:
            with closing(events):
                for message in events:
                    self._last_event_id = message.id or self._last_event_id
                    if message.event == "state" or time.monotonic() - self._looked >= LOOK_S:
                        yield
                    self._left_s()
        except StreamLost:
            pass
        except (Refused, UnexpectedAnswer):  # it has no such stream; if something else is wrong, looking will tell
            self._streaming = False

    def _look(self, known: Campaign | None) -> Campaign:
        headers = {} if self._tag is None else {"If-None-Match": self._tag}
        response = self._transport.ask("GET", self._path, headers=headers, patience_s=self._bounded_patience_s())
        self._looked = time.monotonic()
        self._poll_s = min(retry_after_s(response) or POLL_S, LONGEST_POLL_S)
        if known is not None and response.status_code == 304:
            return known
        self._tag = response.headers.get("etag")
        return read(Campaign, response)

    def _bounded_patience_s(self) -> float:
        return min(self._patience_s, self._left_s())

    def _left_s(self) -> float:
        """Time until the deadline.

        Raises:
          Overdue: there is none left.
        """
        if self._timeout_s is None:
            return math.inf
        left_s = self._timeout_s - (time.monotonic() - self._began)
        if left_s <= 0:
            raise Overdue(f"it did not end within {self._timeout_s:g} s; it goes on, and can be followed again")
        return left_s
