"""Writes OpenDRIVE: reference lines, lanes, signals and crossings of a net."""

import math
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, pairwise

import numpy as np

from risk_sac.failures.export.formats import BESIDE, add, document
from risk_sac.failures.net import moved, ribbon
from risk_sac.world.net import Net, NetLane
from risk_sac.world.types import Floats

LEAST_ROUND_M = 0.5  # least length of the bend before and behind a corner, where its sides are long enough
KNOTS = np.arange(8) / 8  # parameters at which a cubic beside a corner is sampled
ROOM = 1.2  # length of a bend as a multiple of what the innermost lane loses at the corner


@dataclass(frozen=True, slots=True)
class Stop:
    """A place on a line, and the line's direction there."""

    place: Floats  # x, y
    direction: Floats  # of unit length


@dataclass(frozen=True, slots=True)
class ReferenceLine:
    """A smooth line through the corners of a polyline."""

    stops: Sequence[Stop]
    stations_m: Floats  # of the stops
    corners_m: Floats  # stations of the polyline's points

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return float(self.stations_m[-1])

    def knots(self) -> tuple[Floats, Floats, Floats]:
        """Maps lines beside the polyline to this line, which bends around corners.

        One that is moved by d to the left of the polyline lies (d - shift) stretch to the left of this line.

        Returns:
          Stations, shifts in m and stretches, `k` each; linear in between.
        """
        knots = []
        for (start, end), station in zip(pairwise(self.stops), self.stations_m.tolist(), strict=False):
            curve = _cubic(start, end)
            frame = np.array([start.direction, (-start.direction[1], start.direction[0])])
            for p in KNOTS if curve[1:].any() else KNOTS[:1]:
                side = start if p <= 0.5 else end
                place = start.place + np.array((p, p**2, p**3)) @ curve @ frame
                way = np.array((1.0, 2.0 * p, 3.0 * p**2)) @ curve @ frame
                shift_m = (place - side.place) @ (-side.direction[1], side.direction[0])
                reached_m = _length_m(curve * np.array([(p,), (p**2,), (p**3,)]))
                knots.append((station + reached_m, shift_m, np.hypot(*way) / (way @ side.direction)))
        stations_m, shift_m, stretch = np.array([*knots, (self.length_m, 0.0, 1.0)]).T
        return stations_m, shift_m, stretch

    def write(self, parent: ET.Element) -> None:
        """Adds the line's geometries to a plan view."""
        straight: ET.Element | None = None  # the last geometry, if it is
        for (start, end), (s, after) in zip(pairwise(self.stops), pairwise(self.stations_m.tolist()), strict=True):
            curve = _cubic(start, end)
            if straight is not None and not curve[1:].any():
                straight.set("length", str(float(straight.attrib["length"]) + after - s))
                continue
            heading = float(np.arctan2(start.direction[1], start.direction[0]))
            x, y = start.place.tolist()
            geometry = add(parent, "geometry", s=s, x=x, y=y, hdg=heading, length=after - s)
            straight = None if curve[1:].any() else geometry
            if straight is not None:
                add(geometry, "line")
                continue
            cubic = add(geometry, "paramPoly3", pRange="normalized", aU=0.0, aV=0.0)
            for power, (u, v) in zip("bcd", curve.tolist(), strict=True):
                cubic.attrib |= {f"{power}U": str(u), f"{power}V": str(v)}


