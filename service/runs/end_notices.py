"""Posts a message to `on_end` of each ended campaign.

At least once, in a thread of its own.
"""

import logging
import threading
import time
from collections.abc import Sequence
from urllib.parse import urlsplit

import httpx

from risk_sac.config.base import shown
from risk_sac.errors import ConfigError, RiskSacError
from service.errors import NotFoundError
from service.store.reading import DueNotice, Store
from service.store.writing import Ledger

logger = logging.getLogger(__name__)

LOOK_S = 1.0
TIMEOUT_S = 5.0
BACKOFF_S = (10.0, 60.0)  # between the tries
PORTS = {"http": 80, "https": 443}


def check_allowed(url: str, prefixes: Sequence[str]) -> None:
    """Raises ConfigError of `on_end` unless the operator allows the URL."""
    if not prefixes:
        raise ConfigError("on_end", shown(url), "none: the operator allows none by RISK_SAC_ON_END", "leave it out")
    if not any(_below(url, prefix) for prefix in prefixes):
        raise ConfigError("on_end", shown(url), f"a URL below one of {', '.join(prefixes)}")


def _below(url: str, prefix: str) -> bool:
    """Whether a URL equals a prefix or is below it, origin included."""
    asked, allowed = urlsplit(url), urlsplit(prefix)
    origins = [(each.scheme, each.hostname, each.port or PORTS.get(each.scheme)) for each in (asked, allowed)]
    folder = allowed.path.rstrip("/")
    return origins[0] == origins[1] and (asked.path == folder or asked.path.startswith(f"{folder}/"))


class EndNotices:
    """Delivery of due messages; the database keeps undelivered ones across restarts."""

    def __init__(
        self,
        store: Store,
        ledger: Ledger,
        lock: threading.RLock,
        allowed: Sequence[str],
        backoff_s: Sequence[float] = BACKOFF_S,
    ) -> None:
        """Prepares; `lock` is held for writes, `backoff_s` are waits between tries."""
        self._store, self._ledger, self._lock = store, ledger, lock
        self._allowed, self._backoff_s = allowed, backoff_s
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._work, name="end notices", daemon=True)

    def start(self) -> None:
        """Starts to deliver."""
        self._thread.start()

    def stop(self) -> None:
        """Stops; the next server sends an unfinished message again."""
        self._stopping.set()
        self._thread.join(TIMEOUT_S)

    def _work(self) -> None:
        while not self._stopping.wait(LOOK_S):
            try:
                for notice in self._store.due_notices(time.time()):
                    if self._stopping.is_set():
                        return
                    self._deliver(notice)
            except RiskSacError as error:  # the disk may have room again later
                logger.warning("messages to ends of campaigns wait: %s", error)

    def _deliver(self, notice: DueNotice) -> None:
        try:
            reason = self._refusal(notice)
        except NotFoundError:
            return  # deleted meanwhile
        due_at = None
        if reason is not None and notice.tries < len(self._backoff_s):
            due_at = time.time() + self._backoff_s[notice.tries]
        with self._lock:
            self._ledger.note_try(notice.campaign_id, reason, due_at)
        logger.info("message to its end: %s", reason or "delivered", extra={"campaign": notice.campaign_id})

    def _refusal(self, notice: DueNotice) -> str | None:
        campaign = self._store.campaign(notice.campaign_id)
        message = {
            "campaign": campaign.id,
            "label": campaign.label,
            "state": campaign.state,
            "reason": campaign.reason,
            "headline_kinds": campaign.headline,
            "headline_kinds_published": campaign.headline_published,
            "link": notice.link,
        }
        try:
            check_allowed(notice.url, self._allowed)  # the operator may have changed the list
            with (
                httpx.Client(timeout=TIMEOUT_S, follow_redirects=False, trust_env=False) as client,
                client.stream("POST", notice.url, json=message) as response,  # its body is not read
            ):
                return None if response.is_success else f"the answer was {response.status_code}"
        except ConfigError as error:
            return str(error)
        except (httpx.HTTPError, httpx.InvalidURL) as error:
            return f"{type(error).__name__}: {error}"[:500]
