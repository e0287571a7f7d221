"""One worker per run, even if one of a server that was killed is still there."""

import logging
import sys
import time
from pathlib import Path
from typing import IO

import psutil

from service.errors import StorageError
from service.host.locks import try_lock

logger = logging.getLogger(__name__)

PATIENCE_S = 5.0  # a worker leaves as soon as its server is gone, but one that was stopped cannot
POLL_S = 0.05


def take_over(folder: Path) -> IO[bytes]:
    """Lock a run's folder for this worker; close the returned file to give it back.

    A worker that still holds it has no server any more: one server at a time starts workers here, and one at a time
    for a run. It is given some time, then it is killed.

    Raises:
      OSError: the folder cannot be written.
    """
    killing_at = time.monotonic() + PATIENCE_S
    while True:
        try:
            return try_lock(folder)
        except StorageError:
            if time.monotonic() >= killing_at:
                _kill_others()
        time.sleep(POLL_S)


def _kill_others() -> None:
    """Ends processes that were started as this one was, with the same module and folder."""
    own = psutil.Process()
    started_as = slice(1, 4)  # -m MODULE FOLDER
    for other in psutil.process_iter(["cmdline"]):
        if other != own and (other.info["cmdline"] or [])[started_as] == sys.orig_argv[started_as]:
            logger.warning("process %d is a worker of this run and has lost its server; it is killed", other.pid)
            other.kill()
