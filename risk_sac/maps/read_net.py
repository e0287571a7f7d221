"""Reads SUMO nets of the present format, as netconvert writes them.

Source: https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.maps.net import Crossing, Edge, Junction, Link, Net, NetLane
from risk_sac.scenario.layout import Point

DRIVER = "passenger"  # the class of every vehicle of ours
TURNAROUND = "t"
STOP = "rRyYu"  # red, yellow, and red with yellow: the colours that stop all traffic
DEFAULT_WIDTH_M = 3.2
LEAST_LIMIT_MPS = 0.01  # of a closed lane, so that driving it takes a finite time
FARTHEST = 1e8  # m; the Earth's circumference is 4e7
LONGEST_NAME = 200
REPAIR = "run netconvert over it, or save it with netedit"


def read_tree(path: Path) -> ET.Element:
    """Reads the XML of a net that we or netconvert have written; raises `MapError` if it is none."""
    try:
        return ET.parse(path).getroot()
    except ET.ParseError as error:
        raise MapError("network", f"the net is no XML: {error}") from error


def read_net(path: Path, root: ET.Element | None = None) -> Net:
    """Reads a net from a file or from its XML `root`.

    Raises:
      MapError: no place could be found on it.
    """
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
    inner = dict[str, NetLane]()
    crossings = []
    for edge in root.iter("edge"):
        function = edge.get("function", "normal")
        lanes = tuple(_lane(edge.attrib["id"], i, lane.attrib) for i, lane in enumerate(edge.iter("lane")))
        if function == "internal":
            inner |= {lane.id: lane for lane in lanes}
            net.inside[edge.attrib["id"].rpartition("_")[0][1:]] += [lane for lane in lanes if lane.drivable]
        elif function == "crossing" and lanes:
            crossings.append((edge, lanes[0]))
        elif function == "walkingarea":
            net.walkways[edge.attrib["id"].rpartition("_")[0][1:]] += [lane.line for lane in lanes]
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
    inner: Mapping[str, NetLane],
    index_of: Mapping[str, int],
    states: Mapping[str, Sequence[str]],
) -> dict[str, str]:
    """Notes the connections of lanes; returns the signal of each crossing.

    A connection whose signal never opens is left out.
    """
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
    """Tells whether a connection's signal stays red.

    Such programmes are made to be switched by hand.
    """
    phases = states.get(connection.get("tl", ""), ())
    return bool(phases) and all(state[int(connection["linkIndex"])] in STOP for state in phases)


def _edge(edge: ET.Element, lanes: tuple[NetLane, ...]) -> Edge:
    id_ = edge.attrib["id"]
    if len(id_) > LONGEST_NAME or not lanes:
        got = f"edge {id_[:60]!r} has {len(lanes)} lanes and an id of {len(id_)} characters"
        raise ValueError(f"{got}; wanted one lane or more, and at most {LONGEST_NAME} characters")
    return Edge(id_, edge.attrib["from"], edge.attrib["to"], lanes)


def _lane(edge: str, index: int, a: Mapping[str, str]) -> NetLane:
    line = _line(a["shape"])
    if not line:
        raise ValueError(f"lane {a['id']!r} has no shape")
    return NetLane(
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
