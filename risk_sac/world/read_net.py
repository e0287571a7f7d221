"""Reads SUMO nets of the present format, as netconvert writes them.

Source: https://sumo.dlr.de/docs/Networks/SUMO_Road_Networks.html
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from risk_sac.errors import MapError
from risk_sac.world.net import Crossing, Edge, Head, Junction, LaneUse, Link, Net, NetLane, Program
from risk_sac.world.types import Point

DRIVER = "passenger"  # the class of every vehicle of ours on a lane that admits it
CLASSES = frozenset({DRIVER, "delivery", "truck", "bus", "motorcycle", "bicycle"})  # of our bodies that drive in lanes
TURNAROUND = "t"
STOP = "rRyYu"  # red, yellow, and red with yellow: the colours that stop all traffic
USES: Mapping[str, LaneUse] = {"normal": "lane", "internal": "inside", "crossing": "crossing"}  # by an edge's function
DEFAULT_WIDTH_M = 3.2
LEAST_LIMIT_MPS = 0.01  # of a closed lane, so that driving it takes a finite time
FARTHEST = 1e8  # m; the Earth's circumference is 4e7
LONGEST_NAME = 200
ORIGINAL = "origId"  # parameter that netconvert writes
REPAIR = "run netconvert over it, or save it with netedit"


def read_tree(path: Path) -> ET.Element:
    """Reads the XML of our own or netconvert's net; raises `MapError`."""
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
    """Reads the XML of any net; raises `MapError` for other formats."""
    if root.tag != "net":
        raise MapError("network", f"a file with the root <{root.tag}>", "<net>", "convert it first")
    try:
        return _net(root)
    except KeyError as error:
        raise MapError("network", f"the net lacks {error}, or names it and does not have it", remedy=REPAIR) from error
    except (ValueError, IndexError) as error:
        raise MapError("network", f"the net is broken: {error}", remedy=REPAIR) from error


def _net(root: ET.Element) -> Net:
    net = Net(keeps_left=root.get("lefthand", "false").lower() in ("true", "1"), shift_m=_shift(root))
    crossings = []
    for edge in root.iter("edge"):
        id_, function = edge.attrib["id"], edge.get("function", "normal")
        junction = id_.rpartition("_")[0][1:]  # of an edge inside one
        lanes = tuple(_lane(id_, i, lane, function) for i, lane in enumerate(edge.iter("lane")))
        if function in USES:
            net.lanes |= {lane.id: lane for lane in lanes}
        if function == "internal":
            net.inside[junction] += [lane for lane in lanes if lane.drivable]
        elif function == "crossing" and lanes:
            crossings.append((edge, junction, lanes[0]))
        elif function == "walkingarea":
            net.walkways[junction] += [lane.line for lane in lanes]
        elif function == "normal":
            net.edges[id_] = _edge(edge, lanes)
    index_of: dict[str, int] = {}
    for element in root.iter("junction"):
        inside = element.get("intLanes", "").split()
        if element.get("type") == "internal":
            foes = [net.lanes[lane] for lane in inside if lane in net.lanes]
            net.waits_for[element.attrib["id"]] = tuple(lane for lane in foes if lane.drivable)
        else:
            net.junctions[element.attrib["id"]] = _junction(element)
            index_of |= {lane: i for i, lane in enumerate(inside)}
    for light in root.iter("tlLogic"):  # of several programmes, SUMO runs the last
        phases = [(_number(phase.attrib["duration"]), phase.attrib["state"]) for phase in light.iter("phase")]
        net.programs[light.attrib["id"]] = Program(phases, _number(light.get("offset", 0.0)))
    _link(net, root, index_of)
    for edge, junction, lane in crossings:
        crossed, signal = tuple(edge.get("crossingEdges", "").split()), next((h.signal for h in lane.heads), None)
        net.crossings.append(Crossing(lane.edge, junction, crossed, lane.line, lane.width_m, signal))
    return net


