"""Response bodies about networks, stored in the same form."""

from datetime import datetime

from pydantic import BaseModel, Field

from risk_sac.records import Page, Record
from risk_sac.scenario.maps.found import Pattern
from service.networks.report import NetworkFile


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
    """Of the body that was sent."""
    bytes: int
    """Of the body that was sent."""
    files: list[NetworkFile]
    edges: int
    """Roads from junction to junction, one per direction; those inside junctions are not counted."""
    junctions: int
    lanes: int
    """Of those edges, sidewalks included."""
    length_m: float
    """Of those edges, each counted once however many lanes it has."""
    bounding_box: BoundingBox
    warnings: list[str]
    """What the simulator remarked when it loaded the network; at most 20."""


class NetworkPage(Page[Network]):
    """Networks, newest first."""


class Spot(Record):
    """Somewhere on a network, m in its own coordinates."""

    pattern: Pattern
    place: str
    """The edge on which it is, or that leads to it; how a campaign names it."""
    x_m: float
    y_m: float


class FoundPlace(Spot):
    """Place that a pattern fits."""

    summary: str
    rare: bool = False
    """Contacts are rare there: no vehicle can cut in."""


class Elsewhere(Spot):
    """Place that a pattern does not fit."""

    why: str


class Places(Record):
    """Places of the patterns on a network, in the order of the net."""

    items: list[FoundPlace]
    elsewhere: list[Elsewhere]
    nowhere: dict[Pattern, str] = Field(default_factory=dict)
    """Why a pattern has no place and no misfit at all."""
    progress: float = 1.0
    """Share of the network that was searched; below 1 both lists are still empty."""


class StoredNetwork(BaseModel):
    """A network as it is stored."""

    network: Network
