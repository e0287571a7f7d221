"""Files and folders that nobody but their owner may look into."""

import os
import stat
from pathlib import Path

from service.errors import StorageError

OTHERS = 0o077  # what group and others may do
FILE_MODE, FOLDER_MODE = 0o600, 0o700


def create_private(path: Path) -> None:
    """Make an empty file of our own where there is none.

    Raises:
      StorageError: it cannot be made.
    """
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT, FILE_MODE))
    except OSError as error:
        raise StorageError(f"{str(path)!r} cannot be written ({error.strerror})") from error


def make_private(path: Path) -> None:
    """Take from others what they may do with a file or folder; one that there is not is left alone.

    Where it is somebody else's, that one's group may keep what it may do: it is how a volume is lent to a user.

    Raises:
      StorageError: everybody may look into it, and it is not ours to change.
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
