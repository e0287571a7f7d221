"""Queue, limits, launch, retry, pause, cancel, recover, delete: the only writer of the database."""

import logging
import threading
import time
from collections import Counter
from collections.abc import Sequence

from risk_sac.config import CampaignSpec
from risk_sac.execution.executor import Cause, Cluster, Executor, Exited
from risk_sac.problem import checked_campaign
from risk_sac.records import State, Triage, TriageState
from service.errors import ConflictError, OutdatedError, StorageError
from service.runs.active import Active
from service.runs.disposal import dispose, settle
from service.runs.quota import check_quota, exhausted
from service.runs.retention import Retention
from service.runs.storage_pause import StoragePause, refused
from service.runs.unused_places import UnusedPlaces
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign
from service.store.writing import Ledger
from service.workers.messages import EpisodeDone, Event, Failed, Finished, Started

logger = logging.getLogger(__name__)

TICK_S = 1.0
GATHER_S = 0.5  # clients ask once a second
MOST_AT_ONCE = 500  # messages; meanwhile nobody can post or cancel, and a statement has 32,000 parameters at most
UNKILLABLE_S = 3.0  # how long after SIGKILL a worker may take to vanish


class Manager:
    """Runs campaigns: one thread turns what workers say into rows and starts what waits.

    Requests call `submit`, `cancel`, `triage` and `delete` from their own threads; the lock makes every step whole.

    Attributes:
      restarts: workers that were lost and replaced, by cause.
    """

    def __init__(self, settings: ServiceSettings, store: Store, executor: Executor[Event]) -> None:
        self._settings = settings
        self._store = store
        self._ledger = Ledger(store)
        self._executor = executor
        self._active: dict[int, Active] = {}
        self._deaths: Counter[int] = Counter()  # of a run's workers in a row, without a new episode
        self.restarts: Counter[str] = Counter()
        self._lock = threading.RLock()
        self._stopping = False
        self._storage = StoragePause(store, self._ledger, settings.data_dir)
        self._retention = Retention(settings, store)
        self._unused_places = UnusedPlaces(settings.places_dir, store)
        self._thread = threading.Thread(target=self._work, name="manager", daemon=True)

    @property
    def alive(self) -> bool:
        """Whether campaigns make progress."""
        return self._thread.is_alive()

    @property
    def storage_problem(self) -> str | None:
        """Why campaigns are paused, while they are."""
        return self._storage.reason

    @property
    def cluster(self) -> Cluster | None:
        """The cluster that runs execute on; None where they execute on this machine."""
        return self._executor.cluster

    @property
    def workers(self) -> int:
        """Runs that are executed at once; 0 while there is nowhere to execute them."""
        return int(min(self._settings.max_workers, self._executor.slots))

    def start(self) -> None:
        """Take up what an earlier server left, then work the queue.

        Raises:
          StorageError: the database or the data folder cannot be written.
        """
        try:
            settle(self._settings.data_dir / "campaigns", self._store.exists)
        except OSError as error:
            raise StorageError(refused("tidying the data folder", self._settings.data_dir, error)) from error
        resumed = self._ledger.resume()
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
                self._executor.cancel(number, self._settings.stop_s)
        self._executor.wake()
        self._thread.join(self._settings.stop_s + UNKILLABLE_S)
        if self._thread.is_alive():
            logger.error("workers of runs %s did not end", sorted(self._active))

    def submit(self, spec: CampaignSpec, *, project: str = "default", key: str | None = None) -> StoredCampaign:
        """Queue a campaign, or find the one that this idempotency key has queued before.

        Raises:
          ConfigError: the campaign cannot be run; the error names the field.
          ConflictError: the key has queued another campaign.
          QuotaError: the project has used up its share.
          StorageError: it cannot be written down.
        """
        spec = checked_campaign(spec)
        with self._lock:
            found = None if key is None else self._ledger.find(project, key, spec)
            if found is not None:
                return found
            check_quota(self._store.usage(project), len(spec.runs()), self._settings)
            campaign = self._ledger.create(spec, project, key)
        logger.info("%d runs queued", len(campaign.runs), extra={"campaign": campaign.id})
        self._executor.wake()
        return campaign

    def cancel(self, campaign_id: str, project: str | None = None) -> StoredCampaign:
        """Cancel a campaign; does nothing to one that has ended.

        Raises:
          NotFoundError: there is no such campaign.
          StorageError: the cancellation cannot be written down.
        """
        with self._lock:
            for number in self._ledger.cancel(campaign_id, project):
                if number in self._active:
                    self._active[number].cancelled = True
                    self._executor.cancel(number, self._settings.grace_s)
            return self._store.campaign(campaign_id)

    def triage(
        self, campaign_id: str, failure_id: str, state: TriageState, comment: str, project: str | None = None
    ) -> Triage:
        """Note what people make of a failure; raises what `Ledger.triage` does."""
        with self._lock:
            return self._ledger.triage(campaign_id, failure_id, state, comment, project)

    def delete(self, campaign_id: str, project: str | None = None) -> None:
        """Remove a campaign that has ended, with its files.

        Raises:
          NotFoundError: there is no such campaign.
          ConflictError: it has not ended.
          StorageError: its files or rows cannot be removed.
        """
        with self._lock:
            campaign = self._store.campaign(campaign_id, project)
            leaving = any(active.run.campaign_id == campaign_id for active in self._active.values())
            if not campaign.state.final or leaving:
                message = f"campaign {campaign_id} is {campaign.state}; cancel it and wait until it has ended"
                raise ConflictError(message, reason="not_ended")
            self._dispose(campaign_id)

    def _dispose(self, campaign_id: str) -> None:
        folder = self._settings.campaign_folder(campaign_id)
        try:
            dispose(folder, lambda: self._ledger.delete(campaign_id))
        except OSError as error:
            raise StorageError(refused("deleting a campaign", folder, error)) from error
        logger.info("deleted", extra={"campaign": campaign_id})

    def _work(self) -> None:
        while True:
            heard = self._hear()
            for first in range(0, len(heard), MOST_AT_ONCE):  # a run that was resumed tells all that it has again
                with self._lock:
                    self._take_in(heard[first : first + MOST_AT_ONCE])
            with self._lock:
                if self._stopping:
                    if not self._active:
                        return
                elif self._storage.reason is None:
                    self._tend()
                elif not self._active:
                    self._storage.try_again()

    def _hear(self) -> list[tuple[int, Event | Exited]]:
        """What workers say. Episodes are gathered for a moment: written together they cost less, and show at once."""
        heard = more = self._executor.events(TICK_S)
        until = time.monotonic() + GATHER_S
        while more and all(isinstance(message, EpisodeDone) for _, message in more) and len(heard) < MOST_AT_ONCE:
            left_s = until - time.monotonic()
            more = self._executor.events(left_s) if left_s > 0.0 else []
            heard = heard + more
        return heard

    def _tend(self) -> None:
        try:
            self._launch_waiting()
            self._retention.retire(self._dispose)
            self._unused_places.remove()
        except StorageError as error:
            self._pause(str(error))

    def _handle(self, active: Active, message: Event | Exited) -> None:
        number = active.run.number
        try:
            if isinstance(message, Exited):
                del self._active[number]
                self._end(active, message)
            elif isinstance(message, Finished | Failed):
                active.last = message
            elif isinstance(message, Started):
                logger.info("process %d", message.pid, extra=active.ids)
        except StorageError as error:
            self._pause(str(error), active)

    def _take_in(self, heard: Sequence[tuple[int, Event | Exited]]) -> None:
        """Acts on messages in their order, on episodes that come one after the other at once."""
        episodes: list[tuple[int, EpisodeDone]] = []
        for number, message in heard:
            if isinstance(message, EpisodeDone):
                episodes.append((number, message))
                continue
            self._add_episodes(episodes)
            episodes = []
            self._handle(self._active[number], message)
        self._add_episodes(episodes)

    def _add_episodes(self, told: Sequence[tuple[int, EpisodeDone]]) -> None:
        wanted = [(number, event) for number, event in told if not self._active[number].abandoned]
        try:
            for number in self._ledger.add_episodes(wanted) if wanted else ():
                self._deaths.pop(number, None)
        except StorageError as error:
            self._pause(str(error))

    def _end(self, active: Active, exited: Exited) -> None:
        """Decide what became of a run; a worker's own account goes before its exit status."""
        number, last = active.run.number, active.last
        if active.abandoned:
            return
        if isinstance(last, Finished) and last.finished:
            self._ledger.end_run(number, State.SUCCEEDED, result=last)
        elif isinstance(last, Failed) and last.storage:
            self._pause(last.reason, active)
        elif isinstance(last, Failed):
            self._ledger.end_run(number, State.FAILED, last.reason)
        elif active.cancelled:
            self._ledger.end_run(number, State.CANCELLED)
        elif self._stopping:
            self._ledger.requeue_run(number)
        elif isinstance(last, Finished):
            self._replace(active, Exited("worker was told to stop by somebody else", Cause.KILLED))
        else:
            self._replace(active, exited)
        if active.last is not None or active.cancelled:
            self._deaths.pop(number, None)

    def _replace(self, active: Active, exited: Exited) -> None:
        """A worker was lost: another one goes on from its checkpoint, unless that has failed too often."""
        number = active.run.number
        reason = exited.reason or "worker stopped before its run was done"
        self._deaths[number] += exited.cause is not Cause.LOST  # which is nothing that the run has done
        self.restarts[exited.cause] += 1
        logger.warning("%s; attempt %d", reason, self._deaths[number], extra=active.ids)
        if self._deaths[number] < self._settings.attempts:
            self._ledger.requeue_run(number, f"{reason}; goes on from its checkpoint")
        else:
            times = f"{self._deaths.pop(number)} workers in a row finished no episode"
            self._ledger.end_run(number, State.FAILED, f"{reason}; {times}")

    def _launch_waiting(self) -> None:
        while len(self._active) < self.workers:
            number = self._next()
            if number is None:
                return
            self._launch(self._store.campaign_of(number))

    def _next(self) -> int | None:
        """The run that has waited longest, of the project that has the fewest at work."""
        at_work = Counter(active.project for active in self._active.values())
        waiting = self._store.waiting()
        able = [project for project in waiting if not exhausted(self._store.usage(project), self._settings)]
        return min(((at_work[project], waiting[project]) for project in able), default=(0, None))[1]

    def _launch(self, campaign: StoredCampaign) -> None:
        (run,) = campaign.runs
        folder = self._settings.run_folder(campaign.id, run.id)
        self._ledger.start_run(run.number)
        self._active[run.number] = active = Active(run, campaign.project)
        try:
            self._executor.submit(run.number, run.attempts + 1, campaign.run_spec(run), folder)
        except OutdatedError as error:
            del self._active[run.number]
            self._ledger.end_run(run.number, State.FAILED, str(error))
        except OSError as error:
            del self._active[run.number]
            self._pause(refused("starting a run", folder, error), active)

    def _pause(self, reason: str, *without_worker: Active) -> None:
        """The disk refused: nothing is lost, since workers have their checkpoints; all wait until it has room.

        Args:
          reason: what it said.
          without_worker: runs that are to wait although they have no worker any more.
        """
        self._storage.begin(reason)
        for number, active in self._active.items():
            active.abandoned = True
            self._executor.cancel(number, self._settings.stop_s)
        numbers = {active.run.number for active in (*self._active.values(), *without_worker)}
        self._storage.write_down(numbers, reason)
