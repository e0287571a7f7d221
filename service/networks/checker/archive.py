"""The XML documents in an upload, every byte counted while it is unpacked.

What an archive says about itself (sizes, names) is not believed: names decide nothing and are only
looked at to refuse those that could harm another program.
"""

import gzip
import re
import stat
import zipfile
import zlib
from collections.abc import Iterable
from io import BufferedIOBase
from itertools import pairwise
from pathlib import Path
from typing import IO

from service.errors import UploadError
from service.networks.limits import MAX_EXPANDED_BYTES, MAX_FILES, MAX_NAME, MAX_RATIO, RATIO_FREE_BYTES
from service.networks.report import Packaging

_CHUNK = 1 << 16
_ENCRYPTED = 0x1
_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}
_DRIVE = re.compile(r"[A-Za-z]:")
# OSError is what seeking to a place before the file's beginning raises; BadGzipFile is one, too.
_DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, ValueError)


def documents(upload: Path, packaging: Packaging) -> list[bytes]:
    """Unpacks the documents of an upload, in their order; refuses what no archive of XML files needs."""
    unpack = _Unpacking(upload.stat().st_size)
    try:
        match packaging:
            case Packaging.XML:
                return [unpack.read(upload.open("rb"))]
            case Packaging.GZIP:
                return [unpack.read(gzip.open(upload))]
            case Packaging.ZIP:
                with zipfile.ZipFile(upload) as archive:
                    return [_member(archive, entry, unpack) for entry in _members(archive.infolist())]
    except _DAMAGED as error:
        raise UploadError(f"the {packaging} file is damaged: {error}") from error


class _Unpacking:
    """Reads files and keeps count of what all of them came to."""

    def __init__(self, packed_bytes: int) -> None:
        self._packed_bytes = packed_bytes
        self._bytes = 0

    def read(self, stream: IO[bytes] | BufferedIOBase) -> bytes:
        chunks = []
        with stream:
            while chunk := stream.read(_CHUNK):
                self._count(len(chunk))
                chunks.append(chunk)
        return b"".join(chunks)

    def _count(self, size: int) -> None:
        self._bytes += size
        if self._bytes > MAX_EXPANDED_BYTES:
            raise UploadError(
                f"the files are more than {MAX_EXPANDED_BYTES >> 20} MiB once unpacked; wanted at most that. "
                "Cut the map to the part that is needed."
            )
        if self._bytes > max(RATIO_FREE_BYTES, MAX_RATIO * self._packed_bytes):
            raise UploadError(f"the files unpack to more than {MAX_RATIO} times their size; no network packs so well")


def _member(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, unpack: _Unpacking) -> bytes:
    content = unpack.read(archive.open(entry))
    if len(content) != entry.file_size:
        raise UploadError(
            f"entry {entry.filename!r} has {len(content)} bytes; wanted {entry.file_size}, which it says it has"
        )
    return content


def _members(entries: list[zipfile.ZipInfo]) -> Iterable[zipfile.ZipInfo]:
    """The files of an archive, once all its entries are found harmless."""
    if len(entries) > MAX_FILES:
        raise UploadError(f"the archive has {len(entries)} entries; wanted at most {MAX_FILES}")
    for entry in entries:
        _check_name(entry.orig_filename)
        _check_entry(entry)
    names = [entry.orig_filename for entry in entries]
    if len(set(names)) < len(names):
        raise UploadError(f"the archive has the entries {names}; wanted each name once")
    _check_overlap(sorted(entries, key=lambda entry: entry.header_offset))
    return [entry for entry in entries if not entry.is_dir()]


def _check_name(name: str) -> None:
    parts = name.replace("\\", "/").split("/")
    if not 0 < len(name) <= MAX_NAME or not name.isprintable():
        raise UploadError(f"an entry is named {name[:80]!r}; wanted at most {MAX_NAME} printable characters")
    if parts[0] == "" or ".." in parts or "\\" in name or _DRIVE.match(name):
        raise UploadError(f"an entry is named {name[:80]!r}; wanted a name that stays inside the archive")


def _check_entry(entry: zipfile.ZipInfo) -> None:
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        what = "a symbolic link" if kind == stat.S_IFLNK else "a special file"
        raise UploadError(f"entry {entry.filename!r} is {what}; wanted files only")
    if entry.flag_bits & _ENCRYPTED:
        raise UploadError(f"entry {entry.filename!r} is encrypted; wanted it in the clear")
    if entry.compress_type not in _METHODS:
        raise UploadError(f"entry {entry.filename!r} is packed by method {entry.compress_type}; wanted deflate or none")


def _check_overlap(entries: list[zipfile.ZipInfo]) -> None:
    """Refuse entries that share bytes: the way to a bomb that no ratio of a single entry shows."""
    for entry, following in pairwise(entries):
        if entry.header_offset + entry.compress_size >= following.header_offset:
            raise UploadError(f"entries {entry.filename!r} and {following.filename!r} overlap")
