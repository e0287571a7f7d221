"""Describes the end of a worker from its exit status and its log."""

import os
import re
import signal
from dataclasses import dataclass
from pathlib import Path

TAIL_BYTES = 2000  # of a log, at most
TAIL_LINES = 5

# Of an absolute path; URLs stay. No path is deeper, and without a bound a log made for it takes minutes.
_FOLDERS = re.compile(r"""(?<![\w./:])/(?:[^\s/'"|]+/){0,30}(?=[\w.])""")
_SIGNAL_NAMES = {item.value: item.name for item in signal.Signals}  # real-time signals have none


@dataclass(frozen=True, slots=True)
class WorkerLog:
    """The part of a run's log that one worker wrote."""

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
        said = " | ".join(line.strip() for line in lines[-TAIL_LINES:] if line.strip())
        return without_folders(said, self.path.parent) or "it left no message"


def reason_of(status: int, log: WorkerLog) -> str | None:
    """Describes an exit status, negative for a signal; None for 0."""
    if status < 0:
        return f"worker was killed by {_SIGNAL_NAMES.get(-status, f'signal {-status}')}"
    if status > 0:
        return f"worker exited with status {status}: {log.tail()}"
    return None


def without_folders(text: str, own: Path | None = None) -> str:
    """Removes the folders from all paths in a text, so that any user may read it.

    Args:
      text: as it was meant for the log.
      own: the folder that it is about, which may be a relative path.
    """
    if own is not None:
        text = text.replace(f"{own}/", "").replace(str(own), own.name)
    return _FOLDERS.sub("", text)
