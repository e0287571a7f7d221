"""Unpacks a plain, gzip or zip map, and counts its bytes."""

import gzip
import re
import stat
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from io import BufferedIOBase
from itertools import pairwise
from pathlib import Path
from typing import IO

from risk_sac.errors import MapError

MAX_BYTES = 256 << 20  # of all documents together, once unpacked
MAX_RATIO = 100  # bytes unpacked per byte packed; SUMO's nets reach 10 to 20
RATIO_FREE_BYTES = 1 << 20  # so little may be packed as tightly as it likes
MAX_FILES = 20  # in an archive
MAX_NAME = 200  # characters of a file's name
SMALLER = "cut the map to the part that is needed"
DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, RuntimeError, ValueError)
_CHUNK = 1 << 16
_ENCRYPTED = 0x1


def unpacked(upload: Path) -> Iterator[bytes]:
    """The file's content, or that of each file in it; every byte is counted while it is unpacked.

    Raises:
      MapError: it is too large, or an archive that could harm.
      DAMAGED: it is damaged.
    """
    with upload.open("rb") as stream:
        start = stream.read(4)
    most = min(MAX_BYTES, max(RATIO_FREE_BYTES, MAX_RATIO * upload.stat().st_size))
    if start.startswith(b"\x1f\x8b"):
        with gzip.open(upload) as packed:
            yield _read(packed, most)
    elif start.startswith(b"PK"):
        with zipfile.ZipFile(upload) as archive:
            for entry in _members(archive.infolist()):
                with archive.open(entry) as member:
                    content = _read(member, most)
                most -= len(content)
                yield content
    elif start:
        with upload.open("rb") as stream:
            yield _read(stream, most)
    else:
        raise MapError("network", "an empty file", "a map")


def _read(stream: IO[bytes] | BufferedIOBase, most: int) -> bytes:
    content = bytearray()
    while chunk := stream.read(_CHUNK):
        content += chunk
        if len(content) > most:
            got = f"what unpacks to more than {MAX_BYTES >> 20} MiB, or {MAX_RATIO} times its size"
            raise MapError("network", got, "less", SMALLER)
    return bytes(content)


def _members(entries: list[zipfile.ZipInfo]) -> Iterable[zipfile.ZipInfo]:
    """Files of an archive; their names and sizes decide nothing, and those of no honest archive are refused."""
    if len(entries) > MAX_FILES:
        raise MapError("network", f"an archive with {len(entries)} entries", f"at most {MAX_FILES}")
    for entry in entries:
        name, kind = entry.orig_filename, stat.S_IFMT(entry.external_attr >> 16)
        if not 0 < len(name) <= MAX_NAME or not name.isprintable() or re.search(r"^/|\\|^\w:|(^|/)\.\.(/|$)", name):
            raise MapError("network", f"an entry named {name[:80]!r}", "a printable name that stays inside the archive")
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR) or entry.flag_bits & _ENCRYPTED:
            raise MapError("network", f"entry {name!r}, which is a link, no file, or encrypted", "plain files")
    ordered = sorted(entries, key=lambda entry: entry.header_offset)
    if any(one.header_offset + one.compress_size >= other.header_offset for one, other in pairwise(ordered)):
        raise MapError("network", "an archive with entries that overlap", "entries side by side")
    return [entry for entry in entries if not entry.is_dir()]
