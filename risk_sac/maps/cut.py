"""Cuts the piece around a place out of a net."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Set

from risk_sac.maps.found import Fit
from risk_sac.maps.ways import edges_on
from risk_sac.world.net import Net

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
