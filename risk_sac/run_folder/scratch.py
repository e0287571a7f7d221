"""Temporary folders and files of ours, and the removal of those that killed processes left."""

import contextlib
import fcntl
import os
import re
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from risk_sac.machine import NO_LOCKS

_SCRATCH = re.compile(r"risk-sac\.[0-9a-f]{16}\.scratch")
# Files that `durable.replace_file` writes into folders of ours, before they get their names.
_TEMPORARY = re.compile(
    r"\.(?:(?:results|verified|crashes|keys|table|places)\.(?:json|md|csv)|spec\.yaml|checkpoint|\d{6}\.npz"
    r"|\d{6}-(?:core|region)\.json|[A-Za-z0-9]+-[0-9a-f]{16}\.json|places\.png)\.tmp|\.probe"
)


def scratch_name() -> str:
    """Returns a new name by which `claim` knows a folder as ours."""
    return f"risk-sac.{secrets.token_hex(8)}.scratch"


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """Makes a temporary folder and removes it at the end.

    If this process is killed, the next one removes it.
    """
    folder = Path(tempfile.gettempdir(), scratch_name())
    handle = claim(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(handle)


def remove_abandoned(parent: Path) -> None:
    """Removes the folders made by `claim` in a folder whose processes have gone."""
    for folder in parent.iterdir():
        if _SCRATCH.fullmatch(folder.name):
            with contextlib.suppress(OSError):  # its process lives, or it is another user's
                handle = _locked(folder)
                shutil.rmtree(folder, ignore_errors=True)
                os.close(handle)


def claim(folder: Path) -> int:
    """Makes a folder named by `scratch_name`, and removes those beside it whose processes have gone.

    Returns the descriptor that locks it; the kernel unlocks it when the process dies.
    """
    remove_abandoned(folder.parent)
    while True:
        folder.mkdir(mode=0o700, exist_ok=True)
        try:
            handle = _locked(folder)
            if folder.exists():
                return handle
            os.close(handle)
        except (BlockingIOError, FileNotFoundError):  # another process is just removing it
            time.sleep(0.01)
        except OSError as error:
            if error.errno not in NO_LOCKS:
                raise
            return os.open(folder, os.O_RDONLY)  # then no other process can take it for abandoned


def _locked(folder: Path) -> int:
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(handle)
        raise
    return handle


def remove_temporaries(folder: Path, before: float) -> None:
    """Removes our temporary files below a folder that are older than `before`.

    They were last written before that moment, s since the epoch.
    """
    for parent, _, names in os.walk(folder):
        for name in filter(_TEMPORARY.fullmatch, names):
            with contextlib.suppress(OSError):
                file = Path(parent, name)
                if file.stat().st_mtime < before:
                    file.unlink()
