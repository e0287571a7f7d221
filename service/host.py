"""The server process: its private data folder and its log."""

import logging
import os
import re
import stat
from pathlib import Path
from typing import IO, Literal

from pythonjsonlogger.core import RESERVED_ATTRS
from pythonjsonlogger.json import JsonFormatter

from risk_sac.host.terminal import LogFormatter
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
    """Makes a data folder private; refuses folders of other programs (/var/lib)."""
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


SUBJECTS = ("campaign", "run")  # of a record's `extra`
_OUR_ERROR = re.compile(r"\n(?:service|risk_sac)\.[\w.]+: (?P<reason>.*)\Z", re.DOTALL)
NAMES = {"levelname": "level", "name": "logger"}


def shorten(record: logging.LogRecord) -> bool:
    """Shortens uvicorn's startup error to our reason, without the traceback."""
    known = _OUR_ERROR.search(record.msg) if isinstance(record.msg, str) else None
    if known and record.msg.startswith("Traceback"):
        record.msg = f"cannot start: {known['reason'].strip()}"
    return True


class TextFormatter(LogFormatter):
    """A line that ends with what it is about."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's own name
        """The line before a traceback."""
        about = ((name, record.__dict__.get(name)) for name in SUBJECTS)
        subjects = ", ".join(f"{name} {value}" for name, value in about if value is not None)
        return super().formatMessage(record) + (f" [{subjects}]" if subjects else "")


def set_up_logs(log_format: Literal["text", "json"]) -> None:
    """Write everything from `INFO` on to standard error, uvicorn's records included."""
    handler = logging.StreamHandler()
    handler.addFilter(shorten)
    handler.setFormatter(TextFormatter() if log_format == "text" else json_formatter())
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
    logging.getLogger("alembic").setLevel(logging.WARNING)  # it tells of every start


def json_formatter() -> logging.Formatter:
    """Makes one object per line: time, level, logger, message, extra fields."""
    return JsonFormatter(
        (*NAMES, "message"),
        rename_fields=NAMES,
        timestamp="time",
        reserved_attrs=[*RESERVED_ATTRS, "color_message", "taskName"],
    )
