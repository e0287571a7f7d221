"""The current revision of each campaign, in memory, so that a poll needs no database."""

import threading
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Known:
    """A campaign that was read or written."""

    project: str
    revision: int


class Revisions:
    """Revisions noted on each write and on each first read."""

    def __init__(self) -> None:
        self._known: dict[str, Known] = {}
        self._all = 0
        self._lock = threading.Lock()

    @property
    def all(self) -> int:
        """How often any campaign was written since the start."""
        return self._all

    def get(self, campaign_id: str) -> Known | None:
        """The revision of one campaign; None before its first read or write."""
        return self._known.get(campaign_id)

    def learn(self, campaign_id: str, project: str, revision: int) -> Known:
        """Notes what was read; an older revision never replaces a newer one."""
        with self._lock:
            known = self._known.get(campaign_id)
            if known is None or known.revision < revision:
                known = self._known[campaign_id] = Known(project, revision)
            return known

    def note(self, campaign_id: str, project: str, revision: int) -> None:
        """Notes the revision that was written."""
        with self._lock:
            self._known[campaign_id] = Known(project, revision)
            self._all += 1

    def forget(self, campaign_id: str) -> None:
        """Drops a campaign that was deleted."""
        with self._lock:
            self._known.pop(campaign_id, None)
            self._all += 1
