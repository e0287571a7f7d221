"""Why a worker is gone, told from its exit status, its last word and its log."""

import os
import signal
from dataclasses import dataclass
from pathlib import Path

from service.workers.executor import Cause, Exited
from service.workers.messages import Failed, Finished

TAIL_BYTES = 2000  # of a log, at most
TAIL_LINES = 5

_SIGNAL_NAMES = {item.value: item.name for item in signal.Signals}  # real-time signals have none
_OUTSIDE = {signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP}


@dataclass(frozen=True, slots=True)
class WorkerLog:
    """What one worker printed; its run's earlier workers wrote to the same file."""

    path: Path
    start: int  # byte at which it begins

    def tail(self) -> str:
        """Its last lines, in one."""
        try:
            with self.path.open("rb") as stream:
                size = stream.seek(0, os.SEEK_END)
                stream.seek(max(self.start, size - TAIL_BYTES))
                lines = stream.read().decode(errors="replace").splitlines()
        except OSError as error:
            return f"its log cannot be read ({error.strerror})"
        return " | ".join(line.strip() for line in lines[-TAIL_LINES:] if line.strip()) or "it left no message"


def exited(
    status: int, log: WorkerLog, *, last: Finished | Failed | None, given_up: Exited | None, told_to_stop: bool
) -> Exited:
    """What became of a worker.

    Args:
      status: of its process, negative for a signal.
      log: what it printed.
      last: its last word, if it had one.
      given_up: what its executor killed it for, if it did.
      told_to_stop: whether its executor asked it to stop.
    """
    reason = _reason(status, log)
    if told_to_stop or isinstance(last, Failed) or (last is not None and last.finished):
        return Exited(reason, Cause.ENDED)
    if last is not None:
        return Exited("worker was told to stop by somebody else", Cause.KILLED)
    if given_up is not None:
        return given_up
    return Exited(reason or "worker left without a word", Cause.KILLED if -status in _OUTSIDE else Cause.CRASHED)


def _reason(status: int, log: WorkerLog) -> str | None:
    if status < 0:
        return f"worker was killed by {_SIGNAL_NAMES.get(-status, f'signal {-status}')}"
    if status > 0:
        return f"worker exited with status {status}: {log.tail()}"
    return None
