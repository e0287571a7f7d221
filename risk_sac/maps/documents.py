"""Reads a map's XML documents and rewrites them without harmful content.

SUMO never sees the bytes that a user sent. Refused are document types, names of files, and whatever is beyond the
limits; elements that no map needs are left out.
"""

import gzip
import re
import stat
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from io import BufferedIOBase
from itertools import pairwise
from pathlib import Path
from typing import IO
from xml.parsers.expat import ExpatError, ParserCreate
from xml.sax.saxutils import quoteattr

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
    """Yields a file's content, or each archived file's; counts bytes while unpacking.

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
    """Yields an archive's files regardless of stated sizes; refuses dishonest archives."""
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


MAX_DEPTH = 20
MAX_ELEMENTS = 2_000_000  # of one document
MAX_ATTRIBUTES = 100  # of one element
MAX_VALUE = 100_000  # characters of one attribute: a shape of 4,000 points
MAX_ROADS = 50_000  # edges of a net without those inside junctions, ways of OpenStreetMap, roads of OpenDRIVE

FOREIGN_ROOTS = ("osm", "OpenDRIVE")
MAP_ROOTS = ("net", *FOREIGN_ROOTS)
_OF_SUMO = (
    "net location type restriction edge lane neigh stopOffset junction request connection prohibition roundabout param "
    "tlLogic phase routes additional vType vTypeDistribution route routeDistribution vehicle trip flow stop person "
    "personFlow walk ride personTrip busStop trainStop containerStop chargingStation access parkingArea space poly poi "
    "taz tazSource tazSink"
)
_UNREAD = {  # by how a file begins: what it is, and the command that converts it
    rb"BZh": ("packed by bzip2", "bunzip2 MAP.osm.bz2"),
    rb"\xfd7zXZ": ("packed by xz", "unxz MAP.osm.xz"),
    rb"\x28\xb5\x2f\xfd": ("packed by zstd", "unzstd MAP.osm.zst"),
    rb"....\n\tOSMHeader": ("OpenStreetMap's PBF", "osmium cat MAP.osm.pbf -o MAP.osm"),
    rb"\xff\xe0.o5m": ("OpenStreetMap's o5m", "osmium cat MAP.o5m -o MAP.osm"),
}
_COPIED = frozenset(_OF_SUMO.split())
_LEFT_OUT = ("include", "userData", "dataQuality", "geoReference", "offset", "license")  # other files, projections
_NAMES_FILE = re.compile("(?<!pro)file|output|^href$|^dest$", re.IGNORECASE)
_NO_FILE = ("", "nul", "null", "/dev/null")  # SUMO's names for no output
_SWITCHES_DEVICE = re.compile(r"^(has|device)\.")  # of a vehicle; some write files
SIDE_UNKNOWN = "the map does not say on which side people drive: it is read as right-hand traffic"


@dataclass(frozen=True, slots=True)
class Document:
    """A document that was written again."""

    file: Path
    root: str
    attributes: Mapping[str, str]  # of the root
    elements: int
    remarks: tuple[str, ...]


def rewritten(upload: Path, folder: Path, name: str) -> list[Document]:
    """Writes a file's documents again into a folder, under our names.

    The file is plain, or packed by gzip or zip.

    Raises:
      MapError: with the line, if the file holds what no map needs.
    """
    upload.stat()  # one that is missing is not damaged
    try:
        contents = list(unpacked(upload))
    except MapError:
        raise
    except DAMAGED as error:
        raise MapError("network", f"{name} is damaged: {error}") from error
    return [_copied(content, folder / f"{i}.xml", name) for i, content in enumerate(contents)]


def _copied(content: bytes, file: Path, name: str) -> Document:
    with file.open("w", encoding="utf-8") as output:
        copy = _Copy(output, name)
        try:
            copy.parser.Parse(content, True)
        except MapError:
            raise
        except (ExpatError, LookupError, ValueError) as error:  # the latter two: an encoding that Python lacks
            for start, (what, command) in _UNREAD.items():
                if re.match(start, content, re.DOTALL):
                    got, remedy = f"{name}, which is {what}", f"convert it: {command}"
                    raise MapError("network", got, "XML, plain or in gzip or zip", remedy) from error
            raise MapError("network", f"{name} is no well-formed XML: {error}") from error
    if not copy.roads and copy.root in MAP_ROOTS:
        raise MapError("network", f"{name} without roads", "a map with one at least")
    if copy.keeps_left and copy.sides["left"] >= copy.sides["right"]:
        raise copy.keeps_left
    left_out = ", ".join(f"<{tag[:40]}> ({count})" for tag, count in copy.left_out.most_common(10))
    remarks = [f"left out, because they are no part of a map: {left_out}"] if left_out else []
    if copy.root in FOREIGN_ROOTS and not copy.sides:
        remarks.append(SIDE_UNKNOWN)
    return Document(file, copy.root, copy.attributes, copy.elements, tuple(remarks))


