"""Runs in processes of their own, so many at a time: one that crashes takes no other down."""

import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.run_folder.crashes import PATIENCE
from risk_sac.run_folder.results import EPISODES, RESULTS, read_results

LOG = "run.log"  # in a run's folder: what its process printed
ATTEMPTS = PATIENCE + 1  # the last one without the episode that crashed the others
MISUSED = 2  # the exit status of a run that can never succeed
POLL_S = 0.1

State = Literal["waiting", "running", "finished", "failed", "stopped"]


@dataclass(kw_only=True)
class Job:
    """A run on its way."""

    spec: RunSpec
    folder: Path
    state: State = "waiting"
    attempts: int = 0
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


class Executor:
    """Keeps some processes at work until every run has finished or failed."""

    def __init__(self, spec_file: Path, jobs: Sequence[Job], lock: int, progress: Progress) -> None:
        self._spec_file = spec_file
        self._jobs = jobs
        self._lock = lock
        self._progress = progress
        self._running: list[tuple[Job, subprocess.Popen[bytes]]] = []

    def execute(self, processes: int, stopping: Callable[[], bool]) -> None:
        """Returns once nothing runs any more; no process outlives it."""
        waiting = deque(job for job in self._jobs if not self._settled(job))
        told_to_stop = False
        try:
            while self._running or (waiting and not stopping()):
                while waiting and len(self._running) < processes and not stopping():
                    self._begin(waiting.popleft())
                if stopping() and not told_to_stop:
                    told_to_stop = True
                    for _, process in self._running:
                        process.terminate()
                waiting.extendleft(self._ended(stopping()))
                self._progress(self._jobs)
                time.sleep(POLL_S)
        finally:
            for _, process in self._running:
                process.kill()
                process.wait()

    def _settled(self, job: Job) -> bool:
        """Whether there is nothing to do for a job, or nothing that could be done."""
        try:
            if job.finished:
                job.state = "finished"
        except ConfigError as error:
            job.state, job.reason = "failed", str(error)
        return job.state != "waiting"

    def _begin(self, job: Job) -> None:
        try:
            self._start(job)
        except OSError as error:  # of this run's folder; the others may have better luck
            job.state, job.reason = "failed", str(error)

    def _start(self, job: Job) -> None:
        job.folder.mkdir(parents=True, exist_ok=True)
        picked = ["--family", job.spec.family, "--method", job.spec.method, "--seed", str(job.spec.seed)]
        command = [sys.executable, "-m", "risk_sac", "run", "--spec", str(self._spec_file), *picked]
        with (job.folder / LOG).open("ab") as log:
            process = subprocess.Popen(
                [*command, "--out", str(job.folder)],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=os.environ | {"OMP_NUM_THREADS": "1"},  # runs are what is parallel
                pass_fds=(self._lock,),
                start_new_session=True,  # Ctrl-C is for us; the runs hear of it once, from us
            )
        job.state, job.attempts = "running", job.attempts + 1
        self._running.append((job, process))

    def _ended(self, stopping: bool) -> list[Job]:
        """Settles the jobs whose process has ended; those worth another attempt."""
        again = []
        for job, process in list(self._running):
            status = process.poll()
            if status is None:
                continue
            self._running.remove((job, process))
            if self._settled_after(job, status):
                continue
            if stopping:
                job.state, job.reason = "stopped", f"stopped after {job.done()} of {job.total} episodes"
            elif status == MISUSED or job.attempts == ATTEMPTS:
                job.state, job.reason = "failed", _why(job, status)
            else:
                job.state = "waiting"
                again.append(job)
        return again

    def _settled_after(self, job: Job, status: int) -> bool:
        job.state = "waiting"
        return status == 0 and self._settled(job)


def _why(job: Job, status: int) -> str:
    """The last thing that a failed process said."""
    lines = (job.folder / LOG).read_text(encoding="utf-8", errors="replace").splitlines()
    said = next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")
    how = f"killed by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
    return f"{how} after {job.done()} of {job.total} episodes: {said} (see {job.folder / LOG})"
