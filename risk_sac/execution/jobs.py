"""Runs of a campaign without a server, in memory and in folders."""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import FOLDER, Executor, WorkerProgram
from risk_sac.execution.messages import EpisodeDone, Finished
from risk_sac.execution.scheduler import QueuedRun, Scheduler, SlotUse
from risk_sac.records import State as RunState
from risk_sac.run_folder.crash_guard import PATIENCE
from risk_sac.run_folder.results import RESULTS, read_results

LOG = "run.log"  # in a run's folder: what its worker printed
ATTEMPTS = PATIENCE + 1  # the last one without the episode that crashed the others
LINGER_S = 30.0
POLL_S = 0.1
GONE_S = 5.0  # until a killed process is gone, or the signal that killed us has cost us the news of it

State = Literal["waiting", "running", "finished", "failed", "stopped"]


@dataclass(slots=True, kw_only=True)
class Job:
    """A run on its way."""

    spec: RunSpec
    folder: Path
    state: State = "waiting"
    attempts: int = 0
    episodes: int = 0  # told so far
    reason: str = "not started"  # why it is not finished

    @property
    def name(self) -> str:
        """Unique within the campaign."""
        return self.folder.name

    @property
    def total(self) -> int:
        """Episodes of both phases."""
        return self.spec.budget.total_episodes

    def look(self) -> None:
        """Finds out whether the folder holds the finished run already."""
        try:
            if (self.folder / RESULTS).exists():
                results = read_results(self.folder)
                if results.finished and results.spec_digest == self.spec.digest:
                    self.state, self.episodes = "finished", self.total
        except ConfigError as error:  # results.json was not written by a run
            self.state, self.reason = "failed", str(error)


JobProgress = Callable[[Sequence[Job]], None]
"""Told about all jobs a few times a second."""


def worker_program() -> WorkerProgram:
    """The worker without a limit on its memory, that replays no failures."""
    arguments = "-m", "risk_sac.execution.worker", FOLDER, "0", "0", "0"
    return WorkerProgram(arguments=arguments, log=LOG, linger_s=LINGER_S)


class JobStore:
    """The `RunStore` of jobs, each known by its place among them."""

    def __init__(self, jobs: Sequence[Job]) -> None:
        self._jobs = jobs
        self.waiting = deque(number for number, job in enumerate(jobs) if job.state == "waiting")

    def start_next(self, use: SlotUse) -> QueuedRun | None:
        """See `RunStore`."""
        if not self.waiting:
            return None
        number = self.waiting.popleft()
        job = self._jobs[number]
        job.state, job.attempts = "running", job.attempts + 1
        return QueuedRun(number=number, spec=job.spec, folder=job.folder, slots=use.granted(job.spec))

    def not_started(self, run: QueuedRun, error: OSError) -> None:
        """See `RunStore`; a faulty run folder does not affect other runs."""
        job = self._jobs[run.number]
        job.state, job.reason = "failed", str(error)

    def add_episodes(self, events: Sequence[tuple[int, EpisodeDone]]) -> set[int]:
        """See `RunStore`."""
        grown = set()
        for number, event in events:
            job = self._jobs[number]
            if event.record.index >= job.episodes:
                job.episodes = event.record.index + 1
                grown.add(number)
        return grown

    def ended(self, run: QueuedRun, state: RunState, reason: str | None = None, result: Finished | None = None) -> None:
        """See `RunStore`; no job is cancelled by itself."""
        job = self._jobs[run.number]
        if state is RunState.SUCCEEDED:
            job.state, job.episodes = "finished", job.total
        else:
            job.state = "failed"
            job.reason = f"{reason}; {job.episodes} of {job.total} episodes done (see {job.folder / LOG})"

    def requeued(self, run: QueuedRun, reason: str | None) -> None:
        """See `RunStore`."""
        job = self._jobs[run.number]
        if reason is None:
            job.state, job.reason = "stopped", f"stopped after {job.episodes} of {job.total} episodes"
        else:
            job.state = "waiting"
            self.waiting.appendleft(run.number)

    def storage_refused(self, run: QueuedRun, reason: str) -> None:
        """See `RunStore`; the same command goes on once the disk has room."""
        self.ended(run, RunState.FAILED, reason)


def execute(
    jobs: Sequence[Job],
    executor: Executor,
    at_once: int,
    progress: JobProgress,
    stopping: Callable[[], bool],
) -> None:
    """Executes jobs on `at_once` slots until all ended; no worker outlives it."""
    for job in jobs:
        job.look()
    store = JobStore(jobs)
    scheduler = Scheduler(executor, store, ATTEMPTS)
    try:
        while scheduler.active or (store.waiting and not scheduler.stopping):
            if stopping() and not scheduler.stopping:
                scheduler.stop(math.inf)
            if not scheduler.stopping:
                scheduler.fill(at_once)
            scheduler.take_in(scheduler.hear(POLL_S))
            progress(jobs)
    finally:
        scheduler.stop(0)
        deadline = time.monotonic() + GONE_S
        while scheduler.active and time.monotonic() < deadline:
            scheduler.take_in(scheduler.hear(POLL_S))
