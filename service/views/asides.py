"""A process beside the server for one answer: at the workers' niceness, and gone with the server."""

import contextlib
import os
import subprocess
import sys
from collections.abc import Sequence
from typing import IO

from service.settings import ServiceSettings

WALL_S = 300.0  # a minimisation takes ten on a machine with nothing else to do, a table of 100,000 episodes as long


class Aside:
    """Runs one Python module at a time."""

    def __init__(self, settings: ServiceSettings) -> None:
        self._niceness = settings.worker_niceness
        self._process: subprocess.Popen[bytes] | None = None

    def run(self, module: str, arguments: Sequence[str], log: IO[bytes], told: bytes = b"") -> int:
        """The exit status of `python -m MODULE ARGUMENTS`.

        Its stdin stays open until then, so that who reads it leaves with a server that is killed.

        Args:
          module: is run.
          arguments: of its command line.
          log: gets its stderr.
          told: a line that it reads first.

        Raises:
          subprocess.TimeoutExpired: it took more than `WALL_S`, and was ended.
          OSError: it cannot be started.
        """
        command = [sys.executable, "-m", module, *arguments]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=log) as process:
            self._process = process
            try:
                with contextlib.suppress(ProcessLookupError):  # its status says more
                    ours = os.getpriority(os.PRIO_PROCESS, 0)
                    os.setpriority(os.PRIO_PROCESS, process.pid, ours + self._niceness)
                assert process.stdin is not None
                with contextlib.suppress(BrokenPipeError):  # here too
                    process.stdin.write(told)
                    process.stdin.flush()
                return process.wait(WALL_S)
            except subprocess.TimeoutExpired:
                process.kill()
                raise
            finally:
                self._process = None

    def stop(self) -> None:
        """Ends what runs: nobody waits for it any more."""
        if (process := self._process) is not None:
            process.kill()
