"""Which places of maps nobody needs any more."""

import logging
import time
from pathlib import Path

from risk_sac.scenario import library
from service.errors import StorageError
from service.store.reading import Store

logger = logging.getLogger(__name__)

LOOK_S = 600.0  # between two looks
UNUSED_S = 3600.0  # that a place is kept for whoever has only checked a campaign there, or is just posting one


class UnusedPlaces:
    """Removes places from the library that no campaign names."""

    def __init__(self, folder: Path, store: Store) -> None:
        self._folder = folder
        self._store = store
        self._looked_at = float("-inf")

    def remove(self) -> None:
        """Look for them, if it is time.

        Raises:
          StorageError: the database cannot be read, or the library cannot be written.
        """
        if time.monotonic() - self._looked_at < LOOK_S:
            return
        try:
            removed = library.prune(self._folder, self._store.families(), UNUSED_S)
        except OSError as error:
            raise StorageError(f"the library of places cannot be tidied ({error.strerror})") from error
        self._looked_at = time.monotonic()
        if removed:
            logger.info("%d places that no campaign names are gone", len(removed))
