"""`python -IS caretaker.py`: ends what another process was looking after, should that be killed. Needs no package.

One line on its standard input for each group of processes that begins, `+PID FOLDER`, where the folder may be left
out, and that is over, `-PID`. At the end of its input it kills what has not been taken back, and removes its folder.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

GONE_S = 5.0


def main() -> None:
    """Reads until nobody writes any more."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    left: dict[int, str] = {}
    for line in sys.stdin:
        pid, _, folder = line[1:].rstrip("\n").partition(" ")
        if line.startswith("+"):
            left[int(pid)] = folder
        else:
            left.pop(int(pid), None)
    for group in left:
        kill(group)
    for folder in filter(None, left.values()):
        remove(folder)


class Caretaker:
    """The other end: a process that ends what this one has started, should this one be killed."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-IS", __file__],
            stdin=subprocess.PIPE,
            start_new_session=True,
            bufsize=0,
        )

    def begin(self, group: int, folder: Path | None = None) -> None:
        """From here on it would end that group of processes, and remove the folder."""
        self._say(f"+{group} {folder or ''}\n")

    def over(self, group: int) -> None:
        """There is nothing left to end."""
        self._say(f"-{group}\n")

    def _say(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(text.encode())


def kill(group: int) -> None:
    """Kills a process and all that it started."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def remove(folder: str) -> None:
    """Removes a folder; what was killed may still be writing to it for a moment."""
    until = time.monotonic() + GONE_S
    while os.path.lexists(folder) and time.monotonic() < until:
        shutil.rmtree(folder, ignore_errors=True)
        if os.path.lexists(folder):
            time.sleep(0.05)


if __name__ == "__main__":
    main()
