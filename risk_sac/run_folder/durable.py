"""Files that are whole or not there: a crash or a full disk at any moment leaves the old file or the new one."""

import contextlib
import hashlib
import os
from pathlib import Path


def replace_file(path: Path, *parts: bytes | memoryview, keep: Path | None = None) -> None:
    """Puts the parts, one after the other, at `path` in one step. One writer per path.

    Args:
      path: in an existing folder.
      parts: the content.
      keep: where the old file goes; at every moment there is a whole one at `path` or at `keep`.

    Raises:
      OSError: the folder is missing, unwritable or full; an old file stays as it was.
    """
    temporary = path.with_name(f".{path.name}.tmp")  # same folder: a rename across file systems is not atomic
    try:
        with temporary.open("wb") as file:
            for part in parts:
                file.write(part)
            file.flush()
            os.fsync(file.fileno())
        if keep is not None and path.exists():
            path.replace(keep)
        temporary.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Makes the renames in a folder survive a power cut."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def set_aside(path: Path) -> Path:
    """Renames a damaged file, so that nothing takes it for a good one; returns its new path.

    Raises:
      OSError: the folder cannot be written.
    """
    return path.replace(path.with_name(f"{path.name}.damaged"))


def sha256(path: Path) -> str | None:
    """SHA-256 of a file's content, in hexadecimal; None if it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
