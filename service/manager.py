"""Queue, limits, launch, cancel, recover: the only writer of the database."""

import logging
import threading
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config import CampaignSpec
from risk_sac.problem import check_campaign
from service.campaigns import State
from service.errors import StorageError
from service.events import EpisodeDone, Event, Failed, Finished, Started
from service.executor import Executor, Exited
from service.ledger import Ledger
from service.records import Campaign, Run
from service.settings import ServiceSettings
from service.store import Store

logger = logging.getLogger(__name__)

TICK_S = 1.0  # how soon a write that the disk refused is tried again
UNKILLABLE_S = 10.0  # how long after SIGKILL a worker may take to vanish


@dataclass(slots=True)
class _Active:
    """A run whose worker lives."""

    run: Run
    cancelled: bool = False
    abandoned: bool = False  # its campaign has failed; what it still says is not wanted
    last: Finished | Failed | None = None


class Manager:
    """Runs campaigns: one thread turns what workers say into rows and starts what waits.

    Requests call `submit` and `cancel` from their own threads; the lock makes every step whole.
    """

    def __init__(self, settings: ServiceSettings, store: Store, executor: Executor) -> None:
        self._settings = settings
        self._store = store
        self._ledger = Ledger(store)
        self._executor = executor
        self._active: dict[int, _Active] = {}
        self._lock = threading.RLock()
        self._stopping = False
        self._thread = threading.Thread(target=self._work, name="manager", daemon=True)

    @property
    def alive(self) -> bool:
        """Whether campaigns make progress."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Take up what an earlier server left, then work the queue.

        Raises:
          StorageError: the database cannot be written.
        """
        resumed = self._ledger.recover()
        if resumed:
            logger.info("%d interrupted runs go back to the queue", resumed)
        self._thread.start()

    def stop(self) -> None:
        """Stop all workers at their next episode boundary, leave their runs queued, and return.

        Runs whose worker cannot even be killed stay `running`; the next start puts them back in the queue.
        """
        with self._lock:
            self._stopping = True
            for number in self._active:
                self._executor.cancel(number)
        self._executor.wake()
        self._thread.join(self._settings.grace_s + UNKILLABLE_S)
        if self._thread.is_alive():
            logger.error("workers of runs %s did not end", sorted(self._active))

    def submit(self, spec: CampaignSpec) -> Campaign:
        """Queue a campaign.

        Raises:
          ConfigError: the campaign cannot be run; the error names the field.
          StorageError: it cannot be written down.
        """
        check_campaign(spec)
        with self._lock:
            campaign = self._ledger.create(spec)
        logger.info("campaign %s: %d runs queued", campaign.id, len(campaign.runs))
        self._executor.wake()
        return campaign

    def cancel(self, campaign_id: str) -> Campaign:
        """Cancel a campaign; does nothing to one that has ended.

        Raises:
          NotFoundError: there is no such campaign.
          StorageError: the cancellation cannot be written down.
        """
        with self._lock:
            for number in self._ledger.cancel(campaign_id):
                self._active[number].cancelled = True
                self._executor.cancel(number)
            return self._store.campaign(campaign_id)

    def _work(self) -> None:
        while True:
            for number, message in self._executor.events(TICK_S):
                with self._lock:
                    self._handle(self._active[number], message)
            with self._lock:
                self._ledger.save_failures()
                if not self._stopping:
                    self._launch_waiting()
                elif not self._active:
                    return

    def _handle(self, active: _Active, message: Event | Exited) -> None:
        try:
            if isinstance(message, Exited):
                del self._active[active.run.number]
                self._end(active, message)
            elif isinstance(message, EpisodeDone) and not active.abandoned:
                self._ledger.add_episode(active.run.number, message)
            elif isinstance(message, Finished | Failed):
                active.last = message
            elif isinstance(message, Started):
                logger.info("run %s of campaign %s: process %d", active.run.id, active.run.campaign_id, message.pid)
        except StorageError as error:
            self._abandon(active.run.campaign_id, str(error))

    def _end(self, active: _Active, exited: Exited) -> None:
        """Decide what became of a run; a worker's own account goes before its exit status."""
        number, last = active.run.number, active.last
        if active.abandoned:
            return
        if isinstance(last, Finished) and last.finished:
            self._ledger.end_run(number, State.SUCCEEDED, result=last)
        elif isinstance(last, Failed) and last.storage:
            self._abandon(active.run.campaign_id, last.reason)
        elif isinstance(last, Failed):
            self._ledger.end_run(number, State.FAILED, last.reason)
        elif active.cancelled:
            self._ledger.end_run(number, State.CANCELLED)
        elif self._stopping:
            self._ledger.requeue_run(number)
        else:
            self._ledger.end_run(number, State.FAILED, exited.reason or "worker stopped before its run was done")

    def _launch_waiting(self) -> None:
        while len(self._active) < self._settings.max_workers:
            try:
                run = self._store.next_queued()
            except StorageError as error:
                logger.warning("the queue cannot be read: %s", error)
                return
            if run is None:
                return
            self._launch(run)

    def _launch(self, run: Run) -> None:
        folder = self._settings.run_folder(run.campaign_id, run.id)
        try:
            spec = self._store.campaign(run.campaign_id).run_spec(run)
            self._ledger.start_run(run.number)
            self._executor.submit(run.number, spec, folder)
            self._active[run.number] = _Active(run)
        except StorageError as error:
            self._abandon(run.campaign_id, str(error))
        except OSError as error:
            self._abandon(run.campaign_id, _refused(folder, error))

    def _abandon(self, campaign_id: str, reason: str) -> None:
        """The disk refused: the campaign ends here, and what it found so far stays readable."""
        logger.error("campaign %s failed: %s", campaign_id, reason)
        for number, active in self._active.items():
            if active.run.campaign_id == campaign_id:
                active.abandoned = True
                self._executor.cancel(number)
        self._ledger.fail(campaign_id, reason)


def _refused(folder: Path, error: OSError) -> str:
    return f"storage failed while starting a run: {error.strerror} ({str(error.filename or folder)!r})"
