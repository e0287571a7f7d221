"""Reads geometry and links of an OpenDRIVE file's roads.

Heights are left out. Source: ASAM OpenDRIVE 1.7: road reference line, lane offset, lane sections, widths and borders.
"""

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import parse

from risk_sac.errors import ConfigError, MapError, did_you_mean
from risk_sac.world.plane_curves import Across, Begin, Clothoid, Cubic, CubicCurve, Curve, active, value_at
from risk_sac.world.types import Floats

End = Literal["start", "end"]
FARTHEST = 1e8  # of any number; the Earth's circumference is 4e7 m
LONGEST_M = 1e6  # of a road
MOST_TURNED_RAD = 200.0  # by one piece of a reference line; choice: 30 rounds
TOLERANCE_M = 0.01  # by which a place may lie beyond a road's end
NEAR_M = 60.0  # of a reference line; choice: half of the widest road
SAMPLE_M = 1.0  # between the places of a reference line that a point is compared with first


@dataclass(frozen=True)
class RoadLane:
    """Lane of one lane section."""

    id: int
    kind: str
    widths: tuple[Cubic, ...]  # from the section's begin; empty where borders say where it ends
    borders: tuple[Cubic, ...]
    links: Mapping[End, int]  # lane that it is linked to before its start, and after its end


@dataclass(frozen=True)
class Section:
    """Lanes of a road from a place on."""

    start_m: float
    lanes: Mapping[int, RoadLane]

    def outer(self, lane: int, s_m: float) -> Across:
        """Returns a lane's outer border, from the middle lane 0."""
        t, slope, side = 0.0, 0.0, 1 if lane > 0 else -1
        for id_ in range(side, lane + side, side) if lane else ():
            other, ds = self.lanes[id_], s_m - self.start_m
            if other.widths or not other.borders:
                width = value_at(other.widths, ds)
                t, slope = t + side * width.t_m, slope + side * width.slope
            else:
                t, slope = value_at(other.borders, ds)
        return Across(t, slope)


class LinkTo(NamedTuple):
    """Road or junction that a road's end leads to."""

    kind: Literal["road", "junction"]
    id: str
    contact: End


