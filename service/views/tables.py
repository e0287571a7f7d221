"""All episodes of a campaign in a format of other tools, made by a process of its own: the packages take 150 MB."""

import logging
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path

from risk_sac.failures.export.formats import FormatName
from service.errors import StorageError
from service.views.products import TooManyWaiting

logger = logging.getLogger(__name__)

WALL_S = 300.0  # a hundred thousand episodes take one of ten
_AT_WORK = threading.Lock()


def table_of(folders: Sequence[Path], name: FormatName) -> bytes:
    """The episodes of runs, from their folders.

    Raises:
      TooManyWaiting: another table is being made.
      StorageError: it cannot be made; the log has the reason.
    """
    if not _AT_WORK.acquire(blocking=False):
        raise TooManyWaiting("another table of episodes is being made; wanted one at a time")
    try:
        with tempfile.TemporaryDirectory() as scratch:
            file = Path(scratch) / name
            command = [
                sys.executable,
                "-m",
                "risk_sac",
                "export",
                *map(str, folders),
                "--format",
                name,
                "--out",
                str(file),
            ]
            subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=WALL_S, check=True)
            return file.read_bytes()
    except subprocess.SubprocessError as error:
        told = error.stderr.decode(errors="replace")[-2000:] if isinstance(error, subprocess.CalledProcessError) else ""
        logger.exception("a table of episodes was not made: %s", told)
        raise StorageError("the table of episodes cannot be made; the log has the reason") from error
    except OSError as error:
        raise StorageError(f"the table of episodes cannot be made ({error.strerror})") from error
    finally:
        _AT_WORK.release()
