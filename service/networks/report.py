"""What the checker says on its stdout, for the server to read."""

from dataclasses import dataclass
from enum import StrEnum


class Kind(StrEnum):
    """What a document is, told by its root element."""

    NET = "net"
    ROUTES = "routes"
    ADDITIONAL = "additional"


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """A document that was found harmless, as it was written anew."""

    name: str
    kind: Kind
    bytes: int
    elements: int
    sha256: str


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
    files: tuple[CheckedFile, ...] = ()
    warnings: tuple[str, ...] = ()