@dataclass(frozen=True, eq=False)
class Roadway:
    """Road of an OpenDRIVE file."""

    id: str
    length_m: float
    junction: str | None
    keeps_left: bool
    starts_m: tuple[float, ...]  # of the pieces of its reference line
    curves: tuple[Curve, ...]
    offsets: tuple[Cubic, ...]
    sections: tuple[Section, ...]
    links: Mapping[End, LinkTo]

    def reference(self, s_m: Floats) -> Floats:
        """Returns the reference line's x, y, heading and curvature, `n x 4`."""
        rows = np.empty((len(s_m), 4))
        piece = np.clip(np.searchsorted(self.starts_m, s_m, side="right") - 1, 0, None)
        for i in np.unique(piece):
            rows[piece == i] = self.curves[i].at(s_m[piece == i] - self.starts_m[i])
        return rows

    def place(self, s_m: float) -> tuple[float, float, float, float]:
        """Returns the reference line's x, y, heading and curvature at one place."""
        i = max(bisect_right(self.starts_m, s_m) - 1, 0)
        return self.curves[i].place(s_m - self.starts_m[i])

    def section_index(self, s_m: float) -> int:
        """Returns which lane section a place lies in."""
        return max(bisect_right(self.sections, s_m, key=attrgetter("start_m")) - 1, 0)

    def section(self, s_m: float) -> Section:
        """Returns the lane section at a place."""
        return self.sections[self.section_index(s_m)]

    @cached_property
    def breaks_m(self) -> tuple[float, ...]:
        """Places where a reference piece, lane section, width or offset begins."""
        lanes = [(section.start_m, lane) for section in self.sections for lane in section.lanes.values()]
        widths = [start + cubic.start_m for start, lane in lanes for cubic in (*lane.widths, *lane.borders)]
        starts = [cubic.start_m for cubic in self.offsets] + [section.start_m for section in self.sections]
        return tuple(sorted({*self.starts_m, *starts, *widths}))

    def interval(self, s_m: float) -> int:
        """Returns how many of `breaks_m` a place is beyond."""
        return bisect_right(self.breaks_m, s_m)

    @cached_property
    def plain(self) -> tuple[bool, ...]:
        """Whether widths and offset are constant, by `interval`."""
        return tuple(self._is_plain(s_m) for s_m in (0.0, *self.breaks_m))

    def _is_plain(self, s_m: float) -> bool:
        section = self.section(s_m)
        cubics = [active(lane.widths, s_m - section.start_m) for lane in section.lanes.values()]
        cubics += [active(lane.borders, s_m - section.start_m) for lane in section.lanes.values()]
        cubics.append(active(self.offsets, s_m))
        return all(cubic.b == cubic.c == cubic.d == 0.0 for cubic in cubics if cubic is not None)

    def middle(self, lane: int, s_m: float) -> Across:
        """Returns a lane's middle; raises `ConfigError` if the lane is missing."""
        section, offset = self.section(s_m), value_at(self.offsets, s_m)
        if lane != 0 and lane not in section.lanes:
            known = ", ".join(map(str, sorted(section.lanes)))
            raise ConfigError("lane", f"{lane} of road {self.id!r} at {s_m:g} m", f"one of {known}")
        outer, inner = section.outer(lane, s_m), section.outer(lane - (lane > 0) + (lane < 0), s_m)
        return Across(offset.t_m + (outer.t_m + inner.t_m) / 2, offset.slope + (outer.slope + inner.slope) / 2)

    def width_m(self, lane: int, s_m: float) -> float:
        """Returns the width of a lane."""
        section = self.section(s_m)
        return abs(section.outer(lane, s_m).t_m - section.outer(lane - (lane > 0) + (lane < 0), s_m).t_m)

    def point(self, s_m: float, across: Across) -> tuple[float, float, float]:
        """Returns x, y and direction of increasing s beside the reference line.

        (1 - κ t) ds is the line's progress along the reference line's heading, dt across it.
        """
        x, y, heading, curvature = self.place(s_m)
        turned = math.atan2(across.slope, max(1.0 - curvature * across.t_m, 1e-6))
        return x - math.sin(heading) * across.t_m, y + math.cos(heading) * across.t_m, heading + turned

    def backwards(self, lane: int) -> bool:
        """Whether a lane's traffic drives against the reference line."""
        return (lane > 0) != self.keeps_left if lane else False

    def lane_at(self, s_m: float, t_m: float) -> int:
        """Returns the lane at a lateral place, or the outermost beside it."""
        section, t_m = self.section(s_m), t_m - value_at(self.offsets, s_m).t_m
        side = 1 if t_m > 0 else -1
        ids = [id_ for id_ in section.lanes if id_ * side > 0] or [id_ for id_ in section.lanes if id_]
        ids.sort(key=abs)
        return next((id_ for id_ in ids if abs(t_m) <= abs(section.outer(id_, s_m).t_m)), ids[-1] if ids else 0)

    @cached_property
    def samples(self) -> Floats:
        """Places along the reference line and x, y there, `n x 3`."""
        s_m = np.linspace(0.0, self.length_m, max(2, math.ceil(self.length_m / SAMPLE_M) + 1))
        return np.column_stack((s_m, self.reference(s_m)[:, :2]))

    def project(self, x_m: float, y_m: float, near_m: float | None = None) -> tuple[float, float]:
        """Returns s and t of a point; s is within the road.

        Args:
          x_m: of the point.
          y_m: of the point.
          near_m: a place to begin from; without it the nearest of the samples.
        """
        if near_m is None:
            nearest = int(np.argmin((self.samples[:, 1] - x_m) ** 2 + (self.samples[:, 2] - y_m) ** 2))
            near_m = float(self.samples[nearest, 0])
        s_m, t_m = near_m, 0.0
        for _ in range(20):  # Newton's method on the point's distance along the tangent
            x, y, heading, curvature = self.place(s_m)
            dx, dy = x_m - x, y_m - y
            along, t_m = (
                dx * math.cos(heading) + dy * math.sin(heading),
                dy * math.cos(heading) - dx * math.sin(heading),
            )
            step = along / max(1.0 - curvature * t_m, 0.2)
            moved = min(max(s_m + step, 0.0), self.length_m)
            if abs(moved - s_m) < 1e-9:
                break
            s_m = moved
        return s_m, t_m


class JunctionWay(NamedTuple):
    """Way across a junction."""

    incoming: str
    road: str
    contact: End
    """End of the connecting road that the incoming road meets."""
    lanes: Mapping[int, int]
    """Lane of the incoming road → lane of the connecting road."""


