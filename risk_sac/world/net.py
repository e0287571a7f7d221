"""Reads a SUMO net for finders, pictures and exports."""

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import Concatenate, Literal, ParamSpec, TypeVar, cast

import numpy as np

from risk_sac.world.types import Floats, Point

P = ParamSpec("P")
T = TypeVar("T")
LaneUse = Literal["lane", "inside", "sidewalk", "crossing"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """A link's place in the letters of a signal."""

    signal: str
    index: int
    turn: str  # SUMO's letter of where the link goes: s, l, r and others


@dataclass(frozen=True, slots=True)
class Program:
    """A signal that shows fixed letters for fixed times."""

    phases: Sequence[tuple[float, str]]  # s, SUMO's letters of all links
    offset_s: float

    @property
    def cycle_s(self) -> float:
        """Length of the cycle."""
        return sum(duration for duration, _ in self.phases)

    def letters(self, time_s: float) -> str:
        """Returns the letters just before a time of the cycle.

        So SUMO shows them in its own step.
        """
        left = (time_s - 1e-6 - self.offset_s) % self.cycle_s
        for duration, letters in self.phases:
            if left < duration:
                return letters
            left -= duration
        return self.phases[-1][1]


@dataclass(frozen=True, slots=True, eq=False)
class NetLane:
    """Lane of a road, in a junction, for walking, or a crossing."""

    id: str
    edge: str
    index: int  # 0 is the rightmost
    length_m: float
    width_m: float
    limit_mps: float
    line: tuple[Point, ...]
    drivable: bool
    use: LaneUse = "lane"
    classes: frozenset[str] = frozenset()  # of SUMO, that may drive on it; those of our bodies
    height_m: tuple[float, ...] = ()  # of the ground, at each point of the line
    next: list[str] = field(default_factory=list)  # lanes that follow
    heads: list[Head] = field(default_factory=list)  # at its end
    original: tuple[str, ...] = ()  # road and lane of OpenDRIVE that it was made of, such as `0_-4`

    @property
    def centre(self) -> Floats:
        """Its line, `k x 2`, m."""
        return np.array(self.line)

    def admits(self, classes: Collection[str] | None) -> bool:
        """Whether it is a road's lane, for one of `classes` if given."""
        return self.use == "lane" and (classes is None or not self.classes.isdisjoint(classes))

    @property
    def way_in_rad(self) -> float:
        """Direction in which it begins."""
        return direction(self.line[0], self.line[1])

    @property
    def way_out_rad(self) -> float:
        """Direction in which it ends."""
        return direction(self.line[-2], self.line[-1])


@dataclass(frozen=True, eq=False)
class Edge:
    """Road in one direction; junctions' inner edges are kept as lanes alone."""

    id: str
    start: str  # junctions
    end: str
    lanes: tuple[NetLane, ...]

    @cached_property
    def drivable(self) -> tuple[NetLane, ...]:
        """Its lanes for cars, from right to left."""
        return tuple(lane for lane in self.lanes if lane.drivable)


@dataclass(frozen=True, eq=False)
class Link:
    """Connection of a lane to another, across a junction."""

    source: NetLane
    target: NetLane
    inside: tuple[NetLane, ...]  # the lanes between them
    signal: str | None
    index: int | None  # among the links of its junction

    @property
    def inside_m(self) -> float:
        """Length of the way across the junction."""
        return sum(lane.length_m for lane in self.inside)

    @cached_property
    def line(self) -> list[Point]:
        """Its way between the roads."""
        return [point for lane in self.inside for point in lane.line]

    @cached_property
    def turn_rad(self) -> float:
        """Angle by which it turns to the left."""
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
    """All of it, by id."""

    lanes: dict[str, NetLane] = field(default_factory=dict)  # also those inside junctions, and crossings
    edges: dict[str, Edge] = field(default_factory=dict)
    junctions: dict[str, Junction] = field(default_factory=dict)
    crossings: list[Crossing] = field(default_factory=list)
    onward: dict[str, list[Link]] = field(default_factory=lambda: defaultdict(list))  # by the lane they come from
    back: dict[str, list[Link]] = field(default_factory=lambda: defaultdict(list))  # by the lane they lead to
    programs: dict[str, Program] = field(default_factory=dict)  # by signal
    inside: dict[str, list[NetLane]] = field(default_factory=lambda: defaultdict(list))  # drivable, by junction
    # Inside junctions, by a lane's id: the lanes that vehicles wait for before they drive onto it.
    waits_for: dict[str, tuple[NetLane, ...]] = field(default_factory=dict)
    walkways: dict[str, list[tuple[Point, ...]]] = field(default_factory=lambda: defaultdict(list))  # by junction
    keeps_left: bool = False
    shift_m: Point = (0.0, 0.0)  # of its coordinates beside those of the file that it was converted from
    known: dict[Hashable, object] = field(default_factory=dict)  # what was found out; see `once`

    @cached_property
    def arriving(self) -> Mapping[str, list[Edge]]:
        """Edges with a lane for cars, by the junction at their end."""
        arriving = defaultdict(list)
        for edge in self.edges.values():
            if edge.drivable:
                arriving[edge.end].append(edge)
        return arriving

    @cached_property
    def crossings_of(self) -> Mapping[tuple[str, str], list[Crossing]]:
        """By junction and by an edge that they cross."""
        crossings = defaultdict(list)
        for crossing in self.crossings:
            for edge in crossing.edges:
                crossings[crossing.junction, edge].append(crossing)
        return crossings

    def are_foes(self, one: Link, other: Link) -> bool:
        """Whether the net says that two links cross or meet."""
        if one.index is None or other.index is None:
            return False
        foes = self.junctions[self.edges[one.source.edge].end].foes
        pairs = ((one.index, other.index), (other.index, one.index))
        return any(foes.get(row, "")[::-1][column : column + 1] == "1" for row, column in pairs)

    def lane(self, id_: str) -> NetLane:
        """A lane outside junctions."""
        edge, _, index = id_.rpartition("_")
        lanes = self.edges[edge].lanes
        if not 0 <= int(index) < len(lanes):
            raise ValueError(f"a connection names lane {index} of edge {edge!r}, which has {len(lanes)}")
        return lanes[int(index)]

    def neighbours(self, lane: NetLane) -> tuple[NetLane | None, NetLane | None]:
        """The lanes of the same edge to its right and left."""
        right, left = (self.lanes.get(f"{lane.edge}_{lane.index + step}") for step in (-1, 1))
        return right, left

    def letters_by_signal(self, letters: bytes) -> Mapping[str, bytes]:
        """Splits all signals' letters, which are in the order of names."""
        by_signal, begin = {}, 0
        for name, program in sorted(self.programs.items()):
            end = begin + len(program.phases[0][1])
            by_signal[name] = letters[begin:end]
            begin = end
        return by_signal

    def heights_m(self, places: Floats) -> Floats:
        """Returns heights at places, `n x 2`, of the nearest lanes, `n`."""
        lines = [np.column_stack((lane.centre, lane.height_m)) for lane in self.lanes.values()]
        starts, ends = (np.concatenate([line[cut] for line in lines]) for cut in (np.s_[:-1], np.s_[1:]))
        sides = ends - starts
        reach = places[:, None] - starts[:, :2]
        share = ((reach * sides[:, :2]).sum(axis=2) / (sides[:, :2] ** 2).sum(axis=1)).clip(0.0, 1.0)
        apart = np.linalg.norm(reach - share[:, :, None] * sides[:, :2], axis=2)
        rows, nearest = np.arange(len(places)), apart.argmin(axis=1)
        heights: Floats = starts[nearest, 2] + share[rows, nearest] * sides[nearest, 2]
        return heights


def direction(a: Point, b: Point) -> float:
    """Direction from one point to another."""
    return math.atan2(b[1] - a[1], b[0] - a[0])


def once(find: Callable[Concatenate[Net, P], T]) -> Callable[Concatenate[Net, P], T]:
    """Remembers with a net what a function has found on it."""

    @wraps(find)
    def remembered(net: Net, /, *args: P.args, **kwargs: P.kwargs) -> T:
        asked = (find, *args)
        if asked not in net.known:
            net.known[asked] = find(net, *args, **kwargs)
        return cast(T, net.known[asked])

    return remembered


@dataclass(frozen=True, slots=True)
class NetSummary:
    """Contents of a net; edges and lanes are those outside junctions."""

    edges: int
    junctions: int
    lanes: int
    length_m: float  # of the edges, each counted once however many lanes it has
    bounding_box: tuple[float, float, float, float]  # of the lanes: west, south, east, north, m


def summary(net: Net) -> NetSummary:
    """Counts and extent of a net that has an edge at least."""
    lanes = [lane for edge in net.edges.values() for lane in edge.lanes]
    x, y = zip(*(point for lane in lanes for point in lane.line), strict=True)
    return NetSummary(
        edges=len(net.edges),
        junctions=len(net.junctions),
        lanes=len(lanes),
        length_m=round(sum(edge.lanes[0].length_m for edge in net.edges.values() if edge.lanes), 3),
        bounding_box=(min(x), min(y), max(x), max(y)),
    )


def net_remarks(net: Net) -> list[str]:
    """Lists reasons why a net fits no pattern or few places."""
    remarks = []
    driven = {edge.id for edge in net.edges.values() if edge.drivable}
    if not driven:
        remarks.append("no edge has a lane for passenger cars: no pattern will fit")
    if net.keeps_left:
        remarks.append("traffic keeps to the left: no pattern will fit")
    if not net.programs:
        remarks.append("there are no traffic lights")
    if not net.onward and _roads_meet(net):
        remarks.append("there are no connections, although roads meet: no lane leads on to another")
    elif (largest := _largest_part(driven, net)) < len(driven):
        remarks.append(f"roads are disconnected: the largest part has {largest} of {len(driven)} edges for cars")
    return remarks


def _roads_meet(net: Net) -> bool:
    """Whether any road leads to another, except back from a dead end."""
    leaving = defaultdict(set)
    for edge in net.edges.values():
        if edge.drivable:
            leaving[edge.start].add(edge.end)
    return any(leaving[edge.end] - {edge.start} for edge in net.edges.values() if edge.drivable)


def _largest_part(driven: Set[str], net: Net) -> int:
    """Counts edges in the largest part connected by links or opposite directions."""
    pairs = [(link.source.edge, link.target.edge) for links in net.onward.values() for link in links]
    directions = {(net.edges[id_].start, net.edges[id_].end): id_ for id_ in driven}
    pairs += [(id_, directions[b, a]) for (a, b), id_ in directions.items() if (b, a) in directions]
    beside = defaultdict(list)
    for one, other in pairs:
        beside[one].append(other)
        beside[other].append(one)
    largest, left = 0, set(driven)
    while left:
        part = [left.pop()]
        for id_ in part:  # grows meanwhile
            new = left.intersection(beside[id_])
            left -= new
            part += new
        largest = max(largest, len(part))
    return largest
