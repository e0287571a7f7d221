"""The runs of a campaign, so many at a time: one that crashes is tried again and takes no other down."""

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Never

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Cause, Executor, Exited, Program
from risk_sac.execution.postmortem import signal_name
from risk_sac.run_folder.crashes import PATIENCE
from risk_sac.run_folder.results import EPISODES, RESULTS, read_results

LOG = "run.log"  # in a run's folder: what its process printed
ATTEMPTS = PATIENCE + 1  # the last one without the episode that crashed the others
MISUSED = 2  # the exit status of a run that can never succeed
POLL_S = 0.1
GONE_S = 5.0  # until a killed process is gone, or the signal that killed us has cost us the news of it

State = Literal["waiting", "running", "finished", "failed", "stopped"]


@dataclass(kw_only=True)
class Job:
    """A run on its way."""

    spec: RunSpec
    folder: Path
    state: State = "waiting"
    attempts: int = 0
    lost: int = 0  # of them, with the cluster that they ran on
    reason: str = "not started"  # why it is not finished
    _read: int = field(default=0, repr=False)  # bytes of its episodes counted so far
    _episodes: int = field(default=0, repr=False)

    @property
    def name(self) -> str:
        """Unique within the campaign."""
        return self.folder.name

    @property
    def total(self) -> int:
        """Episodes of both phases."""
        return self.spec.budget.total_episodes

    @property
    def finished(self) -> bool:
        """Whether its folder holds the finished run.

        Raises:
          ConfigError: results.json was not written by a run.
        """
        if not (self.folder / RESULTS).exists():
            return False
        results = read_results(self.folder)
        return results.finished and results.spec_digest == self.spec.digest

    def done(self) -> int:
        """Episodes in its folder; only what was added since the last call is read."""
        file = self.folder / EPISODES
        size = file.stat().st_size if file.exists() else 0
        if size < self._read:  # a resumed run writes them anew
            self._read = self._episodes = 0
        if size > self._read:
            with file.open("rb") as stream:
                stream.seek(self._read)
                new = stream.read(size - self._read)
            self._read, self._episodes = size, self._episodes + new.count(b"\n")
        return self._episodes


Progress = Callable[[Sequence[Job]], None]
"""Told about all jobs a few times a second."""


def program(spec_file: Path, lock: int) -> Program[Never]:
    """A run as its user would start it: it speaks through its folder and its exit status alone.

    Args:
      spec_file: the campaign.
      lock: on the campaign's folder; held as long as one of its runs is there.
    """

    def arguments(spec: RunSpec, folder: Path) -> Sequence[str]:
        picked = ["--family", spec.family, "--method", spec.method, "--seed", str(spec.seed)]
        return ["-m", "risk_sac", "run", "--spec", str(spec_file), *picked, "--out", str(folder)]

    return Program(
        arguments=arguments, log=LOG, hear=None, inherited=(lock,), inputs=(spec_file,), within=spec_file.parent
    )


class Queue:
    """Keeps so many runs at work until every one of them has finished or failed."""

    def __init__(self, jobs: Sequence[Job], executor: Executor[Never], progress: Progress) -> None:
        self._jobs = jobs
        self._executor = executor
        self._progress = progress
        self._running: dict[int, Job] = {}  # by its place among the jobs

    def execute(self, processes: int, stopping: Callable[[], bool]) -> None:
        """Returns once nothing runs any more; no process outlives it."""
        waiting = deque(number for number, job in enumerate(self._jobs) if not self._settled(job))
        told_to_stop = False
        try:
            while self._running or (waiting and not stopping()):
                while waiting and len(self._running) < min(processes, self._executor.slots) and not stopping():
                    self._begin(waiting.popleft())
                if stopping() and not told_to_stop:
                    told_to_stop = True
                    self._cancel(math.inf)
                waiting.extendleft(self._ended(stopping()))
                self._progress(self._jobs)
        finally:
            self._cancel(0)
            deadline = time.monotonic() + GONE_S
            while self._running and time.monotonic() < deadline:
                self._ended(True)

    def _cancel(self, grace_s: float) -> None:
        for number in self._running:
            self._executor.cancel(number, grace_s)

    def _settled(self, job: Job) -> bool:
        """Whether there is nothing to do for a job, or nothing that could be done."""
        try:
            if job.finished:
                job.state = "finished"
        except ConfigError as error:
            job.state, job.reason = "failed", str(error)
        return job.state != "waiting"

    def _begin(self, number: int) -> None:
        job = self._jobs[number]
        try:
            self._executor.submit(number, job.attempts + 1, job.spec, job.folder)
        except OSError as error:  # of this run's folder; the others may have better luck
            job.state, job.reason = "failed", str(error)
            return
        job.state, job.attempts = "running", job.attempts + 1
        self._running[number] = job

    def _ended(self, stopping: bool) -> list[int]:
        """Settles the jobs whose worker has gone, waiting a moment for one; those worth another attempt."""
        again = []
        for number, exited in self._executor.events(POLL_S):
            job = self._running.pop(number)
            if self._settled_after(job, exited):
                continue
            job.lost += exited.cause is Cause.LOST
            if stopping:
                job.state, job.reason = "stopped", f"stopped after {job.done()} of {job.total} episodes"
            elif exited.status == MISUSED or job.attempts - job.lost == ATTEMPTS:
                job.state, job.reason = "failed", _why(job, exited)
            else:
                job.state = "waiting"
                again.append(number)
        return again

    def _settled_after(self, job: Job, exited: Exited) -> bool:
        job.state = "waiting"
        return exited.status == 0 and self._settled(job)


def _why(job: Job, exited: Exited) -> str:
    """The last thing that a failed process said."""
    lines = (job.folder / LOG).read_text(encoding="utf-8", errors="replace").splitlines()
    said = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
    return f"{_how(exited)} after {job.done()} of {job.total} episodes: {said} (see {job.folder / LOG})"


def _how(exited: Exited) -> str:
    if exited.status is None:
        return exited.reason or "ended"
    if exited.status < 0:
        return f"killed by {signal_name(-exited.status)}"
    return f"ended with status {exited.status}"
