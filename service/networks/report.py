"""What server and checker share: how an upload is packed, and what the checker reports of it.

No models of pydantic: to import that would take the checker more time and memory than most uploads.
"""

from dataclasses import dataclass
from enum import StrEnum

from service.errors import UploadError

PLACES, PICTURE = "places.json", "places.png"  # what a search for places leaves beside the net


class Kind(StrEnum):
    """What a document is, told by its root element."""

    NET = "net"
    ROUTES = "routes"
    ADDITIONAL = "additional"


@dataclass(frozen=True, slots=True)
class NetworkFile:
    """One of the files of a network, as the service has written it anew."""

    name: str
    """Given by the service; the names in an archive are not kept."""
    kind: Kind
    """Told by its root element."""
    bytes: int
    elements: int
    sha256: str

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - pydantic's name


@dataclass(frozen=True, slots=True)
class Summary:
    """What a net has; edges and lanes are those outside junctions."""

    edges: int
    junctions: int
    lanes: int
    length_m: float  # of the edges, each counted once however many lanes it has
    bounding_box: tuple[float, float, float, float]  # of the lanes: west, south, east, north, m


@dataclass(frozen=True, slots=True)
class CheckReport:
    """The last word of the checker; exactly one of `refused` and `summary` is there."""

    refused: str | None = None
    summary: Summary | None = None
    files: tuple[NetworkFile, ...] = ()
    warnings: tuple[str, ...] = ()


class Packaging(StrEnum):
    """What the body of an upload is."""

    XML = "xml"
    GZIP = "gzip"
    ZIP = "zip"


MEDIA_TYPES = {
    "application/xml": Packaging.XML,
    "text/xml": Packaging.XML,
    "application/gzip": Packaging.GZIP,
    "application/x-gzip": Packaging.GZIP,
    "application/zip": Packaging.ZIP,
}
SNIFFED_BYTES = 64
_STARTS = {Packaging.XML: b"<", Packaging.GZIP: b"\x1f\x8b", Packaging.ZIP: b"PK\x03\x04"}
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def sniff(start: bytes, packaging: Packaging) -> None:
    """Refuses at once what cannot be what its Content-Type says, by its first `SNIFFED_BYTES`."""
    if not start:
        raise UploadError("the upload is empty; wanted a network")
    text = start.removeprefix(_BYTE_ORDER_MARK).lstrip() if packaging is Packaging.XML else start
    if not text.startswith(_STARTS[packaging]):
        raise UploadError(f"the upload starts with {start[:8]!r}, which is no {packaging}; wanted what its type says")