def _link(net: Net, root: ET.Element, index_of: Mapping[str, int]) -> None:
    """Notes the connections of lanes and their signals.

    A link is left out where its signal never opens.
    """
    outer = []
    for connection in root.iter("connection"):
        a = connection.attrib
        target_id = f"{a['to']}_{a['toLane']}"
        source, target = net.lanes.get(f"{a['from']}_{a['fromLane']}"), net.lanes.get(target_id)
        after = a.get("via") or target_id
        if source is not None and after in net.lanes and after not in source.next:
            source.next.append(after)
        signalled = target if target is not None and target.use == "crossing" else source
        if a.get("tl") and signalled is not None:
            signalled.heads.append(Head(signal=a["tl"], index=int(a["linkIndex"]), turn=a.get("dir", "").lower()))
        if a["from"] in net.edges and a["to"] in net.edges:
            outer.append((a, net.lane(f"{a['from']}_{a['fromLane']}"), net.lane(target_id)))
    for a, one, other in outer:
        if a.get("dir") == TURNAROUND or not (one.drivable and other.drivable) or _is_closed(a, net.programs):
            continue
        inside, lane = list[NetLane](), net.lanes.get(a.get("via", ""))
        while lane is not None and lane.use == "inside" and lane not in inside:
            inside.append(lane)
            lane = net.lanes.get(next(iter(lane.next), ""))
        index = next((index_of[lane.id] for lane in inside if lane.id in index_of), None)
        link = Link(one, other, tuple(inside), a.get("tl"), index)
        net.onward[one.id].append(link)
        net.back[other.id].append(link)


def _is_closed(connection: Mapping[str, str], programs: Mapping[str, Program]) -> bool:
    """Tells whether a connection's signal stays red.

    Such programmes are made to be switched by hand.
    """
    program = programs.get(connection.get("tl", ""))
    if program is None or not program.phases:
        return False
    return all(letters[int(connection["linkIndex"])] in STOP for _, letters in program.phases)


def _edge(edge: ET.Element, lanes: tuple[NetLane, ...]) -> Edge:
    id_ = edge.attrib["id"]
    if len(id_) > LONGEST_NAME or not lanes:
        got = f"edge {id_[:60]!r} has {len(lanes)} lanes and an id of {len(id_)} characters"
        raise ValueError(f"{got}; wanted one lane or more, and at most {LONGEST_NAME} characters")
    return Edge(id_, edge.attrib["from"], edge.attrib["to"], lanes)


def _shift(root: ET.Element) -> Point:
    location = root.find("location")
    x, y = ("0,0" if location is None else location.get("netOffset", "0,0")).split(",")
    return _number(x), _number(y)


def _lane(edge: str, index: int, lane: ET.Element, function: str) -> NetLane:
    a = lane.attrib
    points = _points(a["shape"])
    if not points:
        raise ValueError(f"lane {a['id']!r} has no shape")
    if len(points) == 1:
        ((x, y, z),) = points
        points = [(x, y, z), (x + 1e-3, y, z)]
    classes = _admitted(a.get("allow"), a.get("disallow"))
    walks = function != "crossing" and set(a.get("allow", "").split()) == {"pedestrian"}
    return NetLane(
        id=a["id"],
        edge=edge,
        index=index,  # as SUMO has it, whatever the file says
        length_m=_positive(a["length"]),
        width_m=_positive(a.get("width", DEFAULT_WIDTH_M)),
        limit_mps=max(_number(a["speed"]), LEAST_LIMIT_MPS),
        line=tuple((x, y) for x, y, _ in points),
        drivable=DRIVER in classes,
        use="sidewalk" if walks else USES.get(function, "lane"),
        classes=classes,
        height_m=tuple(z for _, _, z in points),
        original=tuple(
            name for p in lane.iter("param") if p.get("key") == ORIGINAL for name in p.get("value", "").split()
        ),
    )


def _admitted(allow: str | None, disallow: str | None) -> frozenset[str]:
    stated = set((disallow or "" if allow is None else allow).split())
    named = CLASSES if "all" in stated else CLASSES & stated
    return CLASSES - named if allow is None else named


def _junction(junction: ET.Element) -> Junction:
    a = junction.attrib
    foes = {int(request.attrib["index"]): request.attrib["foes"] for request in junction.iter("request")}
    outline = tuple((x, y) for x, y, _ in _points(a.get("shape", "")))
    return Junction(a["id"], a.get("type", ""), _number(a["x"]), _number(a["y"]), outline, foes)


def _points(shape: str) -> list[tuple[float, float, float]]:
    points = [[_number(value) for value in point.split(",")] for point in shape.split()]
    if any(len(point) not in (2, 3) for point in points):
        raise ValueError(f"{shape[:60]!r} is no shape; wanted points x,y or x,y,z")
    return [(x, y, z[0] if z else 0.0) for x, y, *z in points]


def _number(text: str | float) -> float:
    number = float(text)
    if not abs(number) <= FARTHEST:
        raise ValueError(f"{text!r} is no number within ±{FARTHEST:g}")
    return number


def _positive(text: str | float) -> float:
    if (number := _number(text)) <= 0.0:
        raise ValueError(f"{text!r} is no size above 0")
    return number
