"""Where runs execute. `LocalExecutor` uses processes of this machine; others keep the same protocol."""

import logging
import os
import queue
import signal
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Protocol

from pydantic import ValidationError

from risk_sac.config import RunSpec
from service.events import Event, Failed, Finished, decode

logger = logging.getLogger(__name__)

# One thread per worker: the workers share the cores, and results must not depend on a thread count.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
LONGEST_LINE = 1 << 20
TAIL_BYTES = 2000
TAIL_LINES = 5

_SIGNAL_NAMES = {item.value: item.name for item in signal.Signals}  # real-time signals have none


@dataclass(frozen=True, slots=True)
class Exited:
    """The last word about a run: its worker is gone. `reason` says why, unless it ended in order."""

    reason: str | None


class Executor(Protocol):
    """Executes runs elsewhere and tells what becomes of them."""

    def submit(self, number: int, spec: RunSpec, folder: Path) -> None:
        """Start a run; its files go to `folder`.

        Raises:
          OSError: it cannot be started.
        """

    def events(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        """What happened since the last call, waiting up to `timeout_s` for something.

        The last message of every submitted run is `Exited`.
        """

    def cancel(self, number: int) -> None:
        """Ask a run to stop, and make it stop if it does not; unknown runs are ignored."""

    def wake(self) -> None:
        """Let a waiting `events` return early."""


@dataclass(slots=True)
class _Worker:
    process: subprocess.Popen[bytes]
    log: Path
    timer: threading.Timer | None = field(default=None)


class LocalExecutor:
    """One subprocess per run: spec on its stdin, events on its stdout, all else in its log.

    Its stdin stays open as long as the server lives; a worker that sees it end knows that nobody
    listens any more.
    """

    def __init__(self, module: str, grace_s: float) -> None:
        self._module = module
        self._grace_s = grace_s
        self._messages: queue.SimpleQueue[tuple[int, Event | Exited] | None] = queue.SimpleQueue()
        self._workers: dict[int, _Worker] = {}
        self._lock = threading.Lock()

    def submit(self, number: int, spec: RunSpec, folder: Path) -> None:
        """See `Executor.submit`."""
        folder.mkdir(parents=True, exist_ok=True)
        log = folder / "worker.log"
        with log.open("ab") as stderr:
            process = subprocess.Popen(
                [sys.executable, "-m", self._module, str(folder)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=stderr,
                env=os.environ | THREADS,
                start_new_session=True,  # Ctrl-C in the server's terminal is the server's to handle
            )
        worker = _Worker(process, log)
        with self._lock:
            self._workers[number] = worker
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

    def cancel(self, number: int) -> None:
        """SIGTERM now; SIGKILL once the grace time is over."""
        with self._lock:
            worker = self._workers.get(number)
            if worker is None or worker.timer is not None:
                return
            worker.timer = threading.Timer(self._grace_s, worker.process.kill)
            worker.timer.daemon = True
            worker.timer.start()
        worker.process.terminate()

    def _follow(self, number: int, worker: _Worker, spec: RunSpec) -> None:
        _send(worker.process, spec)
        problem = self._relay(number, worker.process)
        if problem is not None:
            worker.process.kill()
        status = self._wait(worker.process)
        reason = problem or _exit_reason(status, worker.log)
        with self._lock:
            del self._workers[number]
            if worker.timer is not None:
                worker.timer.cancel()
        _close(worker.process)
        self._messages.put((number, Exited(reason)))

    def _relay(self, number: int, process: subprocess.Popen[bytes]) -> str | None:
        """Pass events on until the last one; returns what is wrong with them, if anything."""
        assert process.stdout is not None
        while line := process.stdout.readline(LONGEST_LINE):
            try:
                event = decode(line)
            except ValidationError as error:
                logger.warning("run %d wrote no event: %s", number, error)
                return f"worker wrote {line[:80]!r} where an event was wanted"
            self._messages.put((number, event))
            if isinstance(event, Finished | Failed):
                return None
        return None

    def _wait(self, process: subprocess.Popen[bytes]) -> int:
        """Exit status; a worker that has nothing more to say may not linger."""
        try:
            return process.wait(self._grace_s)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()


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


def _exit_reason(status: int, log: Path) -> str | None:
    if status < 0:
        return f"worker was killed by {_SIGNAL_NAMES.get(-status, f'signal {-status}')}"
    if status > 0:
        return f"worker exited with status {status}: {_tail(log)}"
    return None


def _tail(log: Path) -> str:
    try:
        with log.open("rb") as stream:
            _seek_back(stream)
            lines = stream.read().decode(errors="replace").splitlines()
    except OSError as error:
        return f"its log cannot be read ({error.strerror})"
    return " | ".join(line.strip() for line in lines[-TAIL_LINES:] if line.strip()) or "it left no message"


def _seek_back(stream: IO[bytes]) -> None:
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(0, size - TAIL_BYTES))
