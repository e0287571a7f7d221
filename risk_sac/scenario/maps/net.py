"""A SUMO net as the finders need it: lanes, how they lead on, and right of way.

The file has to be in the present format, as netconvert writes it.
Source: https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html
"""

import math
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.scenario.ground import Point

DRIVER = "passenger"  # the class of every vehicle of ours
TURNAROUND = "t"
STOP = "rRyYu"  # red, yellow, and red with yellow: of the colours of a signal, those that let nobody go
DEFAULT_WIDTH_M = 3.2
LEAST_LIMIT_MPS = 0.01  # of a closed lane, so that driving it takes a finite time
FARTHEST = 1e8  # m; the Earth's circumference is 4e7
LONGEST_NAME = 200
REPAIR = "run netconvert over it, or save it with netedit"


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """A lane, also one inside a junction."""

    id: str
    edge: str
    index: int
    length_m: float
    width_m: float
    limit_mps: float
    line: tuple[Point, ...]
    drivable: bool

    @property
    def way_in_rad(self) -> float:
        """Direction in which it begins."""
        return _direction(self.line[0], self.line[1])

    @property
    def way_out_rad(self) -> float:
        """Direction in which it ends."""
        return _direction(self.line[-2], self.line[-1])


@dataclass(frozen=True, eq=False)
class Edge:
    """A road in one direction; those inside junctions are kept by their lanes alone."""

    id: str
    start: str  # junctions
    end: str
    lanes: tuple[Lane, ...]

    @cached_property
    def drivable(self) -> tuple[Lane, ...]:
        """Its lanes for cars, from right to left."""
        return tuple(lane for lane in self.lanes if lane.drivable)


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """How a lane leads on to another, across a junction."""

    source: Lane
    target: Lane
    inside: tuple[Lane, ...]  # the lanes between them
    signal: str | None
    index: int | None  # among the links of its junction

    @property
    def inside_m(self) -> float:
        """Length of the way across the junction."""
        return sum(lane.length_m for lane in self.inside)

    @property
    def turn_rad(self) -> float:
        """How far it turns to the left."""
        return math.remainder(self.target.way_in_rad - self.source.way_out_rad, math.tau)


@dataclass(frozen=True, slots=True, eq=False)
class Junction:
    """A junction that is not one inside another."""

    id: str
    type: str
    x_m: float
    y_m: float
    outline: tuple[Point, ...]
    foes: Mapping[int, str]  # of each link by its index: SUMO's row of bits, the last is link 0


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """A pedestrian crossing."""

    id: str
    junction: str
    edges: tuple[str, ...]  # that it crosses
    line: tuple[Point, ...]
    width_m: float
    signal: str | None


@dataclass(eq=False)
class Net:
    """All of it; edges, junctions and crossings by id."""

    edges: dict[str, Edge] = field(default_factory=dict)
    junctions: dict[str, Junction] = field(default_factory=dict)
    crossings: list[Crossing] = field(default_factory=list)
    onward: dict[str, list[Link]] = field(default_factory=lambda: defaultdict(list))  # by the lane they come from
    back: dict[str, list[Link]] = field(default_factory=lambda: defaultdict(list))  # by the lane they lead to
    cycles_s: dict[str, float] = field(default_factory=dict)  # of the signals
    inside: dict[str, list[Lane]] = field(default_factory=lambda: defaultdict(list))  # drivable, by junction
    # Inside junctions, by a lane's id: the lanes that vehicles wait for before they drive onto it.
    waits_for: dict[str, tuple[Lane, ...]] = field(default_factory=dict)
    keeps_left: bool = False

    @cached_property
    def arriving(self) -> Mapping[str, list[Edge]]:
        """Edges with a lane for cars, by the junction at their end."""
        found = defaultdict(list)
        for edge in self.edges.values():
            if edge.drivable:
                found[edge.end].append(edge)
        return found

    @cached_property
    def crossings_of(self) -> Mapping[tuple[str, str], list[Crossing]]:
        """By junction and by an edge that they cross."""
        found = defaultdict(list)
        for crossing in self.crossings:
            for edge in crossing.edges:
                found[crossing.junction, edge].append(crossing)
        return found

    def are_foes(self, one: Link, other: Link) -> bool:
        """Whether two links of a junction cross or meet, by what the net says."""
        if one.index is None or other.index is None:
            return False
        foes = self.junctions[self.edges[one.source.edge].end].foes
        pairs = ((one.index, other.index), (other.index, one.index))
        return any(foes.get(row, "")[::-1][column : column + 1] == "1" for row, column in pairs)

    def lane(self, id_: str) -> Lane:
        """A lane outside junctions."""
        edge, _, index = id_.rpartition("_")
        lanes = self.edges[edge].lanes
        if not 0 <= int(index) < len(lanes):
            raise ValueError(f"a connection names lane {index} of edge {edge!r}, which has {len(lanes)}")
        return lanes[int(index)]


