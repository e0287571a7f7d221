"""Which campaigns have been kept long enough."""

import time
from collections.abc import Callable

from service.settings import ServiceSettings
from service.store.reading import Store

RETENTION_S = 10.0  # between two looks for campaigns to delete
DAY_S = 86400.0
BATCH = 10  # campaigns deleted in one look, so that the manager is free in between


class Retention:
    """Deletes what ended `retention_days` ago, a batch at a time."""

    def __init__(self, settings: ServiceSettings, store: Store) -> None:
        self._days = settings.retention_days
        self._store = store
        self._looked_at = float("-inf")

    def retire(self, dispose: Callable[[str], None]) -> None:
        """Look for campaigns to delete, if it is time.

        Args:
          dispose: deletes the campaign with this id.

        Raises:
          StorageError: the database cannot be read, or `dispose` says so.
        """
        if self._days is None or time.monotonic() - self._looked_at < RETENTION_S:
            return
        old = self._store.ended_before(time.time() - self._days * DAY_S, BATCH)
        for campaign_id in old:
            dispose(campaign_id)
        if len(old) < BATCH:
            self._looked_at = time.monotonic()