class _Copy:
    """Parser handlers that write their input, unless refused or left out."""

    def __init__(self, output: IO[str], name: str) -> None:
        self.root = ""
        self.attributes: Mapping[str, str] = {}
        self.elements = 0
        self.left_out = Counter[str]()
        self.roads = 0
        self.sides = Counter[str]()  # of traffic, by what the map states
        self.keeps_left: MapError | None = None  # names the first place that states it
        self._name = name
        self._path: list[str] = []
        self._skipped = 0  # elements that are open and left out
        self._write = output.write
        self.parser = ParserCreate()
        self.parser.StartElementHandler, self.parser.EndElementHandler = self._start, self._end
        self.parser.StartDoctypeDeclHandler = self._doctype
        output.write('<?xml version="1.0" encoding="UTF-8"?>\n')

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        if not self._path:
            self._begin(tag, attributes)
        self.elements += 1
        self._check_sizes(tag, attributes)
        self._count_road(tag, attributes)
        self._note_side(tag, attributes)
        self._path.append(tag)
        if self._skipped or not self._is_copied(tag, attributes):
            self._skipped += 1
            return
        kept = (f" {key}={quoteattr(_harmless(value))}" for key, value in attributes.items() if _is_plain(key))
        self._write(f"<{tag}{''.join(kept)}>")

    def _end(self, tag: str) -> None:
        self._path.pop()
        if self._skipped:
            self._skipped -= 1
        else:
            self._write(f"</{tag}>\n")

    def _begin(self, tag: str, attributes: Mapping[str, str]) -> None:
        if tag not in (*MAP_ROOTS, "routes", "additional"):
            got = f"{self._name}, whose root is <{tag[:80]}>"
            raise MapError("network", got, "<net> (SUMO), <osm> (OpenStreetMap) or <OpenDRIVE>")
        self.root, self.attributes = tag, attributes

    def _check_sizes(self, tag: str, attributes: Mapping[str, str]) -> None:
        if self.elements > MAX_ELEMENTS:
            raise self._refusal(f"more than {MAX_ELEMENTS} elements", "at most that", SMALLER)
        if len(self._path) >= MAX_DEPTH:
            raise self._refusal(f"elements nested more than {MAX_DEPTH} deep", "at most that")
        if len(attributes) > MAX_ATTRIBUTES:
            raise self._refusal(f"<{tag[:80]}> with {len(attributes)} attributes", f"at most {MAX_ATTRIBUTES}")
        for key, value in attributes.items():
            if len(value) > MAX_VALUE:
                raise self._refusal(f"{len(value)} characters in {key[:80]!r} of <{tag[:80]}>", f"at most {MAX_VALUE}")

    def _count_road(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Counts roads; refuses a map with too many before SUMO reads it."""
        if tag == "tag" and attributes.get("k") == "type" and attributes.get("v") == "lanelet":
            raise MapError("network", f"{self._name}, a Lanelet2 map", "another format", "export it as OpenDRIVE")
        is_way = tag == "tag" and self._path[-1] == "way" and attributes.get("k") == "highway"
        is_edge = tag == "edge" and self.root == "net" and attributes.get("function", "normal") == "normal"
        self.roads += is_way or is_edge or (tag == "road" and self.root == "OpenDRIVE" and len(self._path) == 1)
        if self.roads > MAX_ROADS:
            raise self._refusal(f"more than {MAX_ROADS} roads", "at most that", SMALLER)

    def _note_side(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Counts stated sides of traffic: OpenStreetMap's `driving_side` or OpenDRIVE's `rule`.

        Choice: where they contradict each other, the more frequent one decides.
        """
        side = None
        if self.root == "osm" and tag == "tag" and attributes.get("k") == "driving_side":
            side = attributes.get("v")
        elif self.root == "OpenDRIVE" and tag == "road" and len(self._path) == 1:
            side = "left" if attributes.get("rule") == "LHT" else "right"
        if side in ("left", "right"):
            self.sides[side] += 1
        if side == "left" and self.keeps_left is None:
            said = "driving_side=left" if tag == "tag" else "rule=LHT"
            self.keeps_left = self._refusal(f"left-hand traffic ({said})", "right-hand traffic")

    def _is_copied(self, tag: str, attributes: Mapping[str, str]) -> bool:
        if self.root in FOREIGN_ROOTS:
            return tag.isidentifier() and tag not in _LEFT_OUT
        named = {**attributes, attributes.get("key", ""): attributes.get("value", "")} if tag == "param" else attributes
        for key, value in named.items():
            names_file = _NAMES_FILE.search(key) and value.lower() not in _NO_FILE
            if names_file or _SWITCHES_DEVICE.search(key):
                raise self._refusal(f"<{tag[:80]}> with {key[:80]!r}", "nothing that names a file or writes output")
        if tag == "param" and _NAMES_FILE.search(attributes.get("key", "")):
            return False
        if "/" in attributes.get("projParameter", ""):
            raise self._refusal("projParameter with '/'", "a projection that names no file")
        if tag not in _COPIED:
            self.left_out[tag] += 1
        return tag in _COPIED

    def _doctype(self, *_: object) -> None:
        raise self._refusal("a DOCTYPE", "a document without")

    def _refusal(self, got: str, expected: str, remedy: str = "") -> MapError:
        where = f"line {self.parser.CurrentLineNumber} of {self._name}"
        return MapError("network", f"{got} in {where}", expected, remedy)


def _is_plain(key: str) -> bool:
    return key.isidentifier() and key != "xmlns" and not _NAMES_FILE.search(key)


def _harmless(value: str) -> str:
    """Replaces a value's environment variables and text-direction characters."""
    value = value.replace("${", "_{")
    return value if value.isprintable() else "".join(char if char.isprintable() else "_" for char in value)
