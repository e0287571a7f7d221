"""Exclusive use of a folder by one process, given back by the kernel when that process dies."""

import fcntl
from pathlib import Path
from typing import IO

from service.errors import StorageError


def try_lock(folder: Path) -> IO[bytes]:
    """Lock a folder; close the returned file to give it back.

    Raises:
      StorageError: another process holds it.
    """
    handle = (folder / ".lock").open("ab")
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        handle.close()
        raise StorageError(f"folder {str(folder)!r} is in use by another process; stop it or use another") from error
    return handle
