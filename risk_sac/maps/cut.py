"""The ground around a place: crossings, lanes and junctions as convex polygons."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence, Set

import numpy as np

from risk_sac.maps.found import Fit
from risk_sac.maps.ways import edges_on
from risk_sac.scenario.clearance import is_near, outlines
from risk_sac.scenario.family import WALK_OFFSET_M
from risk_sac.scenario.layout import CAR_LENGTH_M, CAR_WIDTH_M, ribbon, triangles
from risk_sac.scenario.place import CrossingPlace, FixedSignal, JunctionPlace, Place, PlaceGround, Stretch, Track, Walk
from risk_sac.world.net import Crossing, Net
from risk_sac.world.types import Point

CROSSINGS_M = 60.0  # crossings up to this far from a place are recorded
WALKED_M = 40.0  # a pedestrian's longest way in an episode
JUNCTIONS_M = 120.0
KERB_M = 0.05  # of the crossing before its ends: a pedestrian at the kerb is on the road's edge
CLEAR_M, MOST_BACK_M = 0.3, 5.0  # of the kerb from cars that turn across it, and how far it is moved for that
BESIDE_M = WALK_OFFSET_M + 0.25  # from the crossing's axis, that a pedestrian may reach
LEGS = 3  # of a junction where ways can cross


def ground_around(net: Net, x_m: float, y_m: float, *, walked: bool) -> PlaceGround:
    """The ground around a point that verdicts look at; where no pedestrian walks, the junctions alone."""
    junctions = [
        triangle
        for junction in net.junctions.values()
        if math.hypot(junction.x_m - x_m, junction.y_m - y_m) <= JUNCTIONS_M and len(junction.foes) >= LEGS
        for triangle in triangles(junction.outline)
    ]
    if not walked:
        return PlaceGround(junctions=_rounded(junctions))
    crossings = [
        quad
        for crossing in net.crossings
        if is_near(crossing.line, x_m, y_m, CROSSINGS_M)
        for quad in ribbon(crossing.line, crossing.width_m)
    ]
    lanes = [lane for edge in net.edges.values() for lane in edge.drivable if is_near(lane.line, x_m, y_m, WALKED_M)]
    for junction in net.junctions.values():
        if math.hypot(junction.x_m - x_m, junction.y_m - y_m) <= 3 * WALKED_M:
            lanes += [lane for lane in net.inside.get(junction.id, ()) if is_near(lane.line, x_m, y_m, WALKED_M)]
    quads = (quad for lane in lanes for quad in ribbon(lane.line, lane.width_m))
    roadway = [quad for quad in quads if is_near((*quad, quad[0]), x_m, y_m, WALKED_M)]
    return PlaceGround(crossings=_rounded(crossings), roadway=_rounded(roadway), junctions=_rounded(junctions))


def walk_over(net: Net, crossing: Crossing, driven_rad: float) -> Walk:
    """Returns a walk over a crossing, from the kerb on a driver's right.

    Where cars turn round the corner across the end of a crossing, the kerb is beyond them, so a waiting pedestrian is
    clear.
    """
    right = (math.sin(driven_rad), -math.cos(driven_rad))
    (x0, y0), (x1, y1) = crossing.line[0], crossing.line[-1]
    line = crossing.line if (x0 - x1) * right[0] + (y0 - y1) * right[1] >= 0.0 else crossing.line[::-1]
    (x, y), (to_x, to_y) = line[0], line[1]
    length = math.hypot(to_x - x, to_y - y)
    along_x, along_y = (to_x - x) / length, (to_y - y) / length
    kerb = Walk(x_m=x, y_m=y, along_x=along_x, along_y=along_y)
    back_m = _turned_over_m(net, crossing.junction, kerb) - KERB_M
    return kerb.model_copy(update={"x_m": x - along_x * back_m, "y_m": y - along_y * back_m})


def _turned_over_m(net: Net, junction: str, kerb: Walk) -> float:
    """Computes how far a kerb moves back to be clear of turning cars."""
    links = [link for edge in net.arriving[junction] for lane in edge.drivable for link in net.onward.get(lane.id, ())]
    if not links:
        return 0.0
    x, y = np.concatenate([outlines(link, CAR_LENGTH_M, CAR_WIDTH_M) for link in links], axis=1)
    along_m = (x - kerb.x_m) * kerb.along_x + (y - kerb.y_m) * kerb.along_y
    across_m = (y - kerb.y_m) * kerb.along_x - (x - kerb.x_m) * kerb.along_y
    met = (np.abs(across_m) <= BESIDE_M) & (along_m >= -MOST_BACK_M) & (along_m < CLEAR_M)
    return min(float(CLEAR_M - along_m[met].min()), MOST_BACK_M) if met.any() else 0.0


def signal_of(net: Net, ids: Iterable[str | None]) -> FixedSignal | None:
    """The first of the signals that are there."""
    cycles_s = ((id_, net.programs[id_].cycle_s) for id_ in ids if id_ in net.programs)
    return next((FixedSignal(id=id_, cycle_s=cycle_s) for id_, cycle_s in cycles_s if id_ and cycle_s > 0.0), None)


def _rounded(polygons: Iterable[Sequence[Point]]) -> tuple[tuple[Point, ...], ...]:
    """To a millimetre."""
    return tuple(tuple((round(x, 3), round(y, 3)) for x, y in polygon) for polygon in polygons)


AROUND_M = 100.0  # unused roads up to this far from a place stay: a picture shows them


def cut(net: Net, root: ET.Element, fit: Fit) -> bytes:
    """The file of the piece around a place; `root` stays as it is."""
    driven = edges_on(*tracks(fit.place))
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


def tracks(place: Place) -> list[Track]:
    """Lists all tracks on which a vehicle may start."""
    match place:
        case Stretch():
            return [track for track in (place.ego, place.left, place.right) if track is not None]
        case CrossingPlace():
            return [track for site in place.sites for track in (site.ego, site.occluder, *site.oncoming)]
        case JunctionPlace():
            legs = [track for leg in (place.ego, *place.others) for track in leg.turns]
            return legs + [stream.track for stream in place.streams]


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
