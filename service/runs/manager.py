"""Manager of campaigns: queue, limits, retries, recovery; only it writes the database."""

import logging
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from risk_sac.config import CampaignSpec
from risk_sac.env.problem import checked_campaign
from risk_sac.execution.executor import FOLDER, ClusterState, Executor, WorkerProgram
from risk_sac.execution.messages import EpisodeDone, Finished
from risk_sac.execution.scheduler import MOST_AT_ONCE, Active, QueuedRun, Scheduler, SlotUse
from risk_sac.records import State, Triage, TriageState
from risk_sac.run_folder.durable import remove_abandoned, remove_temporaries
from risk_sac.search.prior.earlier import PriorContent, keep
from risk_sac.search.prior.policy import check_prior
from service.errors import ConflictError, OutdatedError, StorageError
from service.runs.cleanup import Retention, StoragePause, check_quota, dispose, exhausted, refused, settle
from service.runs.end_notices import EndNotices, check_allowed
from service.settings import ServiceSettings
from service.store.reading import Store
from service.store.stored import StoredCampaign
from service.store.writing import Ledger

if TYPE_CHECKING:
    from service.runs.imported import Imports

logger = logging.getLogger(__name__)

LOG = "worker.log"  # in a run's folder
TICK_S = 1.0
GATHER_S = 0.5  # clients ask once a second
UNKILLABLE_S = 3.0  # how long after SIGKILL a worker may take to vanish