def reference_line(
    points: Floats, half_width_m: float, way_in: Floats | None = None, way_out: Floats | None = None
) -> ReferenceLine:
    """Lays a line through the corners of a polyline.

    Args:
      points: `k x 2`, m; no two neighbours are the same.
      half_width_m: of the lanes beside the line.
      way_in: unit direction in which it begins; default: along its first side.
      way_out: unit direction in which it ends; default: along its last side.
    """
    sides = np.diff(points, axis=0)
    lengths = np.linalg.norm(sides, axis=1)
    ways = sides / lengths[:, None]
    stops = [Stop(points[0], ways[0] if way_in is None else way_in)]
    if way_in is not None:
        stops.append(Stop(points[0] + ways[0] * min(LEAST_ROUND_M, lengths[0] / 2), ways[0]))
    for corner, (before, after) in enumerate(pairwise(ways), start=1):
        cos = float(np.linalg.norm(before + after)) / 2  # of half the angle
        lost_m = half_width_m * math.sqrt(max(1.0 - cos**2, 0.0)) / max(cos, 1e-3)
        reach_m = min(max(LEAST_ROUND_M, ROOM * lost_m), lengths[corner - 1] / 2, lengths[corner] / 2)
        place = points[corner]
        stops += [Stop(place - before * reach_m, before), Stop(place + after * reach_m, after)]
    if way_out is not None:
        stops.append(Stop(points[-1] - ways[-1] * min(LEAST_ROUND_M, lengths[-1] / 2), ways[-1]))
    stops.append(Stop(points[-1], ways[-1] if way_out is None else way_out))
    apart = [np.hypot(*(after.place - before.place)) > 1e-6 for before, after in pairwise(stops)]
    pieces_m = [_length_m(_cubic(*ends)) * far for ends, far in zip(pairwise(stops), apart, strict=True)]
    stations_m = np.concatenate(([0.0], np.cumsum(pieces_m)))
    first = 1 if way_in is None else 2
    corners_m = stations_m[first : first + 2 * len(points) - 4].reshape(-1, 2).mean(axis=1)
    kept = [0, *(place for place, far in enumerate(apart, start=1) if far)]
    corners_m = np.concatenate(([0.0], corners_m, stations_m[-1:]))
    return ReferenceLine([stops[place] for place in kept], stations_m[kept], corners_m)


def _cubic(start: Stop, end: Stop) -> Floats:
    """Returns Hermite's cubic between two stops, in the frame of the first.

    Its rows are the factors of p, p², p³, `3 x 2`.
    """
    cos, sin = start.direction
    frame = np.array([(cos, -sin), (sin, cos)])
    chord, leaves = (end.place - start.place) @ frame, end.direction @ frame
    if abs(chord[1]) + abs(leaves[1]) < 1e-9:
        return np.array([(chord[0], 0.0), (0.0, 0.0), (0.0, 0.0)])
    speed = np.hypot(*chord) / np.cos(np.arctan2(leaves[1], leaves[0]) / 4.0) ** 2  # as on an arc
    into, out = np.array((speed, 0.0)), leaves * speed
    return np.array([into, 3.0 * chord - 2.0 * into - out, into + out - 2.0 * chord])


def _length_m(cubic: Floats) -> float:
    places, weights = np.polynomial.legendre.leggauss(16)
    p = (places + 1.0) / 2.0
    slopes = np.stack((np.ones_like(p), 2.0 * p, 3.0 * p**2), axis=1) @ cubic
    return float(np.linalg.norm(slopes, axis=1) @ weights / 2.0)


SIGNAL_M = 5.0  # height of a signal above the road
LANE_TYPES = {"lane": "driving", "inside": "driving", "sidewalk": "sidewalk"}


@dataclass(frozen=True, slots=True)
class ExportedRoad:
    """Lanes side by side; inside a junction, one way between two lanes."""

    name: str
    lanes: Sequence[NetLane]  # from left to right
    line: ReferenceLine
    height_m: Floats  # at the corners of the line
    number: int
    start: NetLane | None = None
    end: NetLane | None = None
    junction: str = ""  # of a road inside one

    def lane_number(self, lane: NetLane) -> int:
        """Returns OpenDRIVE's number of a lane."""
        return -1 - self.lanes.index(lane)