def read_tree(path: Path) -> ET.Element:
    """Reads the XML of a net that we or netconvert have written; raises `MapError` if it is none."""
    try:
        return ET.parse(path).getroot()
    except ET.ParseError as error:
        raise MapError("network", f"the net is no XML: {error}") from error


def read_net(path: Path, root: ET.Element | None = None) -> Net:
    """Reads a net, or takes its XML from `root`; raises `MapError` if no place could be found on it."""
    net = parse_net(read_tree(path) if root is None else root)
    if net.keeps_left:
        raise MapError("network", 'left-hand traffic (lefthand="true")', "right-hand traffic")
    if not any(edge.drivable for edge in net.edges.values()):
        raise MapError("network", f"none of the {len(net.edges)} edges of the map has a lane for passenger cars")
    return net


def parse_net(root: ET.Element) -> Net:
    """Reads the XML of any net; raises `MapError` if it is none of the present format."""
    if root.tag != "net":
        raise MapError("network", f"a file with the root <{root.tag}>", "<net>", "convert it first")
    try:
        return _net(root)
    except KeyError as error:
        raise MapError("network", f"the net lacks {error}, or names it and does not have it", remedy=REPAIR) from error
    except (ValueError, IndexError) as error:
        raise MapError("network", f"the net is broken: {error}", remedy=REPAIR) from error


def _net(root: ET.Element) -> Net:
    net = Net(keeps_left=root.get("lefthand", "false").lower() in ("true", "1"))
    inner = dict[str, Lane]()
    crossings = []
    for edge in root.iter("edge"):
        function = edge.get("function", "normal")
        lanes = tuple(_lane(edge.attrib["id"], i, lane.attrib) for i, lane in enumerate(edge.iter("lane")))
        if function == "internal":
            inner |= {lane.id: lane for lane in lanes}
            net.inside[edge.attrib["id"].rpartition("_")[0][1:]] += [lane for lane in lanes if lane.drivable]
        elif function == "crossing" and lanes:
            crossings.append((edge, lanes[0]))
        elif function == "normal":
            net.edges[edge.attrib["id"]] = _edge(edge, lanes)
    index_of: dict[str, int] = {}
    for junction in root.iter("junction"):
        if junction.get("type") == "internal":
            foes = [inner[lane] for lane in junction.get("intLanes", "").split() if lane in inner]
            net.waits_for[junction.attrib["id"]] = tuple(lane for lane in foes if lane.drivable)
        else:
            net.junctions[junction.attrib["id"]] = _junction(junction)
            index_of |= {lane: i for i, lane in enumerate(junction.get("intLanes", "").split())}
    states: dict[str, list[str]] = {}
    for light in root.iter("tlLogic"):  # of several programmes, SUMO runs the last
        phases = list(light.iter("phase"))
        states[light.attrib["id"]] = [phase.attrib["state"] for phase in phases]
        net.cycles_s[light.attrib["id"]] = sum(_number(phase.attrib["duration"]) for phase in phases)
    lights = _link(net, root, inner, index_of, states)
    for edge, lane in crossings:
        id_ = edge.attrib["id"]
        at = id_.rpartition("_")[0][1:]
        net.crossings.append(
            Crossing(id_, at, tuple(edge.get("crossingEdges", "").split()), lane.line, lane.width_m, lights.get(id_))
        )
    return net


