"""Places found on a map, and the scenarios made of them."""

import math
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any, Literal

from risk_sac.config import Scenario
from risk_sac.errors import ConfigError
from risk_sac.scenario.lane_places import Piece, Track
from risk_sac.scenario.reading import document_from_fields
from risk_sac.world.net import Net

Pattern = Literal["car_following", "crossing", "junction"]
TITLES: dict[Pattern, str] = {  # what people read
    "car_following": "Car following",
    "crossing": "Hidden pedestrian",
    "junction": "Junction",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Spot:
    """Somewhere on a map that a pattern might be placed."""

    pattern: Pattern
    id: str  # such as an edge, or a junction and one of its edges: what a user names it by
    x_m: float
    y_m: float

    def told(self) -> dict[str, object]:
        """The spot as it is written as JSON."""
        return {"pattern": self.pattern, "place": self.id, "x_m": self.x_m, "y_m": self.y_m}


@dataclass(frozen=True, slots=True)
class Fit:
    """A spot where a pattern fits."""

    spot: Spot
    scenario: Scenario
    tracks: tuple[Track, ...]
    """On which vehicles may start."""
    rare: bool = False
    """Whether contacts are hardly possible."""

    @property
    def summary(self) -> str:
        """Summarises the place and its rare contacts."""
        return self.scenario.summary + (" Contacts are rare here: no vehicle can cut in." if self.rare else "")

    def told(self) -> dict[str, object]:
        """The place as it is written as JSON."""
        return self.spot.told() | {"summary": self.summary, "rare": self.rare}


@dataclass(frozen=True, slots=True)
class Misfit:
    """A spot where a pattern does not fit, and why."""

    spot: Spot
    why: str

    def told(self) -> dict[str, object]:
        """The spot and the reason as they are written as JSON."""
        return self.spot.told() | {"why": self.why}


class NoFit(Exception):
    """Why a pattern does not fit; for the finders alone."""


def lacking(got: float, unit: str, wanted: float) -> str:
    """States a number and the larger one wanted, with distinguishing digits."""
    below, above = math.floor(got * 10.0) / 10.0, math.ceil(round(wanted * 10.0, 6)) / 10.0
    return f"{below:g} {unit}; wanted {above:g} {unit}"


@dataclass(frozen=True, slots=True)
class Survey:
    """All places of a map in net order, and reasons for misfits."""

    fits: tuple[Fit, ...]
    misfits: tuple[Misfit, ...]
    nowhere: Mapping[Pattern, str]  # why a pattern has neither

    @property
    def counts(self) -> Counter[str]:
        """Places by pattern."""
        return Counter(fit.spot.pattern for fit in self.fits)


NET = "net.xml"  # network of a document of a place
LONGEST_NAME, LONGEST_SUMMARY = 40, 300
WALK_OFFSET_M = 1.9  # of a pedestrian from the middle of its way, along the road, at most
Fields = dict[str, Any]


def scenario_of(spot: Spot, summary: str, tags: Sequence[str], like: Mapping[str, Any], fields: Fields) -> Scenario:
    """Makes a place's document; `like` is the shipped family whose prior fits.

    Raises:
      NoFit: a document may not have the net's names.
    """
    try:
        return document_from_fields(
            {
                "name": _name_of(spot),
                "summary": summary[:LONGEST_SUMMARY],
                "tags": list(tags),
                "network": NET,
                "like": dict(like),
                "friction": "friction",
                **fields,
            }
        )
    except ConfigError as error:
        raise NoFit(f"no scenario can be written of it: {error}") from error


def _name_of(spot: Spot) -> str:
    words = re.sub("[^a-z0-9]+", "_", re.sub("^-", "minus_", spot.id.lower()))  # of two directions of a road
    return f"{spot.pattern}_{words.strip('_')}"[:LONGEST_NAME].strip("_")


def number(range_: tuple[float, float], unit: str, meaning: str, odd: str | None = None) -> Fields:
    """States a scene parameter; raises `NoFit` if its range is empty."""
    if range_[0] > range_[1]:
        raise NoFit(f"there is no room for the {meaning}: it would be {range_[0]:g} to {range_[1]:g} {unit}")
    return {"unit": unit, "range": range_, "meaning": meaning} | ({"odd": odd} if odd else {})


def friction() -> Fields:
    """States the parameter of the road's surface."""
    return {"friction": number((0.6, 1.0), "1", "tyre-road friction coefficient", "environment.friction")}


def initial_speed(name: str, low: float, limit_mps: float, meaning: str) -> Fields:
    """States the range of a vehicle's initial speed.

    It begins at `low`, or at half the road's limit if that is lower.
    """
    odd = "dynamic.ego_speed_mps" if name.startswith("ego") else "dynamic.vehicle_speed_mps"
    high = top_speed(limit_mps)
    return {name: number((at_most(low, high / 2), at_most(high, high)), "m/s", meaning, odd)}


def walking(offset: str) -> Fields:
    """States a pedestrian's parameters: offset along the road, setback and speed."""
    speed = number((0.0, 2.0), "m/s", "initial walking speed", "dynamic.pedestrian_speed_mps")
    return {
        "pedestrian_offset_m": number((-WALK_OFFSET_M, WALK_OFFSET_M), "m", offset),
        "pedestrian_setback_m": number((0.3, 5.0), "m", "pedestrian's distance from the kerb"),
        "pedestrian_speed_mps": speed,
    }


def pedestrian(edge: str, side: str = "right") -> Fields:
    """States a pedestrian about to cross at an edge's end."""
    return {
        "body": "pedestrian",
        "start": {
            "crossing": edge,
            "side": side,
            "setback_m": "pedestrian_setback_m",
            "offset_m": "pedestrian_offset_m",
        },
        "speed": "pedestrian_speed_mps",
    }


def signal_parts(net: Net, ids: Iterable[str | None]) -> tuple[Fields, Fields]:
    """States the parameter of the first signal's offset, and the document's `signal`."""
    cycles_s = ((id_, net.programs[id_].cycle_s) for id_ in ids if id_ in net.programs)
    for id_, cycle_s in cycles_s:
        if cycle_s > 0.0:
            offset = number((0.0, cycle_s), "s", "position in the signal's cycle at the start")
            return {"signal_offset_s": offset}, {"signal": {"id": id_, "offset_s": "signal_offset_s"}}
    return {}, {}


def at_most(usual: float, room: float) -> float:
    """Returns the usual bound or a place's room, rounded down to tenths."""
    return usual if usual <= room else math.floor(room * 10 + 1e-9) / 10


def top_speed(limit_mps: float) -> float:
    """Computes the highest initial speed, the limit rounded down to 0.1 m/s."""
    return math.floor(limit_mps * 10 + 1e-9) / 10


def lane_of(net: Net, track: Track) -> str:
    """Names the track's reference lane; raises `NoFit` if it names an edge."""
    return _lane(net, next(piece for piece in reversed(track.pieces) if piece.reach_m >= 0.0))


def route_of(net: Net, track: Track) -> list[str]:
    """Returns a track's lanes, then edges, as a route; raises as `lane_of`."""
    return [*(_lane(net, piece) for piece in track.pieces), *track.onward]


def _lane(net: Net, piece: Piece) -> str:
    name = f"{piece.edge}_{piece.lane}"
    if name in net.edges:
        raise NoFit(f"the net has an edge and a lane {name!r}; wanted different names")
    return name


AROUND_M = 100.0  # unused roads up to this far from a place stay: a picture shows them


def cut(net: Net, root: ET.Element, fit: Fit) -> bytes:
    """Returns the file of the piece around a place; `root` stays unchanged."""
    driven = {edge for track in fit.tracks for edge in track.edges}
    crossed = {net.edges[id_].end for id_ in driven} | {net.edges[id_].start for id_ in driven}
    near = {
        id_ for id_, j in net.junctions.items() if math.hypot(j.x_m - fit.spot.x_m, j.y_m - fit.spot.y_m) <= AROUND_M
    }
    whole = crossed | near
    edges = {edge.id for edge in net.edges.values() if edge.start in whole or edge.end in whole}
    touched = {junction for id_ in edges for junction in (net.edges[id_].start, net.edges[id_].end)}
    # A junction of which all roads are there anyway is whole as well.
    cut_through = {j for edge in net.edges.values() if edge.id not in edges for j in (edge.start, edge.end)}
    return _written(root, edges, touched, touched - cut_through, net)


def _written(root: ET.Element, edges: Set[str], touched: Set[str], whole: Set[str], net: Net) -> bytes:
    def at(edge: str) -> str:
        """Returns the junction at an edge's end, or the one around it."""
        return _inside_of(edge) if edge.startswith(":") else net.edges[edge].end if edge in net.edges else ""

    links = [link for link in root.iter("connection") if at(link.attrib["from"]) in whole]
    lights = {link.get("tl") for link in links}
    out = ET.Element(root.tag, root.attrib)
    out.extend([_alone(child) for child in root if child.tag in ("location", "type")])
    for edge in root.iter("edge"):
        id_ = edge.attrib["id"]
        if _inside_of(id_) in whole if id_.startswith(":") else id_ in edges:
            out.append(_with(edge, "lane"))
    # Of several programmes with one name, SUMO runs the last.
    programmes = {light.attrib["id"]: light for light in root.iter("tlLogic") if light.get("id") in lights}
    out.extend(map(_fixed, programmes.values()))
    for junction in root.iter("junction"):
        id_ = junction.attrib["id"]
        if (_inside_of(_inside_of(id_), "") if id_.startswith(":") else id_) in whole:
            out.append(_with(junction, "request"))
        elif id_ in touched:
            out.append(_dead_end(junction, edges))
    out.extend(map(_alone, links))
    out.extend(_alone(r) for r in root.iter("roundabout") if set(r.get("edges", "").split()) <= edges)
    return ET.tostring(out, encoding="unicode").encode()


def _inside_of(id_: str, colon: str = ":") -> str:
    """Returns the surrounding junction, such as "J" of ":J_3" or ":J_w0"."""
    return id_.removeprefix(colon).rpartition("_")[0]


def _alone(element: ET.Element) -> ET.Element:
    """The element without its children, which may name what is cut off."""
    return ET.Element(element.tag, element.attrib)


def _with(element: ET.Element, inside: str) -> ET.Element:
    """The element with its children of one kind alone."""
    out = _alone(element)
    out.extend(map(_alone, element.iter(inside)))
    return out


def _fixed(light: ET.Element) -> ET.Element:
    fixed = _with(light, "phase")
    fixed.set("type", "static")
    return fixed


def _dead_end(junction: ET.Element, edges: Set[str]) -> ET.Element:
    arriving = [lane for lane in junction.get("incLanes", "").split() if lane.rpartition("_")[0] in edges]
    kept = {name: junction.attrib[name] for name in ("id", "x", "y", "shape") if name in junction.attrib}
    return ET.Element("junction", kept | {"type": "dead_end", "incLanes": " ".join(arriving), "intLanes": ""})
