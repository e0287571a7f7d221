"""Rewrites OpenDRIVE roads that netconvert would drop or draw wrongly.

netconvert reads limits in lanes alone, mixes up lanes where a limit changes within a lane section, and draws a spiral
of constant curvature as its chord. What it does not read at all is counted.
Source: ASAM OpenDRIVE 1.7: geometry of the reference line, road type, speed limits of lanes, lane sections
"""

import math
import shutil
import xml.etree.ElementTree as ET
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.world.net import Edge, Net

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
    """Finds crosswalks with their nearest roads; raises `MapError` for unplaced ones."""
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
    """Adds missing sidewalks to a lane section; lanes stay left to right."""
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
    """Returns netconvert's options for sidewalks and for edges named by their begin.

    The types are copied into the folder that netconvert runs in, for a comma in a path would make a list.
    """
    for name in _TYPES:
        shutil.copyfile(types / name, folder / name)
    return ["--type-files", ",".join(_TYPES), "--opendrive.position-ids"]


def crossing_options(walks: Crosswalks, net: Net, folder: Path) -> list[str]:
    """Returns netconvert's options for crossings, by a net of the same roads."""
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
    """Returns a road's first and last junctions from one or both directions."""
    if right is not None:
        return right.start, right.end
    assert left is not None
    return left.end, left.start


LARGEST_SHIFT_M = 0.01  # by which an arc may leave its spiral, and a line its arc
LEAST_PIECE_M = 1.0  # of a road between two limits
NO_LIMIT_MPS = 142.0 / 3.6  # what netconvert takes for "none" in OpenStreetMap
UNITS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
CAR_LANES = ("driving", "stop", "entry", "exit", "onRamp", "offRamp", "mwyEntry", "mwyExit", "bidirectional")
LOST_LANES = ("connectingRamp", "slipLane", "HOV")  # for cars, too
READ_SIGNALS = {"205", "301", "306"} | {str(i) for i in (*range(1000001, 1000014), 1000020) if i != 1000008}

UNLIMITED = "roads without a limit"
Limits = Sequence[tuple[float, float | None]]  # m at which one begins, and m/s; sorted


def ready(file: Path, target: Path, walks: Crosswalks) -> list[str]:
    """Writes a map for netconvert; returns remarks on its gaps and losses.

    Lane sections begin at the crosswalks, and their roads get sidewalks.

    Raises:
      MapError: netconvert could not read it.
    """
    lost, depth = Counter[str](), 0
    with target.open("wb") as output:
        output.write(b"<OpenDRIVE>\n")
        for event, element in ET.iterparse(file, ("start", "end")):
            depth += 1 if event == "start" else -1
            if depth == 1 and event == "end":
                if element.tag == "road":
                    _repair(element, walks, lost)
                elif element.tag == "junction":
                    _check(element, lost)
                output.write(ET.tostring(element))
                element.clear()
        output.write(b"</OpenDRIVE>\n")
    unlimited = lost.pop(UNLIMITED, 0)
    listed = ", ".join(f"{what} ({count})" for what, count in (+lost).most_common())
    remarks = [f"roads without a speed limit, for which netconvert's default holds: {unlimited}"] if unlimited else []
    return [*remarks, f"left out, because netconvert does not read them: {listed}"] if listed else remarks


def _check(junction: ET.Element, lost: Counter[str]) -> None:
    if (kind := junction.get("type")) == "direct":
        got = f"junction {junction.get('id', '?')[:80]!r} of type direct, which netconvert does not read"
        raise MapError("network", got, "junctions with connecting roads")
    lost["virtual junctions"] += kind == "virtual"


def _repair(road: ET.Element, walks: Crosswalks, lost: Counter[str]) -> None:
    try:
        for geometry in road.iterfind("planView/geometry"):
            _draw(geometry)
        if road.get("id") in walks.roads:
            for section in road.iterfind("lanes/laneSection"):
                add_sidewalks(section)
        _cut(road, walks.at.get(road.get("id", ""), set()), lost)
    except (KeyError, ValueError) as error:
        got = f"road {road.get('id', '?')[:80]!r} with a missing or broken attribute: {error}"
        raise MapError("network", got, "what OpenDRIVE requires") from error
    lost["signals and signs"] += sum(found.get("type") not in READ_SIGNALS for found in road.iter("signal"))
    lost.update(f"lanes of type {kind}" for lane in road.iter("lane") if (kind := lane.get("type")) in LOST_LANES)


def _draw(geometry: ET.Element) -> None:
    """Replaces nearly constant spirals by arcs, and nearly straight arcs by lines.

    Lines that begin alike are at most ∫ |Δθ| apart, where Δθ(s) is the difference of their headings:
    |κ₁ - κ₀| L² / 12 for a spiral and the arc of its mean curvature, |κ| L² / 2 for an arc and a line.
    """
    length_m = float(geometry.attrib["length"])
    if (shape := geometry.find("spiral")) is not None:
        start, end = float(shape.attrib["curvStart"]), float(shape.attrib["curvEnd"])
        if abs(end - start) * length_m**2 / 12 > LARGEST_SHIFT_M:
            return
        curvature = (start + end) / 2
    elif (shape := geometry.find("arc")) is not None:
        curvature = float(shape.attrib["curvature"])
    else:
        return
    is_line = abs(curvature) * length_m**2 / 2 <= LARGEST_SHIFT_M
    shape.tag, shape.attrib = ("line", {}) if is_line else ("arc", {"curvature": repr(curvature)})


