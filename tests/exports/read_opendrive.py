"""Independent reader of OpenDRIVE: the middles of all lanes, with heights."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np


def along(rows: Sequence[ET.Element], s: float, key: str = "s") -> float:
    """The value of a piecewise polynomial; 0 without one."""
    found = [row for row in rows if float(row.attrib[key]) <= s + 1e-9]
    if not found:
        return 0.0
    ds = s - float(found[-1].attrib[key])
    return sum(float(found[-1].attrib[name]) * ds**power for power, name in enumerate("abcd"))


def reference(road: ET.Element, s: float) -> tuple[float, float, float]:
    """x, y and heading of a road's reference line."""
    piece = [each for each in road.iter("geometry") if float(each.attrib["s"]) <= s + 1e-9][-1]
    x, y, heading, length = (float(piece.attrib[name]) for name in ("x", "y", "hdg", "length"))
    p, u, v, turn = min(s - float(piece.attrib["s"]), length) / length, 0.0, 0.0, 0.0
    cubic = piece.find("paramPoly3")
    if cubic is None:
        u = p * length
    else:
        assert cubic.get("pRange") == "normalized"
        of_u, of_v = ([float(cubic.attrib[f"{name}{axis}"]) for name in "abcd"] for axis in "UV")
        u, v = (sum(c * p**power for power, c in enumerate(each)) for each in (of_u, of_v))
        slopes = [sum(power * c * p ** (power - 1) for power, c in enumerate(each) if power) for each in (of_u, of_v)]
        turn = np.arctan2(slopes[1], slopes[0])
    cos, sin = np.cos(heading), np.sin(heading)
    return x + u * cos - v * sin, y + u * sin + v * cos, heading + turn


def middles(root: ET.Element, step_m: float = 0.2) -> list[np.ndarray]:
    """Returns lanes' middles, right of each road's reference line, `k x 3`."""
    found = []
    for road in root.iter("road"):
        length, lanes = float(road.attrib["length"]), list(road.iterfind("lanes/laneSection/right/lane"))
        offsets, heights = list(road.iter("laneOffset")), list(road.iter("elevation"))
        rows: list[list[tuple[float, float, float]]] = [[] for _ in lanes]
        for s in np.append(np.arange(0.0, length, step_m), length):
            x, y, heading = reference(road, s)
            t = along(offsets, s)
            for row, lane in zip(rows, lanes, strict=True):
                width = along(list(lane.iter("width")), s, "sOffset")
                t -= width
                middle = t + width / 2
                row.append((x - middle * np.sin(heading), y + middle * np.cos(heading), along(heights, s)))
        found += [np.array(row) for row in rows]
    return found


def dangling(root: ET.Element) -> list[dict[str, str]]:
    """Links, connections and lane links to what is not there."""
    roads = {road.attrib["id"]: road for road in root.iter("road")}
    junctions = {junction.get("id") for junction in root.iter("junction")}
    ids = {"road": roads.keys(), "junction": junctions}
    wrong = [
        each.attrib
        for road in roads.values()
        for each in road.iterfind("link/*")
        if each.get("elementId") not in ids[each.attrib["elementType"]]
    ]
    for connection in root.iter("connection"):
        ends = [roads.get(connection.attrib[name]) for name in ("incomingRoad", "connectingRoad")]
        link = connection.find("laneLink")
        for road, end in zip(ends, ("from", "to"), strict=True):
            lanes = set() if road is None else {lane.get("id") for lane in road.iter("lane")}
            if link is None or link.get(end) not in lanes:
                wrong.append(connection.attrib)
    return wrong + [road.attrib for road in roads.values() if road.attrib["junction"] not in {"-1", *junctions}]
