"""Networks and places in requests and answers, and their limits."""

from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from pydantic import BaseModel, Field

from risk_sac.maps.found import Pattern
from risk_sac.records import Page, Record
from risk_sac.world.net import NetSummary

CPU_S = 150  # a net of 50,000 edges takes 45
WALL_S = 300
LOG_BYTES = 64 << 10  # what the simulator may write to its log, and to any other file
OPEN_FILES = 64
SURVEY_S = 1800  # that a search for places may take; 50,000 edges take 150 on one core
SCENARIO_S = 300  # that a scenario may take to be checked and played; the shipped ones take 5 to 30
MEMORY_BYTES = 4 << 30  # that finding places, or checking a scenario, may take
MAX_PLACES = 100  # of a campaign
STEPS, STEP_S = 3, 0.1  # that the simulator runs

MEDIA_TYPES = ("application/xml", "text/xml", "application/gzip", "application/x-gzip", "application/zip")
ZIPPED = "An OpenSCENARIO file goes into a zip archive, with the roads and catalogs that it names"
PLACES, PICTURE, ROADS = "places.json", "places.png", "roads.json"  # what a search for places leaves beside the net
PROGRESS = "progress"  # of the search, as long as it goes on


class DocumentKind(StrEnum):
    """Kind of a document, by its root element."""

    NET = "net"
    ROUTES = "routes"
    ADDITIONAL = "additional"


@dataclass(frozen=True, slots=True)
class NetworkFile:
    """File of a network, as the service rewrote it."""

    name: str
    """Given by the service; the names in an archive are not kept."""
    kind: DocumentKind
    """Told by its root element."""
    bytes: int
    elements: int
    sha256: str

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - pydantic's name


@dataclass(frozen=True, slots=True)
class CheckReport:
    """Result of the checker, with either `refused` or `summary`."""

    refused: str | None = None
    summary: NetSummary | None = None
    files: tuple[NetworkFile, ...] = ()
    warnings: tuple[str, ...] = ()


class BoundingBox(Record):
    """Bounding box of all lanes, m in the net's own coordinates."""

    west: float
    south: float
    east: float
    north: float


class Network(Record):
    """Stored road network, checked and loaded once by the simulator."""

    id: str
    label: str
    created_at: datetime
    sha256: str
    """Of the body."""
    bytes: int
    """Of the body."""
    files: list[NetworkFile]
    edges: int
    """Roads, one per direction; those inside junctions are not counted."""
    junctions: int
    lanes: int
    """Of those edges, sidewalks included."""
    length_m: float
    """Of those edges, whatever their lanes."""
    bounding_box: BoundingBox
    warnings: list[str]
    """Remarks of the simulator; at most 20."""


class NetworkPage(Page[Network]):
    """Networks, newest first."""


class SpotBody(Record):
    """Somewhere on a network."""

    pattern: Pattern
    place: str
    """The edge on which it is, or that leads to it."""
    x_m: float
    y_m: float


class FoundPlace(SpotBody):
    """Place that a pattern fits."""

    summary: str
    rare: bool = False
    """Contacts are rare there: no vehicle can cut in."""


class Elsewhere(SpotBody):
    """Place that a pattern does not fit."""

    why: str


class Places(Record):
    """Places of the patterns on a network, in the net's order."""

    items: list[FoundPlace]
    elsewhere: list[Elsewhere]
    nowhere: dict[Pattern, str] = Field(default_factory=dict)
    """Why a pattern has no place and no misfit at all."""
    progress: float = 1.0
    """Share of the network that was searched; below 1 both lists are still empty."""


class StoredNetwork(BaseModel):
    """A network as it is stored."""

    network: Network
