"""Names of files as SUMO takes them: it splits paths at commas and puts environment variables for `${}`."""

import re
import tempfile
from functools import cache
from pathlib import Path

_PLAIN = re.compile(r"[^,;$%]*")


@cache  # one link for each file
def plain_name(file: str) -> str:
    """The file's own path, or that of a link to it whose name SUMO takes for one file."""
    if _PLAIN.fullmatch(file):
        return file
    folder = Path(_links().name)
    link = folder / f"{len(list(folder.iterdir()))}.xml"
    link.symlink_to(Path(file).absolute())
    return str(link)


@cache
def _links() -> "tempfile.TemporaryDirectory[str]":
    """A folder that is removed when the process ends."""
    usual = tempfile.gettempdir()
    return tempfile.TemporaryDirectory(prefix="risk-sac-", dir=usual if _PLAIN.fullmatch(usual) else "/tmp")