@dataclass(frozen=True)
class RoadFile:
    """Roads of an OpenDRIVE file, and the connections of its junctions."""

    roads: Mapping[str, Roadway]
    connections: Mapping[str, Sequence[JunctionWay]]
    """By junction."""

    @classmethod
    def read(cls, file: Path) -> "RoadFile":
        """Reads a file; raises `MapError` if it is no OpenDRIVE."""
        try:
            root: Element = parse(file, forbid_dtd=True).getroot()
        except (ParseError, DefusedXmlException, ValueError) as error:
            raise MapError("road", f"{file.name}, which is no XML that can be read: {error}", "OpenDRIVE") from error
        if root.tag != "OpenDRIVE":
            raise MapError("road", f"{file.name}, whose root is <{root.tag[:80]}>", "<OpenDRIVE>")
        roads = {}
        for element in root.findall("road"):
            try:
                road = _road(element)
            except (KeyError, ValueError, IndexError) as error:
                got = f"road {element.get('id', '?')[:80]!r} of {file.name} with a missing or broken value: {error}"
                raise MapError("road", got, "what OpenDRIVE requires") from error
            roads[road.id] = road
        connections = {}
        for junction in root.findall("junction"):
            id_ = junction.get("id", "")
            try:
                connections[id_] = _connections(junction)
            except (KeyError, ValueError) as error:
                got = f"junction {id_[:80]!r} of {file.name} with a missing or broken value: {error}"
                raise MapError("road", got, "what OpenDRIVE requires") from error
        return cls(roads, connections)

    def near(self, x_m: float, y_m: float) -> list[tuple[Roadway, float]]:
        """Returns roads near a point, each with its reference line's nearest sample.

        Near are those whose reference line is within 60 m, or else the nearest one.
        """
        roads, firsts, samples = self._samples
        if not roads:
            return []
        apart = np.hypot(samples[:, 1] - x_m, samples[:, 2] - y_m)
        least = np.minimum.reduceat(apart, firsts)
        places = []
        for i in np.flatnonzero(least <= max(NEAR_M, float(least.min()))).tolist():
            end = firsts[i + 1] if i + 1 < len(firsts) else len(samples)
            nearest = int(firsts[i] + np.argmin(apart[firsts[i] : end]))
            places.append((roads[i], float(samples[nearest, 0])))
        return places

    @cached_property
    def _samples(self) -> tuple[list[Roadway], list[int], Floats]:
        """Roads, where the samples of each begin, and all samples."""
        roads = list(self.roads.values())
        firsts = np.cumsum([0, *(len(road.samples) for road in roads)])[:-1].tolist()
        return roads, firsts, np.concatenate([road.samples for road in roads] or [np.empty((0, 3))])

    def road(self, id_: str) -> Roadway:
        """Returns a road; raises `ConfigError` if there is none of this name."""
        if id_ not in self.roads:
            known = list(self.roads)
            listed = ", ".join(known[:12]) + (", …" if len(known) > 12 else "")
            raise ConfigError("road", repr(id_), f"a road of the road file: {listed}", did_you_mean(id_, known))
        return self.roads[id_]


def _number(element: Element, name: str, default: float | None = None) -> float:
    text = element.get(name)
    number = default if text is None and default is not None else float(element.attrib[name])
    if not abs(number) <= FARTHEST:
        raise ValueError(f"{name}={text!r}")
    return number


def _cubics(elements: Sequence[Element], start: str) -> tuple[Cubic, ...]:
    cubics = (Cubic(*(_number(element, name) for name in (start, *"abcd"))) for element in elements)
    return tuple(sorted(cubics, key=attrgetter("start_m")))


def _contact(element: Element) -> End:
    return "end" if element.get("contactPoint") == "end" else "start"


