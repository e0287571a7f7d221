"""Finds the places of a map, and keeps them as scenarios."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Iterator, Sequence, Set
from pathlib import Path
from types import ModuleType

from risk_sac.errors import MapError
from risk_sac.maps import find_crossing, find_junction, find_stretch
from risk_sac.maps.found import Fit, Misfit, NoFit, Pattern, Spot, Survey
from risk_sac.maps.scenarios import NET
from risk_sac.maps.ways import check_lengths, edges_on
from risk_sac.scenario import library
from risk_sac.world.net import Net
from risk_sac.world.read_net import read_net, read_tree

FINDERS: dict[Pattern, ModuleType] = {
    "car_following": find_stretch,
    "crossing": find_crossing,
    "junction": find_junction,
}
CANDIDATES: dict[Pattern, str] = {  # what their spots are
    "car_following": f"road for cars of {find_stretch.SHORTEST_M:g} m or more",
    "crossing": "road for cars that ends at a crossing",
    "junction": "road to a junction that another one leads to as well",
}


def survey(
    net: Net, patterns: Collection[Pattern] = tuple(FINDERS), tell: Callable[[float], None] = lambda share: None
) -> Survey:
    """All places where patterns fit, and why elsewhere they do not.

    Args:
      net: where.
      patterns: which.
      tell: called with the share of spots that was looked at.
    """
    fits, misfits = [], []
    spots = list(_spots(net, patterns))
    for number, spot in enumerate(spots):
        tell(number / len(spots))
        try:
            fits.append(_fit(net, spot))
        except NoFit as error:
            misfits.append(Misfit(spot, str(error)))
    found = {spot.pattern for spot in spots}
    nowhere = {pattern: _no_spot(net, pattern) for pattern in patterns if pattern not in found}
    return Survey(tuple(fits), tuple(misfits), nowhere)


def place_at(net: Net, pattern: Pattern, id_: str) -> Fit:
    """Makes the place of a pattern at a spot.

    Raises:
      MapError: the map has no such spot, or the pattern does not fit there.
    """
    spot = next((spot for spot in _spots(net, (pattern,)) if spot.id == id_), None)
    if spot is None:
        raise MapError("place", _nowhere(net, pattern, id_))
    try:
        return _fit(net, spot)
    except NoFit as error:
        raise MapError("place", f"{pattern} does not fit at {id_!r}: {error}") from error


def _spots(net: Net, patterns: Collection[Pattern]) -> Iterator[Spot]:
    for pattern in patterns:
        yield from FINDERS[pattern].spots(net)


def _fit(net: Net, spot: Spot) -> Fit:
    """Makes the place of a spot; raises `NoFit` where there is none."""
    fit: Fit = FINDERS[spot.pattern].fit(net, spot)
    check_lengths(net, fit.tracks)
    return fit


def _no_spot(net: Net, pattern: Pattern) -> str:
    if pattern == "crossing" and not net.crossings:
        return "the net has no crossing; netconvert drops those that join no sidewalks, and warns of it"
    return f"the net has no {CANDIDATES[pattern]}"


def _nowhere(net: Net, pattern: Pattern, id_: str) -> str:
    if id_ not in net.edges:
        return f"the map has no edge {id_!r}; a place is named by the edge that leads to it, or on which it is"
    return f"{pattern} does not fit at {id_!r}: wanted a {CANDIDATES[pattern]}"


class Map:
    """A net, read once."""

    def __init__(self, file: Path) -> None:
        """Reads it; raises `MapError` if no pattern could be placed on it."""
        self._root = read_tree(file)
        self.net: Net = read_net(file, self._root)

    def fits(self, pattern: Pattern, place: str | None) -> Sequence[Fit]:
        """Makes one place, or all places that a pattern fits.

        Raises:
          MapError: it does not fit at the one, or nowhere.
        """
        if place is not None:
            return [place_at(self.net, pattern, place)]
        places = survey(self.net, (pattern,))
        if not places.fits:
            why = places.nowhere.get(pattern) or f"at {places.misfits[0].spot.id!r}, {places.misfits[0].why}"
            raise MapError("places", f"{pattern} fits nowhere on this map: {why}")
        return places.fits

    def keep(self, fit: Fit) -> str:
        """Puts a place into the library; returns the name of its family."""
        return library.keep(fit.scenario, {NET: cut(self.net, self._root, fit)})


AROUND_M = 100.0  # unused roads up to this far from a place stay: a picture shows them


def cut(net: Net, root: ET.Element, fit: Fit) -> bytes:
    """The file of the piece around a place; `root` stays as it is."""
    driven = edges_on(*fit.tracks)
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
        """The junction at the end of an edge, or the one that it is inside of."""
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
    """The junction that something is inside of, such as "J" of ":J_3" or ":J_w0"."""
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
