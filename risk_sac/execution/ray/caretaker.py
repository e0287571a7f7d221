"""`python -IS caretaker.py [FOLDER]`: ends a group of processes and removes a folder once its starter has gone.

It needs no package. Standard input names the group; its end is the sign to act.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

GONE_S = 10.0


class Caretaker:
    """The starter's end. The process is a grandchild, since Ray kills the children of a process that it ends."""

    def __init__(self, *folder: Path) -> None:
        command = [sys.executable, "-IS", __file__, *map(str, folder)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, bufsize=0)
        self._process.wait()

    def watch(self, group: int) -> None:
        """Names the group of processes that is to end with this one."""
        assert self._process.stdin is not None
        self._process.stdin.write(str(group).encode())

    def act(self) -> None:
        """Ends the group and removes the folder now."""
        assert self._process.stdin is not None
        self._process.stdin.close()


def main() -> None:
    """Waits for the end of its input and acts."""
    if os.fork():
        os._exit(0)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    group = sys.stdin.read()
    if group:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(int(group), signal.SIGKILL)
    until = time.monotonic() + GONE_S  # what was killed may still be writing for a moment
    for folder in sys.argv[1:]:
        while os.path.lexists(folder) and time.monotonic() < until:
            shutil.rmtree(folder, ignore_errors=True)
            time.sleep(0.05)


if __name__ == "__main__":
    main()
