"""Runs as processes of this machine."""

import contextlib
import logging
import math
import os
import queue
import select
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path

import psutil

from risk_sac.config import RunSpec
from risk_sac.execution.executor import FOLDER, WORDS, Cause, Exited, Messages, WorkerProgram, taken
from risk_sac.execution.messages import Event, WorkerLog, reason_of
from risk_sac.host.machine import ROLLOUTS

logger = logging.getLogger(__name__)

# One thread per worker: the workers share the cores, and results must not depend on a thread count.
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
LONGEST_LINE = 1 << 20


class Subprocess:
    """One attempt at a run.

    Attributes:
      log: what it prints.
      listening: whether its words can still be read.
    """

    def __init__(self, program: WorkerProgram, spec: RunSpec, folder: Path, slots: int) -> None:
        """Starts it with at most `slots` processes that play its episodes.

        Raises:
          OSError: its folder or its log cannot be written, or there is no room for one more process.
        """
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / program.log
        arguments = (str(folder) if each == FOLDER else each for each in program.arguments)
        with path.open("ab") as log:
            self.log = WorkerLog(path, log.tell())
            self._words, words = os.pipe()
            try:
                self._process = subprocess.Popen(
                    [sys.executable, *arguments],
                    stdin=subprocess.PIPE,
                    stdout=log,
                    stderr=log,
                    env={**os.environ, **THREADS, **program.environment, ROLLOUTS: str(slots), WORDS: str(words)},
                    pass_fds=(words, *program.descriptors),
                    bufsize=0,
                    start_new_session=True,  # Ctrl-C is for our starter; we ask the worker to stop
                )
            except BaseException:
                os.close(self._words)
                raise
            finally:
                os.close(words)
        assert self._process.stdin is not None
        self._stdin = self._process.stdin
        os.set_blocking(self._stdin.fileno(), False)  # a worker may be stopped before it reads
        self._usage = psutil.Process(self._process.pid)
        self.listening = True
        self._untold = spec.model_dump_json().encode() + b"\n"
        self._unread = b""

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    @property
    def status(self) -> int | None:
        """Returns the exit status, negative for a signal; None while running."""
        return self._process.poll()

    def lines(self, timeout_s: float) -> list[bytes]:
        """Reads lines, or awaits the exit after the last, up to `timeout_s`.

        A line longer than `LONGEST_LINE` comes in pieces, and what its end cuts off is no line.
        """
        if not self.listening:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(timeout_s)
            return []
        poll = select.poll()  # select.select() knows no descriptor beyond 1023
        poll.register(self._words, select.POLLIN)
        if self._untold:
            poll.register(self._stdin, select.POLLOUT)
        ready = {descriptor for descriptor, _ in poll.poll(timeout_s * 1000)}
        if self._untold and self._stdin.fileno() in ready:
            self._tell()
        return self._read() if self._words in ready else []

    def _tell(self) -> None:
        """Hands it some more of its run."""
        try:
            self._untold = self._untold[os.write(self._stdin.fileno(), self._untold) :]
        except BrokenPipeError:
            logger.warning("worker %d ended before it read its run", self.pid)  # its exit status says why
            self._untold = b""

    def _read(self) -> list[bytes]:
        new = os.read(self._words, LONGEST_LINE)  # more than a pipe holds, so all there is
        self.listening = bool(new)
        *lines, self._unread = (self._unread + new).split(b"\n")
        if len(self._unread) >= LONGEST_LINE:
            lines.append(self._unread)
            self._unread = b""
        return [line + b"\n" for line in lines]

    def processor_s(self) -> float | None:
        """Time that its processor was used, s; None if that is unknown."""
        try:
            times = self._usage.cpu_times()
        except psutil.Error:  # it is just ending
            return None
        return float(times.user + times.system)

    def terminate(self) -> None:
        """SIGTERM."""
        self._process.terminate()

    def kill(self) -> None:
        """SIGKILL, which ends a stopped process too, and all that it started."""
        if self.status is None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self.pid, signal.SIGKILL)

    def close(self) -> None:
        """Closes its input and output."""
        self._stdin.close()
        os.close(self._words)


LOOK_S = 0.2  # between two looks at a worker
HELD_UP_S = 1.0  # longer between them, and it was this process that was held up
OUTSIDE = {signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP}  # signals of the kernel or an operator
SHOWN = 80  # characters shown of a line that is none


@dataclass(frozen=True, slots=True)
class Signs:
    """Signs of life of a worker since its start."""

    words: int = 0  # lines it has written
    episodes: int = 0  # of them, those that told of an episode
    processor_s: float | None = None  # time its processor was used, s; None if that is unknown


class Lease:
    """Limit on how long a worker is silent, or busy without result.

    A worker sends heartbeats. One whose interpreter is held up, by a long compilation say, cannot, but it uses its
    processor; one that was stopped does neither. Only time during which this process watched counts.

    Attributes:
      silent_s: time since the last sign of life.
    """

    def __init__(self, lease_s: float, stall_s: float) -> None:
        self._lease_s = lease_s
        self._stall_s = stall_s
        self._signs = Signs()
        self.silent_s = self._stalled_s = 0.0

    def passed(self, watched_s: float, signs: Signs) -> str | None:
        """Adds `watched_s`, the time since the last call, s.

        Returns the reason why the worker is lost, if it is.
        """
        before, self._signs = self._signs, signs
        self.silent_s = 0.0 if signs != before else self.silent_s + watched_s
        self._stalled_s = 0.0 if signs.episodes != before.episodes else self._stalled_s + watched_s
        if self.silent_s >= self._lease_s:
            return f"worker gave no sign of life for {self._lease_s:g} s"
        if self._stalled_s >= self._stall_s:
            return f"worker finished no episode for {self._stall_s:g} s"
        return None