class Manager:
    """Runs campaigns: a thread works the scheduler, whose `RunStore` this is.

    Requests call `submit`, `cancel`, `triage` and `delete` from their own threads; the lock makes every step whole.
    """

    def __init__(self, settings: ServiceSettings, store: Store, executor: Executor) -> None:
        self._settings = settings
        self._store = store
        self._ledger = Ledger(store)
        self._executor = executor
        self._scheduler = Scheduler(executor, self, settings.attempts)
        self._lock = threading.RLock()
        self._storage = StoragePause(store, self._ledger, settings.data_dir)
        self._retention = Retention(settings, store)
        self._notices = EndNotices(store, self._ledger, self._lock, settings.on_end)
        self._imports: Imports | None = None
        self._thread = threading.Thread(target=self._work, name="manager", daemon=True)

    @property
    def alive(self) -> bool:
        """Whether campaigns make progress."""
        return self._thread.is_alive()

    @property
    def restarts(self) -> Counter[str]:
        """Workers that were lost and replaced, by cause."""
        return self._scheduler.restarts

    @property
    def storage_problem(self) -> str | None:
        """Why campaigns are paused, while they are."""
        return self._storage.reason

    @property
    def cluster(self) -> ClusterState | None:
        """Cluster that runs execute on; None on this machine."""
        return self._executor.cluster

    def at_work(self) -> list[Active]:
        """Returns the runs that have a worker, the oldest first."""
        with self._lock:
            return [self._scheduler.active[number] for number in sorted(self._scheduler.active)]

    def silent_s(self, number: int) -> float | None:
        """Returns the time since a worker's last sign of life, else None."""
        return self._executor.silent_s(number)

    def node_of(self, number: int) -> str | None:
        """Returns the address of a run's cluster node; None on this machine."""
        nodes = () if self._executor.cluster is None else self._executor.cluster.nodes
        return next((node.address for node in nodes if number in node.silences), None)

    @property
    def workers(self) -> int:
        """Number of slots that runs share; 0 while no executor is available."""
        return int(min(self._settings.max_workers, self._executor.slots))

    def start(self) -> None:
        """Takes up what an earlier server left, then works the queue."""
        try:
            settle(self._settings.data_dir / "campaigns", self._store.exists)
        except OSError as error:
            raise StorageError(refused("tidying the data folder", self._settings.data_dir, error)) from error
        for campaign_id in self._store.begun_imports():
            logger.warning("its import was interrupted; it is removed", extra={"campaign": campaign_id})
            self._dispose(campaign_id)
        if self._settings.runs is not None:
            from service.runs.imported import Imports  # here, because loading the report takes a while

            self._imports = Imports(self._settings, self._store, self._ledger, self._lock, self._dispose)
            self._imports.start()
        threading.Thread(target=_tidy, args=(self._settings.data_dir, time.time()), name="tidy", daemon=True).start()
        resumed = self._ledger.resume()
        if resumed:
            logger.info("%d interrupted runs go back to the queue", resumed)
        self._thread.start()
        self._notices.start()

    def stop(self) -> None:
        """Stops all workers at their next episode boundary and requeues their runs.

        Runs whose worker cannot even be killed stay `running`; the next start puts them back in the queue.
        """
        self._notices.stop()
        with self._lock:
            self._scheduler.stop(self._settings.stop_s)
        self._executor.wake()
        if self._imports is not None:
            self._imports.stop(self._settings.stop_s)
        self._thread.join(self._settings.stop_s + UNKILLABLE_S)
        if self._thread.is_alive():
            logger.error("workers of runs %s did not end", sorted(self._scheduler.active))

    def submit(
        self,
        spec: CampaignSpec,
        *,
        project: str = "default",
        key: str | None = None,
        prior: PriorContent | None = None,
        base_url: str = "",
    ) -> StoredCampaign:
        """Queues a campaign with a copy of its prior; idempotent by key.

        Args:
          spec: of the campaign.
          project: that it belongs to.
          key: of idempotency.
          prior: content of its prior.
          base_url: of the server as the caller sees it, for links in the message to the campaign's end.

        Raises:
          ConfigError: the campaign cannot be run; the error names the field.
          ConflictError: the key has queued another campaign.
          QuotaError: the project has used up its share.
          StorageError: the copy cannot be written.
        """
        spec = self.checked(spec)
        if prior is not None:
            try:
                spec = spec.model_copy(update={"prior": keep(spec.prior, prior)})
            except OSError as error:
                raise StorageError(refused("copying a prior", self._settings.places_dir, error)) from error
        with self._lock:
            found = None if key is None else self._ledger.find(project, key, spec)
            if found is not None:
                return found
            check_quota(self._store.usage(project), len(spec.runs()), self._settings)
            campaign = self._ledger.create(spec, project, key, base_url)
        logger.info("%d runs queued", len(campaign.runs), extra={"campaign": campaign.id})
        self._executor.wake()
        return campaign

    def checked(self, spec: CampaignSpec) -> CampaignSpec:
        """Checks a campaign but not its prior; returns it with ego version.

        Raises:
          ConfigError: the campaign cannot be run; the error names the field.
        """
        if spec.on_end is not None:
            check_allowed(spec.on_end, self._settings.on_end)
        spec = checked_campaign(spec)
        for name in spec.methods:
            check_prior(name, spec.prior)
        return spec

    def cancel(self, campaign_id: str, project: str | None = None) -> StoredCampaign:
        """Cancels a campaign; does nothing to one that has ended."""
        with self._lock:
            for number in self._ledger.cancel(campaign_id, project):
                self._scheduler.cancel(number, self._settings.grace_s)
            return self._store.campaign(campaign_id)

    def triage(
        self, campaign_id: str, failure_id: str, state: TriageState, comment: str, project: str | None = None
    ) -> Triage:
        """Stores the triage of a failure."""
        with self._lock:
            return self._ledger.triage(campaign_id, failure_id, state, comment, project)

    def tag(self, campaign_id: str, tags: Sequence[str], project: str | None = None) -> StoredCampaign:
        """Replaces the tags of a campaign."""
        with self._lock:
            self._ledger.tag(campaign_id, tags, project)
            return self._store.campaign(campaign_id)

    def delete(self, campaign_id: str, project: str | None = None) -> None:
        """Deletes a campaign with its files; ConflictError if it has not ended."""
        with self._lock:
            campaign = self._store.campaign(campaign_id, project)
            leaving = any(active.run.ids["campaign"] == campaign_id for active in self._scheduler.active.values())
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
            heard = self._scheduler.hear(TICK_S, GATHER_S)
            for first in range(0, len(heard), MOST_AT_ONCE):  # a run that was resumed tells all that it has again
                with self._lock:
                    self._scheduler.take_in(heard[first : first + MOST_AT_ONCE])
            with self._lock:
                if self._scheduler.stopping:
                    if not self._scheduler.active:
                        return
                elif self._storage.reason is None:
                    self._tend()
                elif not self._scheduler.active:
                    self._storage.try_again()

    def _tend(self) -> None:
        with self._pausing():
            self._scheduler.fill(self.workers)
            self._retention.retire(self._dispose)
            self._retention.remove_unused_places()

    @contextmanager
    def _pausing(self, run: QueuedRun | None = None) -> Iterator[None]:
        """Pauses if database or disk refuse; `run` waits, its worker lost."""
        try:
            yield
        except StorageError as error:
            self._pause(str(error), run)

    def _pause(self, reason: str, without_worker: QueuedRun | None = None) -> None:
        """Pauses all runs until the disk has room; checkpoints keep their progress."""
        self._storage.begin(reason)
        self._scheduler.abandon(self._settings.stop_s)
        numbers = set(self._scheduler.active)
        self._storage.write_down(numbers if without_worker is None else numbers | {without_worker.number}, reason)

    # What follows is the `RunStore` of the scheduler.

    def start_next(self, use: SlotUse) -> QueuedRun | None:
        """Returns the oldest queued run of the project with the fewest slots."""
        while True:
            waiting = self._store.waiting()
            able = [project for project in waiting if not exhausted(self._store.usage(project), self._settings)]
            project = next_project({project: waiting[project] for project in able}, use.taken)
            if project is None:
                return None
            number = waiting[project]
            campaign = self._store.campaign_of(number)
            (run,) = campaign.runs
            try:
                spec = campaign.run_spec(run)
            except OutdatedError as error:
                self._ledger.end_run(number, State.FAILED, str(error))
                continue
            slots = use.granted(spec, campaign.project, able)
            self._ledger.start_run(number, slots)
            folder = self._settings.run_folder(campaign.id, run.id)
            ids = {"campaign": campaign.id, "run": run.id}
            return QueuedRun(number=number, spec=spec, folder=folder, slots=slots, project=campaign.project, ids=ids)

    def not_started(self, run: QueuedRun, error: OSError) -> None:
        """See `RunStore`."""
        self._pause(refused("starting a run", run.folder, error), run)

    def add_episodes(self, events: Sequence[tuple[int, EpisodeDone]]) -> set[int]:
        """See `RunStore`."""
        with self._pausing():
            return self._ledger.add_episodes(events)
        return set()

    def ended(self, run: QueuedRun, state: State, reason: str | None = None, result: Finished | None = None) -> None:
        """See `RunStore`."""
        with self._pausing(run):
            self._ledger.end_run(run.number, state, reason, result)

    def requeued(self, run: QueuedRun, reason: str | None) -> None:
        """See `RunStore`."""
        with self._pausing(run):
            self._ledger.requeue_run(run.number, reason)

    def storage_refused(self, run: QueuedRun, reason: str) -> None:
        """See `RunStore`."""
        self._pause(reason, run)


def next_project(oldest: Mapping[str, int], taken: Mapping[str, int]) -> str | None:
    """Returns the project whose oldest run starts next.

    It has the fewest slots or, of several, the oldest run.
    """
    return min(oldest, key=lambda project: (taken.get(project, 0), oldest[project]), default=None)


def _tidy(data_dir: Path, before: float) -> None:
    """Removes what processes that were killed left half written."""
    remove_abandoned(Path(tempfile.gettempdir()))
    remove_temporaries(data_dir, before)


def worker_program(settings: ServiceSettings) -> WorkerProgram:
    """The worker that the settings name."""
    numbers = settings.worker_niceness, settings.worker_memory_bytes, settings.replays
    return WorkerProgram(
        arguments=("-m", settings.worker_module, FOLDER, *map(str, numbers)),
        log=LOG,
        lease_s=settings.lease_s,
        stall_s=settings.stall_s,
        linger_s=settings.grace_s,
    )