def _link(
    net: Net,
    root: ET.Element,
    inner: Mapping[str, Lane],
    index_of: Mapping[str, int],
    states: Mapping[str, Sequence[str]],
) -> dict[str, str]:
    """Notes how lanes lead on, unless a signal never lets anybody go there; returns the signal of each crossing."""
    lights, follows, outer = dict[str, str](), dict[str, str](), []
    for c in root.iter("connection"):
        a, source = c.attrib, f"{c.attrib['from']}_{c.attrib['fromLane']}"
        if source in inner:
            follows[source] = a.get("via", "")
        elif a["from"] in net.edges and a["to"] in net.edges:
            outer.append((a, source))
        elif "tl" in a:
            lights[a["to"]] = a["tl"]
    for a, source in outer:
        one, other = net.lane(source), net.lane(f"{a['to']}_{a['toLane']}")
        if a.get("dir") == TURNAROUND or not (one.drivable and other.drivable) or _is_closed(a, states):
            continue
        inside, via = [], a.get("via", "")
        while via in inner and via not in inside:
            inside.append(via)
            via = follows.get(via, "")
        index = next((index_of[lane] for lane in inside if lane in index_of), None)
        link = Link(one, other, tuple(inner[lane] for lane in inside), a.get("tl"), index)
        net.onward[one.id].append(link)
        net.back[other.id].append(link)
    return lights


def _is_closed(connection: Mapping[str, str], states: Mapping[str, Sequence[str]]) -> bool:
    """Whether its signal stays red: such programmes are made for somebody to switch between."""
    phases = states.get(connection.get("tl", ""), ())
    return bool(phases) and all(state[int(connection["linkIndex"])] in STOP for state in phases)


def _edge(edge: ET.Element, lanes: tuple[Lane, ...]) -> Edge:
    id_ = edge.attrib["id"]
    if len(id_) > LONGEST_NAME or not lanes:
        got = f"edge {id_[:60]!r} has {len(lanes)} lanes and an id of {len(id_)} characters"
        raise ValueError(f"{got}; wanted one lane or more, and at most {LONGEST_NAME} characters")
    return Edge(id_, edge.attrib["from"], edge.attrib["to"], lanes)


def _lane(edge: str, index: int, a: Mapping[str, str]) -> Lane:
    line = _line(a["shape"])
    if not line:
        raise ValueError(f"lane {a['id']!r} has no shape")
    return Lane(
        id=a["id"],
        edge=edge,
        index=index,  # as SUMO has it, whatever the file says
        length_m=_positive(a["length"]),
        width_m=_positive(a.get("width", DEFAULT_WIDTH_M)),
        limit_mps=max(_number(a["speed"]), LEAST_LIMIT_MPS),
        line=line if len(line) > 1 else (line[0], (line[0][0] + 1e-3, line[0][1])),
        drivable=_admits(a.get("allow"), a.get("disallow")),
    )


def _admits(allow: str | None, disallow: str | None) -> bool:
    if allow is not None:
        return bool({DRIVER, "all"} & set(allow.split()))
    return not {DRIVER, "all"} & set((disallow or "").split())


def _junction(junction: ET.Element) -> Junction:
    a = junction.attrib
    foes = {int(request.attrib["index"]): request.attrib["foes"] for request in junction.iter("request")}
    return Junction(a["id"], a.get("type", ""), _number(a["x"]), _number(a["y"]), _line(a.get("shape", "")), foes)


def _line(shape: str) -> tuple[Point, ...]:
    points = [[_number(each) for each in point.split(",")] for point in shape.split()]
    if any(len(point) not in (2, 3) for point in points):
        raise ValueError(f"{shape[:60]!r} is no shape; wanted points x,y or x,y,z")
    return tuple((x, y) for x, y, *_ in points)


def _number(text: str | float) -> float:
    number = float(text)
    if not abs(number) <= FARTHEST:
        raise ValueError(f"{text!r} is no number within ±{FARTHEST:g}")
    return number


def _positive(text: str | float) -> float:
    if (number := _number(text)) <= 0.0:
        raise ValueError(f"{text!r} is no size above 0")
    return number


def _direction(a: Point, b: Point) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])
