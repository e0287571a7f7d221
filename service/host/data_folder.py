"""Data folder: private to its owner, used by one process at a time."""

import os
import stat
from pathlib import Path
from typing import IO

from risk_sac.run_folder.durable import lock
from service.errors import StorageError

LOCK = ".lock"
OURS = (LOCK, "keys.lock")  # files by which a data folder is known
NEW_VOLUME = {"lost+found"}  # content of a new volume
OTHERS = 0o077  # permissions of group and others
FILE_MODE, FOLDER_MODE = 0o600, 0o700


def hold_data_folder(folder: Path) -> IO[bytes]:
    """Makes and locks the data folder; closing the returned file unlocks it.

    The kernel unlocks it when the process dies.

    Raises:
      StorageError: it is in use, cannot be written, or others may read it and that cannot be changed.
    """
    try:
        folder.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        _close_to_others(folder)
        return lock(folder / LOCK)
    except BlockingIOError as error:
        raise StorageError(f"folder {str(folder)!r} is in use by another process; stop it or use another") from error
    except OSError as error:
        message = f"data_dir is {str(folder)!r}; wanted a folder that can be written ({error.strerror})"
        raise StorageError(message) from error


def _close_to_others(folder: Path) -> None:
    """Makes a data folder private; refuses folders of other programs, such as /var/lib."""
    status = folder.stat()
    mode, able = stat.S_IMODE(status.st_mode), os.geteuid() in (status.st_uid, 0)
    names = {path.name for path in folder.iterdir()} - NEW_VOLUME
    if mode & OTHERS and able and names and names.isdisjoint(OURS):
        raise StorageError(
            f"data_dir is {str(folder)!r}, which others may look into (mode {mode:04o}) and which holds other files; "
            f"wanted a folder of its own, or mode {FOLDER_MODE:04o}"
        )
    make_private(folder)


def create_private(path: Path) -> None:
    """Makes an empty private file where there is none."""
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT, FILE_MODE))
    except OSError as error:
        raise StorageError(f"{str(path)!r} cannot be written ({error.strerror})") from error


def make_private(path: Path) -> None:
    """Removes the permissions of group and others; ignores a missing path.

    The group keeps its permissions on a file of another user, as on a shared volume.

    Raises:
      StorageError: others may read it, and another user owns it.
    """
    try:
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & OTHERS:
            path.chmod(mode & ~OTHERS)
    except FileNotFoundError:
        return
    except OSError as error:
        if mode & stat.S_IRWXO:
            wanted = FOLDER_MODE if path.is_dir() else FILE_MODE
            wrong = f"{str(path)!r} has mode {mode:04o}, which its owner has to change ({error.strerror})"
            raise StorageError(f"{wrong}; wanted {wanted:04o}") from error
