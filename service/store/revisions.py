"""Which revision each campaign has, known by heart: whoever asks whether anything is new needs no database."""

import threading
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Mark:
    """What one campaign, or all of them, looked like at a moment; another one once something is new.

    Marks that differ in `latest` alone are apart by nothing but episodes, of which a busy service has many a second.
    """

    latest: int
    settled: int
    refusal: str | None = None  # of the disk, which is shown with each campaign at work


@dataclass(frozen=True, slots=True)
class Known:
    """A campaign that was read or written."""

    project: str
    mark: Mark


class Revisions:
    """What was noted of campaigns by the one who writes them, and by those who read them."""

    def __init__(self) -> None:
        self._known: dict[str, Known] = {}
        self._all = Mark(0, 0)
        self._lock = threading.Lock()

    @property
    def all(self) -> Mark:
        """Of all campaigns together."""
        return self._all

    def get(self, campaign_id: str) -> Known | None:
        """Of one campaign; None if nobody has asked for it yet, or if there is none."""
        return self._known.get(campaign_id)

    def learn(self, campaign_id: str, project: str, revision: int) -> Known:
        """Remember what was read; an older revision never replaces a newer one."""
        with self._lock:
            known = self._known.get(campaign_id)
            if known is None or known.mark.latest < revision:
                known = self._known[campaign_id] = Known(project, Mark(revision, revision))
            return known

    def note(self, campaign_id: str, project: str, revision: int, *, episode: bool = False) -> None:
        """Remember what was written.

        Args:
          campaign_id: of the campaign.
          project: whose it is.
          revision: that it has now.
          episode: whether nothing but an episode was added.
        """
        before = self.learn(campaign_id, project, 0)
        with self._lock:
            settled = before.mark.settled if episode else revision
            self._known[campaign_id] = Known(project, Mark(revision, settled))
            self._count(settled=not episode)

    def forget(self, campaign_id: str) -> None:
        """A campaign was deleted."""
        with self._lock:
            self._known.pop(campaign_id, None)
            self._count(settled=True)

    def _count(self, *, settled: bool) -> None:
        latest = self._all.latest + 1
        self._all = Mark(latest, latest if settled else self._all.settled)
