"""The end of a worker's log, without what must not be shown."""

import os
import re
from pathlib import Path

from risk_sac.execution.postmortem import without_folders
from service.errors import StorageError

MOST_BYTES = 256 << 10  # that are read
_UNSEEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")  # moves a cursor, or text


def log_tail(log: Path, lines: int) -> str:
    """Returns the last lines of a log, at most `lines` and `MOST_BYTES`.

    They name no folders of this machine. U+FFFD replaces what is not UTF-8 and what would control a terminal.
    """
    text = _UNSEEN.sub("\ufffd", _end(log).decode(errors="replace").replace("\r\n", "\n").replace("\r", "\n"))
    last = "\n".join(text.removesuffix("\n").split("\n")[-lines:])
    return without_folders(last, log.parent) + "\n" if text else ""


def _end(log: Path) -> bytes:
    """Returns the last bytes without a partial first line, which may be half of a path."""
    try:
        with log.open("rb") as file:
            start = file.seek(max(0, file.seek(0, os.SEEK_END) - MOST_BYTES))
            content = file.read(MOST_BYTES)
    except FileNotFoundError:
        return b""
    except OSError as error:
        raise StorageError(f"the log of the run cannot be read ({error.strerror})") from error
    return content.partition(b"\n")[2] if start else content
