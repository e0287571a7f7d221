"""Records that server and checker share: media types and the checker's report.

Plain dataclasses, since importing pydantic would cost the checker more time and memory than most uploads.
"""

from dataclasses import dataclass
from enum import StrEnum

from risk_sac.scenario.maps.summary import Summary

MEDIA_TYPES = ("application/xml", "text/xml", "application/gzip", "application/x-gzip", "application/zip")
PLACES, PICTURE = "places.json", "places.png"  # what a search for places leaves beside the net
PROGRESS = "progress"  # of the search, as long as it goes on


class Kind(StrEnum):
    """Kind of a document, by its root element."""

    NET = "net"
    ROUTES = "routes"
    ADDITIONAL = "additional"


@dataclass(frozen=True, slots=True)
class NetworkFile:
    """File of a network, as the service rewrote it."""

    name: str
    """Given by the service; the names in an archive are not kept."""
    kind: Kind
    """Told by its root element."""
    bytes: int
    elements: int
    sha256: str

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - pydantic's name


@dataclass(frozen=True, slots=True)
class CheckReport:
    """Result of the checker, with either `refused` or `summary`."""

    refused: str | None = None
    summary: Summary | None = None
    files: tuple[NetworkFile, ...] = ()
    warnings: tuple[str, ...] = ()
