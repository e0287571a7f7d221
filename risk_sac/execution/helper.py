"""Helper processes: one question, one answer, bounded in time and memory.

`run_helper` starts `python -m risk_sac.execution.helper`, which runs the wanted program in a session of its own and
kills that session once its starter has gone. Question and answer are files, so a program may print what it likes. A
process that a signal ended is started again, as a worker is.
"""

import contextlib
import logging
import os
import resource
import runpy
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil

from risk_sac.execution.messages import without_folders
from risk_sac.host.process_state import leave
from risk_sac.run_folder.durable import scratch_folder

logger = logging.getLogger(__name__)

QUESTION, ANSWER = "{question}", "{answer}"  # arguments that stand for the paths of these files
ANSWER_BYTES = 256 << 20  # read of an answer, at most
LOG_BYTES = 2000  # read of the end of a log, at most
POLL_S = 0.05
ATTEMPTS = 3
STOPPED_S = 5.0  # after which a process that was stopped is as good as lost


@dataclass(frozen=True, slots=True)
class HelperResult:
    """Outcome of a helper process.

    Attributes:
      status: exit status; negative for a signal.
      answer: content of the answer file; empty if there is none.
      log: end of what the process printed.
      timed_out: whether it was killed at its time limit.
    """

    status: int
    answer: bytes
    log: str
    timed_out: bool = False

    @property
    def reason(self) -> str:
        """Why the process failed, as any user may read it."""
        if self.status < 0:
            return f"its process was ended by {signal.Signals(-self.status).name}, {ATTEMPTS} times in a row"
        return without_folders(self.log[-500:]) or f"its process ended with status {self.status}"


def run_helper(
    program: str,
    arguments: Sequence[str],
    *,
    wall_s: float,
    question: bytes = b"",
    memory_bytes: int = 0,
    niceness: int = 0,
    isolated: bool = False,
    cwd: Path | None = None,
    environment: Mapping[str, str] | None = None,
    log: Path | None = None,
    stopping: Callable[[], bool] = lambda: False,
) -> HelperResult:
    """Runs a Python program in its own process and waits for it.

    Args:
      program: name of a module, or path of a `.py` file.
      arguments: for it; `QUESTION` and `ANSWER` become the paths of these files.
      wall_s: the process and all that it started are killed after this time, s; all attempts share it.
      question: content of the question file.
      memory_bytes: address space that the process may use; 0 sets no limit.
      niceness: added to that of this process.
      isolated: neither the working directory nor environment variables decide what is imported.
      cwd: working directory.
      environment: all variables; by default those of this process.
      log: file for what the process prints; by default a temporary one.
      stopping: asked again and again; once true, the process is killed.

    Raises:
      OSError: the process cannot be started.
    """
    deadline = time.monotonic() + wall_s
    with scratch_folder() as scratch:
        paths = {QUESTION: str(Path(scratch, "question")), ANSWER: str(Path(scratch, "answer"))}
        Path(paths[QUESTION]).write_bytes(question)
        log = log or Path(scratch, "log")
        command = [sys.executable, *(["-I"] if isolated else []), "-m", "risk_sac.execution.helper"]
        command += [str(niceness), str(memory_bytes), program, *(paths.get(each, each) for each in arguments)]
        for _ in range(ATTEMPTS):
            Path(paths[ANSWER]).unlink(missing_ok=True)
            with log.open("wb") as output:
                process = subprocess.Popen(
                    command,
                    cwd=cwd,
                    env=environment,
                    stdin=subprocess.PIPE,  # its end tells the process that this one has gone
                    stdout=output,
                    stderr=output,
                    start_new_session=True,
                )
            with process:
                timed_out = _waited(process, deadline, stopping)
            if process.returncode >= 0 or timed_out or stopping():
                break
            logger.warning("the process of %s was ended by signal %d", program, -process.returncode)
        return HelperResult(process.returncode, _head(Path(paths[ANSWER])), _tail(log), timed_out)


def _waited(process: subprocess.Popen[bytes], deadline: float, stopping: Callable[[], bool]) -> bool:
    """Waits for a process, kills its session; returns whether it timed out."""
    stopped_s = 0.0
    try:
        while not stopping():
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                return True
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(min(left_s, POLL_S))
                return False
            stopped = psutil.Process(process.pid).status() == psutil.STATUS_STOPPED
            stopped_s = stopped_s + POLL_S if stopped else 0.0
            if stopped_s >= STOPPED_S:
                return False
        return False
    finally:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)


def _head(file: Path) -> bytes:
    if not file.exists():
        return b""
    with file.open("rb") as stream:
        return stream.read(ANSWER_BYTES)


def _tail(file: Path) -> str:
    with file.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - LOG_BYTES))
        return stream.read().decode("utf-8", "backslashreplace").strip()


def _main(niceness: str, memory_bytes: str, program: str, *arguments: str) -> None:
    os.nice(int(niceness))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if int(memory_bytes):
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        most = int(memory_bytes) if hard == resource.RLIM_INFINITY else min(int(memory_bytes), hard)
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    threading.Thread(target=_leave_with_starter, daemon=True).start()
    sys.argv[1:] = arguments  # `runpy` replaces the first
    status = 0
    try:
        if program.endswith(".py"):
            runpy.run_path(program, run_name="__main__")
        else:
            runpy.run_module(program, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
        if isinstance(end.code, str):
            sys.stderr.write(f"{end.code}\n")  # as Python does
    leave(status)


def _leave_with_starter() -> None:
    while os.read(0, 4096):
        pass
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    _main(*sys.argv[1:])
