"""A worker as a subprocess of this one: started, listened to, stopped."""

import contextlib
import logging
import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import psutil

from risk_sac.config import RunSpec
from risk_sac.execution.executor import FOLDER, WORDS, WorkerProgram
from risk_sac.execution.messages import WorkerLog

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

    def __init__(self, program: WorkerProgram, spec: RunSpec, folder: Path) -> None:
        """Starts it.

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
                    env={**os.environ, **THREADS, **program.environment, WORDS: str(words)},
                    pass_fds=(words,),
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
        """Of its exit, negative for a signal; None as long as it is there."""
        return self._process.poll()

    def lines(self, timeout_s: float) -> list[bytes]:
        """Reads lines, waiting up to `timeout_s` for one, or for its end if it says no more.

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