def _cut(road: ET.Element, cuts: Set[float], lost: Counter[str]) -> None:
    """Writes limits into lanes; begins lane sections at changes and cuts."""
    types = _sorted((float(kind.attrib["s"]), _of_type(kind, lost)) for kind in road.iterfind("type"))
    lanes = road.find("lanes")
    sections = [] if lanes is None else lanes.findall("laneSection")
    starts = [float(section.attrib["s"]) for section in sections]
    unlimited = False
    for section, (start, end) in zip(sections, pairwise([*starts, float(road.attrib["length"])]), strict=True):
        here = [(s - start, mps) for s, mps in types], {s - start for s in cuts}, end - start
        pieces = _pieces(section, *here, lost)
        copies = [section, *(deepcopy(section) for _ in pieces[1:])]
        for i, (copy, (begin, limits)) in enumerate(zip(copies, pieces, strict=True)):
            for lane, mps in zip(copy.iterfind("*/lane"), limits, strict=True):
                unlimited |= mps is None and lane.get("type") in CAR_LANES
                for speed in lane.findall("speed"):
                    lane.remove(speed)
                if mps is not None:
                    ET.SubElement(lane, "speed", sOffset="0", max=repr(mps), unit="m/s")
                if i > 0:
                    _begin_at(begin, lane)
                    _link(lane, "predecessor")
                if i < len(copies) - 1:
                    _link(lane, "successor")
            if lanes is not None and i > 0:
                copy.set("s", repr(start + begin))
                lanes.insert(list(lanes).index(copies[i - 1]) + 1, copy)
    lost[UNLIMITED] += unlimited and road.get("junction", "-1") == "-1"


def _of_type(kind: ET.Element, lost: Counter[str]) -> float | None:
    """Returns a road type's limit; motorways without one have no limit."""
    speed = kind.find("speed")
    return NO_LIMIT_MPS if speed is None and kind.get("type") == "motorway" else _mps(speed, lost)


def _pieces(
    section: ET.Element, types: Limits, cuts: Set[float], length_m: float, lost: Counter[str]
) -> list[tuple[float, list[float | None]]]:
    """Returns a section's cuts, m, and each lane's limit after them.

    A lane's own limit is ahead of the road's.
    """
    lanes = section.findall("*/lane")
    own = [_sorted((float(s.attrib["sOffset"]), _mps(s, lost)) for s in lane.iterfind("speed")) for lane in lanes]
    begins = [0.0]
    for change in sorted({begin for limits in (types, *own) for begin, _ in limits} | cuts):
        if begins[-1] + LEAST_PIECE_M <= change <= length_m - LEAST_PIECE_M:
            begins.append(change)
    pieces: list[tuple[float, list[float | None]]] = []
    for begin, end in pairwise([*begins, length_m]):
        middle = (begin + end) / 2
        here = [
            _at(middle, limits) or (_at(middle, types) if lane.get("type") in CAR_LANES else None)
            for lane, limits in zip(lanes, own, strict=True)
        ]
        if not pieces or begin in cuts or here != pieces[-1][1]:
            pieces.append((begin, here))
    return pieces


def _sorted(limits: Iterable[tuple[float, float | None]]) -> Limits:
    return sorted(limits, key=itemgetter(0))


def _at(s: float, limits: Limits) -> float | None:
    i = bisect_right(limits, s, key=itemgetter(0))
    return limits[i - 1][1] if i else None


def _begin_at(begin: float, lane: ET.Element) -> None:
    """Moves a lane's width polynomials to its new beginning."""
    before = None
    for width in lane.findall("width"):
        s = float(width.attrib["sOffset"]) - begin
        width.set("sOffset", repr(max(s, 0.0)))
        if s <= 0.0:
            a, b, c, d = (float(width.attrib[name]) for name in "abcd")
            moved = (a - s * (b - s * (c - s * d)), b - s * (2 * c - s * 3 * d), c - s * 3 * d, d)
            width.attrib |= zip("abcd", map(repr, moved), strict=True)
            if before is not None:
                lane.remove(before)
            before = width


def _link(lane: ET.Element, way: str) -> None:
    """Links a lane to itself in the piece before or after."""
    link = lane.find("link")
    if link is None:
        link = ET.SubElement(lane, "link")
    for known in link.findall(way):
        link.remove(known)
    ET.SubElement(link, way, id=lane.attrib["id"])


def _mps(speed: ET.Element | None, lost: Counter[str]) -> float | None:
    """The limit, m/s, or None where none is known."""
    if speed is None or (largest := speed.get("max", "undefined")) == "undefined":
        return None
    if largest == "no limit":
        return NO_LIMIT_MPS
    try:
        mps = float(largest) * UNITS[speed.get("unit") or "m/s"]
    except (KeyError, ValueError):
        mps = math.nan
    if 0.0 < mps < math.inf:
        return mps
    lost["limits that are no speed"] += 1
    return None
