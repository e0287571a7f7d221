"""Keeps campaigns' revisions in memory, so that a poll needs no database."""

import threading
from typing import NamedTuple


class Known(NamedTuple):
    """A campaign that was read or written."""

    project: str
    revision: int


class Revisions:
    """Revisions noted on each write and on each first read.

    Attributes:
      all: how often any campaign was written since the start.
    """

    def __init__(self) -> None:
        self.all = 0
        self._known: dict[str, Known] = {}
        self._lock = threading.Lock()

    def get(self, campaign_id: str) -> Known | None:
        """The revision of one campaign; None before its first read or write."""
        return self._known.get(campaign_id)

    def learn(self, campaign_id: str, project: str, revision: int) -> int:
        """Stores and returns a revision, or the newer one that is known."""
        with self._lock:
            known = self._known.get(campaign_id)
            if known is None or known.revision < revision:
                known = self._known[campaign_id] = Known(project, revision)
            return known.revision

    def note(self, campaign_id: str, project: str, revision: int) -> None:
        """Notes the revision that was written."""
        with self._lock:
            self._known[campaign_id] = Known(project, revision)
            self.all += 1

    def forget(self, campaign_id: str) -> None:
        """Drops a campaign that was deleted."""
        with self._lock:
            self._known.pop(campaign_id, None)
            self.all += 1