class LocalExecutor:
    """Executor of each attempt in a subprocess, watched by a thread.

    The thread reads the worker's words and notices its end at once. Five times a second it checks whether the worker
    overstays or has fallen silent.
    """

    slots = math.inf  # the caller knows this machine
    cluster = None

    def __init__(self, program: WorkerProgram) -> None:
        self._program = program
        self._messages: Messages = queue.SimpleQueue()
        self._workers: dict[int, _Worker] = {}
        self._lock = threading.Lock()

    def submit(self, number: int, spec: RunSpec, folder: Path, slots: int) -> None:
        """See `Executor.submit`."""
        worker = _Worker(self._program, Subprocess(self._program, spec, folder, slots))
        with self._lock:
            self._workers[number] = worker
        threading.Thread(target=self._follow, args=(number, worker), name=f"run-{number}", daemon=True).start()

    def events(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        """See `Executor.events`."""
        return taken(self._messages, timeout_s)

    def wake(self) -> None:
        """See `Executor.wake`."""
        self._messages.put(None)

    def silent_s(self, number: int) -> float | None:
        """See `Executor.silent_s`."""
        with self._lock:
            worker = self._workers.get(number)
        return None if worker is None else worker.silent_s

    def close(self) -> None:
        """Holds nothing."""

    def cancel(self, number: int, grace_s: float) -> None:
        """SIGTERM now; SIGKILL once the grace time is over."""
        with self._lock:
            worker = self._workers.get(number)
            if worker is not None:
                worker.stop(grace_s)

    def _follow(self, number: int, worker: "_Worker") -> None:
        while (status := worker.process.status) is None:
            self._pass_on(number, worker.words(LOOK_S))
            worker.look(time.monotonic())
        # What it said before it ended is there; its children may hold its output open for ever.
        self._pass_on(number, worker.words(0))
        worker.process.close()
        with self._lock:
            del self._workers[number]
        self._messages.put((number, worker.exited(status)))

    def _pass_on(self, number: int, words: list[Event]) -> None:
        for word in words:
            self._messages.put((number, word))


class _Worker:
    """Attempt and its lease; one thread calls all but `stop` and `kill`."""

    def __init__(self, program: WorkerProgram, process: Subprocess) -> None:
        self.process = process
        self._program = program
        self._lease = Lease(program.lease_s, program.stall_s)
        self._lines = self._episodes = 0  # heard so far
        self._last = self._told_to_stop = False
        self._stop_by = self._leave_by = math.inf  # monotonic times: after the order to stop; after its silence
        self._given_up: Exited | None = None
        self._looked_at = time.monotonic()

    @property
    def silent_s(self) -> float:
        """Time since its last sign of life."""
        return self._lease.silent_s

    def stop(self, grace_s: float) -> None:
        """SIGTERM the first time; SIGKILL once the shortest grace time is over."""
        self._stop_by = min(self._stop_by, time.monotonic() + grace_s)
        if not self._told_to_stop:
            self._told_to_stop = True
            self.process.terminate()

    def words(self, timeout_s: float) -> list[Event]:
        """Reads messages up to the last, waiting up to `timeout_s` for one."""
        words = []
        for line in self.process.lines(timeout_s):
            try:
                heard = self._program.hear(line)
            except ValueError as error:
                logger.warning("process %d said nothing known: %s", self.process.pid, error)
                self._give_up(f"worker wrote {line[:SHOWN]!r} where an event was wanted", Cause.CRASHED)
                break
            self._lines += 1
            self._episodes += heard.progress
            if heard.word is not None:
                words.append(heard.word)
            if heard.last:
                self._last = True
                self.process.listening = False
                break
        if not self.process.listening and self._leave_by == math.inf:
            self._leave_by = time.monotonic() + self._program.linger_s
        return words

    def look(self, now: float) -> None:
        """Kills it if it overstays or has fallen silent."""
        if now >= min(self._stop_by, self._leave_by):
            self.process.kill()
        elif now >= self._looked_at + LOOK_S and self._leave_by == math.inf and self._given_up is None:
            watched_s = min(now - self._looked_at, HELD_UP_S)
            self._looked_at = now
            lost = self._lease.passed(watched_s, Signs(self._lines, self._episodes, self.process.processor_s()))
            if lost is not None:
                logger.warning("process %d: %s", self.process.pid, lost)
                self._give_up(lost, Cause.STOPPED)

    def _give_up(self, reason: str, cause: Cause) -> None:
        self._given_up = Exited(reason, cause)
        self.process.listening = False
        self.process.kill()

    def exited(self, status: int) -> Exited:
        """Describes its end."""
        reason = reason_of(status, self.process.log)
        if self._last or self._told_to_stop:
            return Exited(reason, Cause.ENDED, status)
        if self._given_up is not None:
            return replace(self._given_up, status=status)
        cause = Cause.KILLED if -status in OUTSIDE else Cause.CRASHED
        return Exited(reason or "worker left without a word", cause, status)
