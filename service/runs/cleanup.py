"""Removes campaigns with their folders, old campaigns, and places that no campaign names.

A deletion is atomic even if the server dies: the folder is renamed, then the rows are deleted, then the renamed folder.
The name of a leftover folder says which step was reached.
"""

import logging
import shutil
import time
from collections.abc import Callable
from pathlib import Path

from risk_sac.prior import earlier
from risk_sac.scenario import library
from service.errors import StorageError
from service.settings import ServiceSettings
from service.store.reading import Store

logger = logging.getLogger(__name__)

PREFIX = ".deleted-"
RETENTION_S = 10.0  # between two looks for campaigns to delete
DAY_S = 86400.0
BATCH = 10  # campaigns deleted in one look, so that the manager is free in between
LOOK_S = 600.0  # between two looks for unused places
UNUSED_S = 3600.0  # that a place is kept for a campaign that has only been checked, or is just being posted


def dispose(folder: Path, forget: Callable[[], None]) -> None:
    """Removes a campaign's folder, if any, and its rows; if `forget` raises, the folder stays."""
    grave = folder.with_name(f"{PREFIX}{folder.name}")
    if folder.exists():
        folder.rename(grave)
    try:
        forget()
    except BaseException:
        if grave.exists():
            grave.rename(folder)
        raise
    if grave.exists():
        shutil.rmtree(grave)


def settle(campaigns: Path, exists: Callable[[str], bool]) -> None:
    """Finishes, or takes back, what an earlier server had begun to remove.

    Args:
      campaigns: the folder of all campaigns' folders.
      exists: whether the database has a campaign with this id.
    """
    for folder in sorted(campaigns.glob("*")):
        name = folder.name.removeprefix(PREFIX)
        if exists(name):
            if folder.name != name:
                folder.rename(folder.with_name(name))
        elif folder.name != name:
            shutil.rmtree(folder)
        else:
            logger.warning("folder %s belongs to no campaign of the database; it is left alone", folder)


class Retention:
    """Deletes old campaigns in batches, and places that no campaign names."""

    def __init__(self, settings: ServiceSettings, store: Store) -> None:
        self._days = settings.retention_days
        self._places = settings.places_dir
        self._store = store
        self._started_at = time.time()
        self._retire_at = self._prune_at = 0.0  # monotonic times

    def retire(self, dispose: Callable[[str], None]) -> None:
        """Deletes a batch of old campaigns by `dispose(id)`, if it is due."""
        if self._days is None or time.monotonic() < self._retire_at:
            return
        old = self._store.ended_before(time.time() - self._days * DAY_S, BATCH)
        for campaign_id in old:
            dispose(campaign_id)
        if len(old) < BATCH:
            self._retire_at = time.monotonic() + RETENTION_S

    def remove_unused_places(self) -> None:
        """Removes places and copies of earlier scripts that no campaign names, if it is time."""
        if time.monotonic() < self._prune_at:
            return
        try:
            removed = library.prune(self._places, self._store.families(), UNUSED_S, self._started_at)
            earlier.prune(self._places, self._store.priors, time.time() - UNUSED_S)
        except OSError as error:
            raise StorageError(f"the library of places cannot be tidied ({error.strerror})") from error
        self._prune_at = time.monotonic() + LOOK_S
        if removed:
            logger.info("%d places that no campaign names are gone", len(removed))
