"""The data folder: made where there is none, closed to others, and in use by one process at a time."""

import os
import stat
from pathlib import Path
from typing import IO

from service.errors import StorageError
from service.host.locks import LOCK, try_lock
from service.host.private import FOLDER_MODE, OTHERS, make_private

OURS = (LOCK, "keys.lock")  # files by which a data folder is known
NOBODYS = "lost+found"  # of a new volume


def hold_data_folder(folder: Path) -> IO[bytes]:
    """Lock the data folder; close the returned file to give it back.

    Raises:
      StorageError: it is in use, cannot be written, or others may look into it and that cannot be mended.
    """
    try:
        folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        _close_to_others(folder)
        return try_lock(folder)
    except OSError as error:
        message = f"data_dir is {str(folder)!r}; wanted a folder that can be written ({error.strerror})"
        raise StorageError(message) from error


def _close_to_others(folder: Path) -> None:
    """Mend the mode of a data folder; never that of a folder which others need, such as /var/lib."""
    status = folder.stat()
    mode, able = stat.S_IMODE(status.st_mode), os.geteuid() in (status.st_uid, 0)
    if mode & OTHERS and able and not _is_ours(folder):
        raise StorageError(
            f"data_dir is {str(folder)!r}, which others may look into (mode {mode:04o}) and which holds other files; "
            f"wanted a folder of its own, or mode {FOLDER_MODE:04o}"
        )
    make_private(folder)


def _is_ours(folder: Path) -> bool:
    names = {path.name for path in folder.iterdir()} - {NOBODYS}
    return not names or not names.isdisjoint(OURS)