def opendrive(net: Net, name: str) -> bytes:
    """Returns the roads of a net."""
    numbers = count(1)
    edges: defaultdict[str, list[NetLane]] = defaultdict(list)
    for lane in net.lanes.values():
        if lane.use in ("lane", "sidewalk") and not lane.edge.startswith(":"):
            edges[lane.edge].append(lane)
    roads = {edge: _road(sorted(lanes, key=lambda lane: -lane.index), next(numbers)) for edge, lanes in edges.items()}
    turns = [_turn(next(numbers), *turn) for turn in _turns(net)]
    junctions = {id_: next(numbers) for id_ in dict.fromkeys(turn.junction for turn in turns)}
    root = ET.Element("OpenDRIVE")
    header = add(root, "header", revMajor=1, revMinor=7, name=name, version="1.00")
    header.append(ET.Comment(f" {BESIDE} has what is not in this file "))
    crossings = _crossings(net, roads)
    for edge, road in roads.items():
        into = {turn.junction for turn in turns if turn.end in road.lanes}
        out_of = {turn.junction for turn in turns if turn.start in road.lanes}
        links = {"predecessor": into, "successor": out_of}
        ends = {end: ("junction", junctions[found]) for end, each in links.items() for found in each}
        _write(root, road, -1, ends, crossings[edge])
    for turn in turns:
        sides = {"predecessor": turn.start, "successor": turn.end}
        ends = {end: ("road", roads[lane.edge].number) for end, lane in sides.items() if lane is not None}
        _write(root, turn, junctions[turn.junction], ends, (), roads)
    signals = defaultdict(set)
    for lane in net.lanes.values():
        for head in lane.heads if lane.use == "lane" else ():
            signals[head.signal].add(head.index)
    for signal, indices in signals.items():
        controller = add(root, "controller", id=signal)
        for index in sorted(indices):
            add(controller, "control", signalId=f"{signal}_{index}")
    for id_, number in junctions.items():
        junction = add(root, "junction", id=number, name=id_)
        own = [turn for turn in turns if turn.junction == id_]
        for place, turn in enumerate(own):
            if turn.start is not None:
                incoming = roads[turn.start.edge]
                ids = {"incomingRoad": incoming.number, "connectingRoad": turn.number}
                connection = add(junction, "connection", id=place, **ids, contactPoint="start")
                add(connection, "laneLink", **{"from": incoming.lane_number(turn.start), "to": -1})
    return document(root)


def _turns(net: Net) -> Iterator[tuple[NetLane, Sequence[NetLane], NetLane | None]]:
    """Yields ways across junctions: lane before, lanes inside, and lane after."""
    for start in net.lanes.values():
        if start.use == "inside":
            continue
        for name in start.next:
            inside, lane = list[NetLane](), net.lanes[name]
            while lane.use == "inside" and lane not in inside:  # SUMO divides a turn where vehicles wait
                inside.append(lane)
                lane = next((net.lanes[after] for after in lane.next), lane)
            if inside:
                yield start, inside, None if lane in inside else lane


def _road(lanes: Sequence[NetLane], number: int) -> ExportedRoad:
    left, half_m = lanes[0], sum(lane.width_m for lane in lanes) / 2
    points = moved(left.centre, left.width_m / 2 - half_m)
    line = reference_line(points, half_m)
    return ExportedRoad(left.edge, lanes, line, np.array(left.height_m), number)


def _turn(number: int, start: NetLane, inside: Sequence[NetLane], end: NetLane | None) -> ExportedRoad:
    """Lays a road along lanes inside a junction, tangent to its neighbours."""
    points = np.concatenate([inside[0].centre[:1], *(lane.centre[1:] for lane in inside)])
    height_m = np.concatenate([inside[0].height_m[:1], *(lane.height_m[1:] for lane in inside)])
    way_out = None if end is None else _way(end.centre[:2])
    line = reference_line(points, inside[0].width_m / 2, _way(start.centre[-2:]), way_out)
    junction = inside[0].edge[1:].rpartition("_")[0]
    return ExportedRoad(inside[0].id, inside[:1], line, height_m, number, start, end, junction)


def _way(side: Floats) -> Floats:
    way: Floats = (side[1] - side[0]) / np.linalg.norm(side[1] - side[0])
    return way


def _write(
    root: ET.Element,
    road: ExportedRoad,
    junction: int,
    ends: Mapping[str, tuple[str, int]],
    crossings: Sequence[NetLane],
    roads: Mapping[str, ExportedRoad] | None = None,
) -> None:
    written = add(
        root, "road", name=road.name, length=road.line.length_m, id=road.number, junction=junction, rule="RHT"
    )
    link = add(written, "link")
    for end, (kind, number) in ends.items():
        contact = {} if kind == "junction" else {"contactPoint": "start" if end == "successor" else "end"}
        add(link, end, elementType=kind, elementId=number, **contact)
    add(written, "type", s=0, type="town")
    road.line.write(add(written, "planView"))
    profile = add(written, "elevationProfile")
    _add_linear(profile, "elevation", road.line.corners_m, road.height_m)
    add(written, "lateralProfile")
    _write_lanes(written, road, roads or {})
    objects = add(written, "objects")
    for crossing in crossings:
        _write_crossing(objects, road, crossing)
    signals = add(written, "signals")
    drawn = set()
    for lane in road.lanes:
        for head in lane.heads if lane.use == "lane" else ():
            id_ = f"{head.signal}_{head.index}"
            if id_ not in drawn:
                _write_signal(signals, road, lane, id_)
            drawn.add(id_)


