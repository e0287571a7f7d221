"""Quotas, storage pauses, and removal of campaigns and places."""

import logging
import shutil
import time
from collections.abc import Callable, Collection
from pathlib import Path

from risk_sac.scenario import library
from risk_sac.search.prior import earlier
from service.errors import QuotaError, StorageError
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import Usage
from service.store.writing import Ledger

RETRY_S = 60.0
HOUR_S = 3600.0


def check_quota(usage: Usage, new_runs: int, settings: ServiceSettings) -> None:
    """Raises QuotaError for too many queued runs or spent worker hours."""
    if usage.queued_runs + new_runs > settings.quota_queued_runs:
        raise QuotaError(
            f"got {new_runs} runs with {usage.queued_runs} waiting already; wanted at most "
            f"{settings.quota_queued_runs} of one project in the queue",
            RETRY_S,
        )
    if exhausted(usage, settings):
        raise QuotaError(
            f"the project has used {usage.cpu_s / HOUR_S:.2f} worker hours within 24; wanted at most "
            f"{settings.quota_cpu_hours:g}",
            HOUR_S,
        )


def exhausted(usage: Usage, settings: ServiceSettings) -> bool:
    """Returns whether a project has used up its worker hours."""
    return settings.quota_cpu_hours is not None and usage.cpu_s >= settings.quota_cpu_hours * HOUR_S


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
        """Ends the pause if the disk has room, else doubles the wait."""
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
    """Returns the error in one line; paths go to the log only."""
    return f"storage failed while {doing}: {error.strerror} ({Path(error.filename or folder).name!r})"


def _probe(folder: Path) -> None:
    """Writes as much as the next checkpoints may take."""
    probe = folder / ".probe"
    try:
        with probe.open("wb", buffering=0) as file:
            file.write(bytes(PROBE_BYTES))
    finally:
        probe.unlink(missing_ok=True)


PREFIX = ".deleted-"
RETENTION_S = 10.0  # between two looks for campaigns to delete
DAY_S = 86400.0
BATCH = 10  # campaigns deleted in one look, so that the manager is free in between
LOOK_S = 600.0  # between two looks for unused places
UNUSED_S = 3600.0  # that a place is kept for a campaign that has only been checked, or is just being posted


def dispose(folder: Path, forget: Callable[[], None]) -> None:
    """Removes a campaign's folder and rows; keeps both if `forget` raises."""
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
        self._places, self._scenarios = settings.places_dir, settings.scenarios_dir
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
        """Removes, if due, places and script copies that no campaign names."""
        if time.monotonic() < self._prune_at:
            return
        try:
            posted = {record.name for record in self._scenarios.glob("*/*")}
            removed = library.prune(self._places, self._store.families() | posted, UNUSED_S, self._started_at)
            earlier.prune(self._places, self._store.priors, time.time() - UNUSED_S)
        except OSError as error:
            raise StorageError(f"the library of places cannot be tidied ({error.strerror})") from error
        self._prune_at = time.monotonic() + LOOK_S
        if removed:
            logger.info("%d places that no campaign names are gone", len(removed))
