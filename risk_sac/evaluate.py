"""A campaign without a server: each run in a process of its own, then the comparison of methods.

DIR/spec.yaml                            the campaign
DIR/runs/<family>-<method>-<seed>/       a run's folder, see `risk_sac.results`, and what its process printed
DIR/table.{json,md,csv}, DIR/figures/    see `risk_sac.report`
"""

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from risk_sac.config import CampaignSpec, RunSpec
from risk_sac.errors import ConfigError
from risk_sac.problem import Problem
from risk_sac.report import Comparison, FinishedRun, compare, read_run, write_report
from risk_sac.results import EPISODES, RESULTS, read_results
from risk_sac.spec_file import campaign_yaml, read_campaign
from risk_sac.stopping import STOPPING, stop_signal

SPEC, RUNS, LOG, LOCK = "spec.yaml", "runs", "run.log", ".lock"
ATTEMPTS = 2
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
        return self.spec.budget.episodes + self.spec.budget.evaluation_episodes

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What came of a campaign."""

    comparison: Comparison
    failed: tuple[Job, ...]
    stopped: bool  # by a signal


def evaluate(spec: CampaignSpec, folder: Path, command: str, jobs: int, progress: Progress) -> Evaluation:
    """Executes what is not finished yet and writes the report of what is.

    SIGINT, SIGTERM or SIGHUP stop it: the runs save a checkpoint, and the same call goes on with them.

    Args:
      spec: the campaign.
      folder: gets everything; may hold an earlier part of the same campaign.
      command: what the user typed, for the report.
      jobs: processes at a time.
      progress: told how the runs go.

    Raises:
      ConfigError: a family's settings pose no problem that can be run, or the folder holds another campaign or
        is in use.
      OSError: the folder cannot be written.
    """
    if jobs < 1:
        raise ConfigError(f"got {jobs}; wanted at least one process", field="jobs")
    for run in {run.family: run for run in spec.runs()}.values():
        Problem.from_spec(run)  # before the folder is claimed
    hung_up = () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)  # nohup stays nohup
    with _claimed(spec, folder) as lock, stop_signal((*STOPPING, *hung_up)) as stopping:
        queue = [Job(spec=run, folder=folder / RUNS / _name(run)) for run in spec.runs()]
        _Executor(folder / SPEC, queue, lock, progress).execute(jobs, stopping)
        comparison = _report(spec, folder, command, queue)
        return Evaluation(
            comparison=comparison,
            failed=tuple(job for job in queue if job.state == "failed"),
            stopped=any(job.state in ("waiting", "stopped") for job in queue),
        )


def _name(run: RunSpec) -> str:
    return f"{run.family}-{run.method}-{run.seed}"


@contextmanager
def _claimed(spec: CampaignSpec, folder: Path) -> Iterator[int]:
    """Holds the folder for this campaign and its processes; yields the lock they inherit.

    Should this process be killed, the lock stays with its runs: nobody begins them a second time while they live.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ConfigError(
                f"{folder} is in use by another evaluation, or by runs that one left behind; wait for them to end",
                field="out",
            ) from error
        file = folder / SPEC
        if file.exists():
            _check_same(spec, read_campaign(file, {}, {}), folder)
        else:
            temporary = folder / f".{SPEC}.tmp"
            temporary.write_text(campaign_yaml(spec), encoding="utf-8")
            temporary.replace(file)
        yield lock.fileno()


def _check_same(wanted: CampaignSpec, found: CampaignSpec, folder: Path) -> None:
    if found.digest != wanted.digest:
        names = [name for name in CampaignSpec.model_fields if getattr(found, name) != getattr(wanted, name)]
        raise ConfigError(
            f"{folder} holds a comparison with another {', '.join(names)}; wanted an empty folder, or the settings in "
            f"{folder / SPEC} to go on with that one",
            field="out",
        )


class _Executor:
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
    return f"{how} after {job.done()} of {job.total} episodes: {said} (see {RUNS}/{job.name}/{LOG})"


def _report(spec: CampaignSpec, folder: Path, command: str, jobs: Sequence[Job]) -> Comparison:
    runs: list[FinishedRun] = []
    for job in jobs:
        if job.state != "finished":
            continue
        try:
            runs.append(read_run(job.folder))
        except ConfigError as error:
            job.state, job.reason = "failed", str(error)
    reasons = {job.spec.digest: job.reason for job in jobs if job.state != "finished"}
    comparison = compare(spec, runs, command, spec_file=str(folder / SPEC), reasons=reasons)
    write_report(comparison, folder)
    return comparison
