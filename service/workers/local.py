"""Runs as processes of this machine."""

import contextlib
import logging
import math
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import psutil
from pydantic import ValidationError

from risk_sac.config import RunSpec
from service.settings import ServiceSettings
from service.workers.executor import Cause, Exited
from service.workers.lease import Lease, Signs
from service.workers.messages import EpisodeDone, Event, Failed, Finished, Heartbeat, decode
from service.workers.postmortem import WorkerLog, exited

logger = logging.getLogger(__name__)

# One thread per worker: the workers share the cores, and results must not depend on a thread count.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
LONGEST_LINE = 1 << 20
LOOK_S = 0.2  # between two looks at the workers
HELD_UP_S = 1.0  # longer between them, and it was this process that was held up


@dataclass(slots=True)
class _Worker:
    process: subprocess.Popen[bytes]
    usage: psutil.Process
    log: WorkerLog
    lease: Lease
    words: int = 0  # heard so far
    episodes: int = 0  # heard of so far
    last: Finished | Failed | None = None
    kill_at: float = math.inf  # monotonic time, once it was told to stop
    given_up: Exited | None = None

    @property
    def told_to_stop(self) -> bool:
        return self.kill_at < math.inf

    def kill(self) -> None:
        """SIGKILL, which ends a stopped process too, and all that it started."""
        if self.process.poll() is None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.process.pid, signal.SIGKILL)


class LocalExecutor:
    """One subprocess per run: spec on its stdin, events on its stdout, all else in its log.

    Its stdin stays open as long as the server lives; a worker that sees it end knows that nobody listens any more.
    One thread per worker listens to it, so that one that dies is noticed at once; one thread watches them all, for
    those that do not die but fall silent.
    """

    def __init__(self, settings: ServiceSettings) -> None:
        self._settings = settings
        self._messages: queue.SimpleQueue[tuple[int, Event | Exited] | None] = queue.SimpleQueue()
        self._workers: dict[int, _Worker] = {}
        self._watched = False
        self._lock = threading.Lock()

    def submit(self, number: int, spec: RunSpec, folder: Path) -> None:
        """See `Executor.submit`."""
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / "worker.log"
        module, niceness = self._settings.worker_module, str(self._settings.worker_niceness)
        with path.open("ab") as stderr:
            log = WorkerLog(path, stderr.tell())
            process = subprocess.Popen(
                [sys.executable, "-m", module, str(folder), niceness],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=stderr,
                env=os.environ | THREADS,
                start_new_session=True,  # Ctrl-C in the server's terminal is the server's to handle
            )
        lease = Lease(self._settings.lease_s, self._settings.stall_s)
        worker = _Worker(process, psutil.Process(process.pid), log, lease)
        with self._lock:
            self._workers[number] = worker
            if not self._watched:
                self._watched = True
                threading.Thread(target=self._watch, name="watch", daemon=True).start()
        threading.Thread(target=self._follow, args=(number, worker, spec), name=f"run-{number}", daemon=True).start()

    def events(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        """See `Executor.events`."""
        messages = []
        try:
            messages.append(self._messages.get(timeout=timeout_s))
            while True:
                messages.append(self._messages.get_nowait())
        except queue.Empty:
            return [message for message in messages if message is not None]

    def wake(self) -> None:
        """See `Executor.wake`."""
        self._messages.put(None)

    def cancel(self, number: int, grace_s: float) -> None:
        """SIGTERM now; SIGKILL once the grace time is over."""
        with self._lock:
            worker = self._workers.get(number)
            if worker is None:
                return
            first = not worker.told_to_stop
            worker.kill_at = min(worker.kill_at, time.monotonic() + grace_s)
        if first:
            worker.process.terminate()

    def _follow(self, number: int, worker: _Worker, spec: RunSpec) -> None:
        _send(worker.process, spec)
        self._relay(number, worker)
        status = self._wait(worker)
        with self._lock:
            del self._workers[number]
        _close(worker.process)
        message = exited(
            status, worker.log, last=worker.last, given_up=worker.given_up, told_to_stop=worker.told_to_stop
        )
        self._messages.put((number, message))

    def _relay(self, number: int, worker: _Worker) -> None:
        """Pass events on until the last one."""
        assert worker.process.stdout is not None
        while worker.last is None and (line := worker.process.stdout.readline(LONGEST_LINE)):
            try:
                word = decode(line)
            except ValidationError as error:
                logger.warning("run %d wrote no event: %s", number, error)
                _give_up(worker, f"worker wrote {line[:80]!r} where an event was wanted", Cause.CRASHED)
                return
            worker.words += 1
            if isinstance(word, Heartbeat):
                continue
            worker.episodes += isinstance(word, EpisodeDone)
            self._messages.put((number, word))
            if isinstance(word, Finished | Failed):
                worker.last = word

    def _wait(self, worker: _Worker) -> int:
        """Exit status; a worker that has nothing more to say may not linger."""
        try:
            return worker.process.wait(self._settings.grace_s)
        except subprocess.TimeoutExpired:
            worker.kill()
            return worker.process.wait()

    def _watch(self) -> None:
        """Kill workers that overstay or fall silent, until there are none."""
        looked_at = time.monotonic()
        while True:
            time.sleep(LOOK_S)
            with self._lock:
                workers = list(self._workers.values())
                if not workers:
                    self._watched = False
                    return
            now = time.monotonic()
            for worker in workers:
                _look(worker, now, min(now - looked_at, HELD_UP_S))
            looked_at = now


def _look(worker: _Worker, now: float, watched_s: float) -> None:
    if now >= worker.kill_at:
        worker.kill()
        return
    lost = worker.lease.passed(watched_s, Signs(worker.words, worker.episodes, _processor_s(worker.usage)))
    if lost is not None and worker.given_up is None:
        logger.warning("process %d: %s", worker.process.pid, lost)
        _give_up(worker, lost, Cause.STOPPED)


def _give_up(worker: _Worker, reason: str, cause: Cause) -> None:
    worker.given_up = Exited(reason, cause)
    worker.kill()


def _processor_s(process: psutil.Process) -> float | None:
    try:
        times = process.cpu_times()
    except psutil.Error:  # it is just ending
        return None
    return float(times.user + times.system)


def _send(process: subprocess.Popen[bytes], spec: RunSpec) -> None:
    assert process.stdin is not None
    try:
        process.stdin.write(spec.model_dump_json().encode() + b"\n")
        process.stdin.flush()
    except BrokenPipeError:
        logger.warning("worker %d ended before it read its run", process.pid)  # its exit status says why


def _close(process: subprocess.Popen[bytes]) -> None:
    for stream in (process.stdin, process.stdout):
        assert stream is not None
        try:
            stream.close()
        except BrokenPipeError:
            logger.debug("worker %d left its input unread", process.pid)
