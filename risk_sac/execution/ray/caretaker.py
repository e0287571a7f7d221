"""`python -IS caretaker.py`: ends what a process of Ray was looking after, should that be killed. Needs no package.

One line on its standard input for each attempt that begins, `+PID FOLDER`, and that is over, `-PID FOLDER`. At the
end of its input it kills what has not been taken back, and removes its folder.
"""

import contextlib
import os
import shutil
import signal
import sys
import time

GONE_S = 5.0


def main() -> None:
    """Reads until nobody writes any more."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    left: dict[str, int] = {}
    for line in sys.stdin:
        pid, _, folder = line[1:].rstrip("\n").partition(" ")
        if line.startswith("+"):
            left[folder] = int(pid)
        else:
            left.pop(folder, None)
    for pid in left.values():
        kill(pid)
    for folder in left:
        remove(folder)


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