def _road(element: Element) -> Roadway:
    geometries = sorted(element.findall("planView/geometry"), key=lambda geometry: _number(geometry, "s"))
    sections = sorted(element.findall("lanes/laneSection"), key=lambda section: _number(section, "s"))
    if not geometries or not sections:
        raise ValueError("no geometry, or no lane section")
    links: dict[End, LinkTo] = {}
    ends: tuple[tuple[End, str], ...] = (("start", "predecessor"), ("end", "successor"))
    for end, name in ends:
        link = element.find(f"link/{name}")
        if link is not None:
            kind: Literal["road", "junction"] = "junction" if link.get("elementType") == "junction" else "road"
            links[end] = LinkTo(
                kind, link.get("elementId", ""), "end" if link.get("contactPoint") == "end" else "start"
            )
    junction = element.get("junction", "-1")
    length_m = _number(element, "length")
    if not 0.0 < length_m <= LONGEST_M:
        raise ValueError(f"length={length_m:g}")
    return Roadway(
        id=element.attrib["id"],
        length_m=length_m,
        junction=None if junction == "-1" else junction,
        keeps_left=element.get("rule") == "LHT",
        starts_m=tuple(_number(geometry, "s") for geometry in geometries),
        curves=tuple(map(_curve, geometries)),
        offsets=_cubics(element.findall("lanes/laneOffset"), "s"),
        sections=tuple(map(_section, sections)),
        links=links,
    )


def _curve(geometry: Element) -> Curve:
    curve = _shaped(geometry)
    if not 0.0 <= curve.length_m <= LONGEST_M:
        raise ValueError(f"a geometry of {curve.length_m:g} m")
    if isinstance(curve, Clothoid):
        turned = max(abs(curve.curvature_start), abs(curve.curvature_end)) * curve.length_m
        if turned > MOST_TURNED_RAD:
            raise ValueError(f"a geometry that turns by {turned:g} rad")
    return curve


def _shaped(geometry: Element) -> Curve:
    begin = Begin(_number(geometry, "x"), _number(geometry, "y"), _number(geometry, "hdg"))
    length_m, shape = _number(geometry, "length"), next(iter(geometry), None)
    match shape.tag if shape is not None else "":
        case "line":
            return Clothoid(begin, 0.0, 0.0, length_m)
        case "arc" if shape is not None:
            curvature = _number(shape, "curvature")
            return Clothoid(begin, curvature, curvature, length_m)
        case "spiral" if shape is not None:
            return Clothoid(begin, _number(shape, "curvStart"), _number(shape, "curvEnd"), length_m)
        case "poly3" if shape is not None:
            v = tuple(_number(shape, name) for name in "abcd")
            return CubicCurve(begin, (0.0, 1.0, 0.0, 0.0), v, _poly3_end(v, length_m), length_m)
        case "paramPoly3" if shape is not None:
            u, v = (tuple(_number(shape, f"{name}{axis}") for name in "abcd") for axis in "UV")
            return CubicCurve(begin, u, v, length_m if shape.get("pRange") == "arcLength" else 1.0, length_m)
        case other:
            raise ValueError(f"a geometry {other!r}")


def _poly3_end(v: Sequence[float], length_m: float) -> float:
    """Returns the u at which the curve v(u) has its length."""
    u = np.linspace(0.0, length_m, 2001)
    slope = v[1] + u * (2 * v[2] + u * 3 * v[3])
    speed = np.hypot(1.0, slope)
    lengths = np.concatenate(([0.0], np.cumsum((speed[:-1] + speed[1:]) / 2 * (u[1] - u[0]))))
    return float(np.interp(length_m, lengths, u))


def _section(element: Element) -> Section:
    lanes = {}
    for lane in element.findall("*/lane"):
        links: dict[End, int] = {}
        if (before := lane.find("link/predecessor")) is not None:
            links["start"] = int(before.attrib["id"])
        if (after := lane.find("link/successor")) is not None:
            links["end"] = int(after.attrib["id"])
        id_ = int(lane.attrib["id"])
        widths, borders = _cubics(lane.findall("width"), "sOffset"), _cubics(lane.findall("border"), "sOffset")
        lanes[id_] = RoadLane(id_, lane.get("type", "none"), widths, borders, links)
    lanes.pop(0, None)
    for id_ in lanes:
        if id_ - (1 if id_ > 0 else -1) not in (0, *lanes):
            raise ValueError(f"lane {id_} without the lane inside it")
    return Section(_number(element, "s"), lanes)


def _connections(junction: Element) -> list[JunctionWay]:
    connections = []
    for element in junction.findall("connection"):
        lanes = {int(link.attrib["from"]): int(link.attrib["to"]) for link in element.findall("laneLink")}
        incoming, road = element.get("incomingRoad", ""), element.get("connectingRoad", "")
        connections.append(JunctionWay(incoming, road, _contact(element), lanes))
    return connections
