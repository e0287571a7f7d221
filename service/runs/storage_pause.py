"""Pause while the disk refuses writes: its reason and the time of the next try."""

import logging
import time
from collections.abc import Collection
from pathlib import Path

from service.errors import StorageError
from service.store.reading import Store
from service.store.writing import Ledger

logger = logging.getLogger(__name__)

PROBE_BYTES = 16 << 20  # what there must be room for before a pause ends: a checkpoint and then some
FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 30.0  # before a disk that refused is tried again; doubles while it goes on
CALM_S = 60.0  # a disk that behaved for so long is trusted again


class StoragePause:
    """State of the pause; only the manager's thread begins and ends it."""

    def __init__(self, store: Store, ledger: Ledger, data_dir: Path) -> None:
        self._store = store
        self._ledger = ledger
        self._data_dir = data_dir
        self._refused_at, self._wait_s = float("-inf"), FIRST_WAIT_S

    @property
    def reason(self) -> str | None:
        """The disk's error while the pause lasts."""
        return self._store.refusal

    def begin(self, reason: str) -> None:
        """Shows campaigns at work as paused from now on."""
        logger.error("paused: %s", reason)
        calm = time.monotonic() - self._refused_at > CALM_S
        self._wait_s = FIRST_WAIT_S if calm else min(2 * self._wait_s, LONGEST_WAIT_S)
        self._refused_at = time.monotonic()
        self._store.refusal = reason

    def write_down(self, numbers: Collection[int], reason: str) -> None:
        """Stores which runs are paused, if the disk accepts it."""
        try:
            self._ledger.pause(numbers, reason)
        except StorageError:
            logger.info("the pause itself cannot be written down; it is shown all the same")

    def try_again(self) -> None:
        """Ends the pause if the disk has room, else doubles the wait; a no-op before it is over."""
        if time.monotonic() - self._refused_at < self._wait_s:
            return
        try:
            _probe(self._data_dir)
            resumed = self._ledger.resume()
        except (OSError, StorageError) as error:
            logger.info("still refused: %s", error)
            self._refused_at = time.monotonic()
            self._wait_s = min(2 * self._wait_s, LONGEST_WAIT_S)
            return
        logger.info("storage works again, which refused (%s); %d runs go on", self.reason, resumed)
        self._store.refusal = None


def refused(doing: str, folder: Path, error: OSError) -> str:
    """Returns the error in one line without paths; the log has the paths."""
    return f"storage failed while {doing}: {error.strerror} ({Path(error.filename or folder).name!r})"


def _probe(folder: Path) -> None:
    """Writes as much as the next checkpoints may take."""
    probe = folder / ".probe"
    try:
        with probe.open("wb", buffering=0) as file:
            file.write(bytes(PROBE_BYTES))
    finally:
        probe.unlink(missing_ok=True)
