"""Makes crossings of an OpenDRIVE map's crosswalks, which netconvert does not read.

netconvert builds crossings that it is told of, where there are sidewalks. So the roads get sidewalks, a lane section
begins at a crosswalk amid a road, and a first conversion tells the names of edges and junctions there.
Source: https://sumo.dlr.de/docs/Networks/PlainXML.html#pedestrian_crossings
"""

import math
import shutil
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.scenario.maps.net import Edge, Net

NEAR_M = 15.0  # so near the end of a road, a crosswalk is that of the junction there
SIDEWALK_M = 2.0
START, END = 0.0, math.inf
_TYPES = ("opendriveNetconvert.typ.xml", "opendriveNetconvertPedestrians.typ.xml")


@dataclass(frozen=True, slots=True)
class Crosswalks:
    """Crosswalks of a map, and the roads that get sidewalks for them."""

    at: Mapping[str, Set[float]]  # by road: m from its start, or `START` and `END` at the junctions
    roads: Set[str]

    @property
    def count(self) -> int:
        """Their number; those at the same end of a road are one."""
        return sum(map(len, self.at.values()))


def find_crosswalks(file: Path) -> Crosswalks:
    """Finds the crosswalks of a map; one inside a junction is that of the road that it is nearer to.

    Raises:
      MapError: one lacks its place.
    """
    at, links = defaultdict[str, set[float]](set), dict[str, set[tuple[str, str]]]()
    for _, road in ET.iterparse(file):
        if road.tag == "road":
            id_ = road.get("id", "")
            try:
                for beside, s_m in _of(road):
                    at[beside].add(s_m)
            except (KeyError, ValueError) as error:
                got = f"a crosswalk of road {id_[:80]!r} with a missing or broken attribute: {error}"
                raise MapError("network", got, "what OpenDRIVE requires") from error
            if road.get("junction", "-1") == "-1":
                ends = road.findall("link/predecessor") + road.findall("link/successor")
                links[id_] = {(end.get("elementType", ""), end.get("elementId", "")) for end in ends}
            road.clear()
    meeting = {link for id_ in at for link in links.get(id_, ())}
    junctions = {link for link in meeting if link[0] == "junction"}
    roads = {id_ for id_, own in links.items() if id_ in at or ("road", id_) in meeting or own & junctions}
    return Crosswalks(at, roads)


def _of(road: ET.Element) -> Iterator[tuple[str, float]]:
    for walk in road.iter("object"):
        if walk.get("type", "").lower() != "crosswalk":
            continue
        id_, s, length_m = road.attrib["id"], float(walk.attrib["s"]), float(road.attrib["length"])
        if road.get("junction", "-1") == "-1":
            yield id_, START if s < NEAR_M else END if s > length_m - NEAR_M else round(s, 2)
        elif (beside := road.find("link/predecessor" if s < length_m / 2 else "link/successor")) is not None:
            yield beside.get("elementId", ""), END if beside.get("contactPoint") == "end" else START
        else:
            yield id_, START


def add_sidewalks(section: ET.Element) -> None:
    """Adds sidewalks to a lane section where it has none; lanes stay in order from left to right."""
    for name, step in (("left", 1), ("right", -1)):
        side = section.find(name)
        lanes = [] if side is None else side.findall("lane")
        if side is None or not lanes or any(lane.get("type") == "sidewalk" for lane in lanes):
            continue
        outermost = max((int(lane.attrib["id"]) for lane in lanes), key=abs)
        sidewalk = ET.Element("lane", id=str(outermost + step), type="sidewalk")
        ET.SubElement(sidewalk, "width", sOffset="0", a=str(SIDEWALK_M), b="0", c="0", d="0")
        side.insert(0 if name == "left" else len(side), sidewalk)


def sidewalk_options(types: Path, folder: Path) -> list[str]:
    """Options of netconvert for sidewalks, and for edges named after where they begin.

    Args:
      types: the folder of SUMO's types.
      folder: that netconvert runs in; a comma in a path would make a list.
    """
    for name in _TYPES:
        shutil.copyfile(types / name, folder / name)
    return ["--type-files", ",".join(_TYPES), "--opendrive.position-ids"]


def crossing_options(walks: Crosswalks, net: Net, folder: Path) -> list[str]:
    """Options of netconvert for crossings, with the names of a net that it has made of the same roads."""
    starts = defaultdict[str, set[str]](set)  # where edges begin, by their road
    for id_ in net.edges:
        road, *start = id_.removeprefix("-").rsplit(".", 2)
        starts[road].add(".".join(start))
    told = dict[tuple[str, str], None]()  # junction and edges of each crossing
    for road, s_m in [(road, s_m) for road, places in walks.at.items() for s_m in sorted(places)]:
        if not (begins := sorted(starts[road], key=float)):
            continue
        before = begins[0 if s_m == START else -1]
        if s_m not in (START, END) and len(begins) > 1:
            _, before = min((abs(float(end) - s_m), begin) for begin, end in pairwise(begins))
        right, left = (net.edges.get(f"{sign}{road}.{before}") for sign in ("-", ""))
        node = _ends(right, left)[s_m != START]
        if net.junctions[node].type != "dead_end":
            told[node, " ".join(edge.id for edge in (right, left) if edge is not None)] = None
    root = ET.Element("connections")
    for node, edges in told:
        ET.SubElement(root, "crossing", node=node, edges=edges, priority="true")
    ET.ElementTree(root).write(folder / "crossings.con.xml")
    (folder / "kept.txt").write_text("\n".join(edge for _, edges in told for edge in edges.split()))
    return ["--connection-files", "crossings.con.xml", "--geometry.remove.keep-edges.input-file", "kept.txt"]


def _ends(right: Edge | None, left: Edge | None) -> tuple[str, str]:
    """Junctions where a road begins and ends, of which one direction at least is there."""
    if right is not None:
        return right.start, right.end
    assert left is not None
    return left.end, left.start