def _write_lanes(written: ET.Element, road: ExportedRoad, roads: Mapping[str, ExportedRoad]) -> None:
    lanes, half_m = add(written, "lanes"), sum(lane.width_m for lane in road.lanes) / 2
    stations_m, shift_m, stretch = road.line.knots()
    _add_linear(lanes, "laneOffset", stations_m, (half_m - shift_m) * stretch)
    section = add(lanes, "laneSection", s=0)
    add(add(add(section, "center"), "lane", id=0, type="none", level="false"), "link")
    right = add(section, "right")
    for lane in road.lanes:
        beside = add(right, "lane", id=road.lane_number(lane), type=LANE_TYPES[lane.use], level="false")
        link = add(beside, "link")
        for end, other in (("predecessor", road.start), ("successor", road.end)):
            if other is not None:
                add(link, end, id=roads[other.edge].lane_number(other))
        _add_linear(beside, "width", stations_m, lane.width_m * stretch, along="sOffset")
        mark = "none" if lane.use == "inside" else "solid" if lane is road.lanes[-1] else "broken"
        add(beside, "roadMark", sOffset=0, type=mark, weight="standard", color="standard", width=0.13)
        add(beside, "speed", sOffset=0, max=lane.limit_mps)


def _add_linear(parent: ET.Element, name: str, stations_m: Floats, values: Floats, along: str = "s") -> None:
    """Adds the polynomials of a piecewise linear function."""
    slopes = np.diff(values) / np.diff(stations_m)
    for place, (station, value, slope) in enumerate(
        zip(stations_m.tolist(), values.tolist(), slopes.tolist(), strict=False)
    ):
        if place == 0 or abs(slope - slopes[place - 1]) > 1e-6:
            add(parent, name, **{along: station}, a=value, b=slope, c=0, d=0)


def _write_signal(signals: ET.Element, road: ExportedRoad, lane: NetLane, id_: str) -> None:
    place = road.lanes.index(lane)
    left_m = sum(each.width_m for each in road.lanes) / 2 - sum(each.width_m for each in road.lanes[:place])
    signal = add(
        signals,
        "signal",
        id=id_,
        s=road.line.length_m,
        t=left_m - lane.width_m / 2,
        orientation="+",
        dynamic="yes",
        zOffset=SIGNAL_M,
        country="OpenDRIVE",
        type="1000001",
        subtype="-1",
        height=0.78,
        width=0.26,
    )
    add(signal, "validity", fromLane=road.lane_number(lane), toLane=road.lane_number(lane))


def _crossings(net: Net, roads: Mapping[str, ExportedRoad]) -> Mapping[str, Sequence[NetLane]]:
    """Returns the pedestrian crossings by the road whose end is nearest."""
    crossings: defaultdict[str, list[NetLane]] = defaultdict(list)
    for lane in net.lanes.values():
        if lane.use == "crossing" and roads:
            middle = lane.centre.mean(axis=0)
            crossings[min(roads, key=lambda edge: np.hypot(*(roads[edge].line.stops[-1].place - middle)))].append(lane)
    return crossings


def _write_crossing(objects: ET.Element, road: ExportedRoad, crossing: NetLane) -> None:
    end = road.line.stops[-1]
    cos, sin = end.direction
    s, t = road.line.length_m, 0.0
    thing = add(objects, "object", id=crossing.id, type="crosswalk", s=s, t=t, zOffset=0, orientation="none", hdg=0)
    outline = add(thing, "outline", closed="true")
    outward = np.array([(cos, -sin), (sin, cos)])
    for u, v in ((ribbon(crossing.centre, crossing.width_m) - end.place) @ outward).tolist():
        add(outline, "cornerLocal", u=u, v=v, z=0, height=0)
