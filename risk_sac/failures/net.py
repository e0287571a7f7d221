"""Reads of a SUMO net what pictures and formats need: surfaces, lanes with successors, and the signals' programs."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.scenario.families import family_named
from risk_sac.types import Floats

SurfaceUse = Literal["lane", "sidewalk", "crossing", "junction"]
LaneUse = Literal["road", "inside", "sidewalk", "crossing"]
SURFACES: Mapping[LaneUse, SurfaceUse] = {"road": "lane", "sidewalk": "sidewalk", "crossing": "crossing"}
DEFAULT_WIDTH_M = 3.2  # of a lane without one, as in SUMO


@dataclass(frozen=True, slots=True)
class Surface:
    """Ground that one drives or walks on: a lane, crossing or junction."""

    use: SurfaceUse
    outline: Floats  # `k x 2`, m, a closed ring without its last point


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """A link's place in the letters of a signal."""

    signal: str
    index: int
    turn: str  # SUMO's letter of where the link goes: s, l, r and others


@dataclass(slots=True, kw_only=True)
class Lane:
    """A lane of a road, inside a junction, for walking, or a crossing."""

    id: str
    edge: str
    index: int  # 0 is the rightmost
    use: LaneUse
    centre: Floats  # `k x 2`, m
    width_m: float
    speed_mps: float
    next: list[str] = field(default_factory=list)  # lanes that follow
    heads: list[Head] = field(default_factory=list)  # at its end


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
        """Returns the letters a moment before a time since the start of the cycle, as in SUMO's own step."""
        left = (time_s - 1e-6 - self.offset_s) % self.cycle_s
        for duration, letters in self.phases:
            if left < duration:
                return letters
            left -= duration
        return self.phases[-1][1]


@dataclass(frozen=True, slots=True)
class Net:
    """A road network."""

    lanes: Mapping[str, Lane]
    signals: Mapping[str, Program]
    junctions: Sequence[Floats]  # outlines, `k x 2`, m

    def neighbours(self, lane: Lane) -> tuple[Lane | None, Lane | None]:
        """The lanes of the same edge to its right and to its left."""
        right, left = (self.lanes.get(f"{lane.edge}_{lane.index + step}") for step in (-1, 1))
        return right, left


def read_net(file: Path) -> Net:
    """Reads a net of ours, or one that was checked when it was uploaded."""
    root = ET.parse(file).getroot()
    lanes = {lane.id: lane for edge in root.iter("edge") for lane in _lanes(edge)}
    for connection in root.iter("connection"):
        _connect(lanes, connection)
    signals = {
        logic.get("id", ""): Program(
            [(float(phase.get("duration", "0")), phase.get("state", "")) for phase in logic.iter("phase")],
            float(logic.get("offset", "0")),
        )
        for logic in root.iter("tlLogic")
    }
    junctions = [
        _points(junction.get("shape", ""))
        for junction in root.iter("junction")
        if junction.get("type") not in ("internal", "dead_end")
    ]
    return Net(lanes, signals, junctions)


def _points(shape: str) -> Floats:
    """Returns `k x 2` of "x,y x,y ..."; a height, where given, is dropped."""
    return np.array([[float(value) for value in point.split(",")[:2]] for point in shape.split()]).reshape(-1, 2)


def _lanes(edge: ET.Element) -> list[Lane]:
    function = edge.get("function", "normal")
    if function == "walkingarea":
        return []
    return [
        Lane(
            id=lane.get("id", ""),
            edge=edge.get("id", ""),
            index=int(lane.get("index", "0")),
            use=_use(function, lane),
            centre=_points(lane.get("shape", "")),
            width_m=float(lane.get("width", DEFAULT_WIDTH_M)),
            speed_mps=float(lane.get("speed", "13.89")),
        )
        for lane in edge.iter("lane")
    ]


def _use(function: str, lane: ET.Element) -> LaneUse:
    if function == "crossing":
        return "crossing"
    if lane.get("allow") == "pedestrian":
        return "sidewalk"
    return "inside" if function == "internal" else "road"


def _connect(lanes: Mapping[str, Lane], connection: ET.Element) -> None:
    """Follows a connection by way of the lane inside the junction, if it has one."""
    ends = [f"{connection.get(end)}_{connection.get(f'{end}Lane')}" for end in ("from", "to")]
    signal, via, turn = connection.get("tl"), connection.get("via"), connection.get("dir", "s").lower()
    head = None if signal is None else Head(signal=signal, index=int(connection.get("linkIndex", "0")), turn=turn)
    if ends[1] in lanes and lanes[ends[1]].use == "crossing":
        lanes[ends[1]].heads += [head] if head else []  # it comes from a walking area, which is no lane here
    if ends[0] not in lanes:
        return
    start = lanes[ends[0]]
    after = via or ends[1]
    if after in lanes and after not in start.next:
        start.next.append(after)
    if head is not None:
        start.heads.append(head)


def boundaries(centre: Floats, width_m: float) -> tuple[Floats, Floats]:
    """Returns the left and the right edge of a lane, `k x 2` each, mitred where sides meet."""
    sides = np.diff(centre, axis=0)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    normals = np.column_stack((-sides[:, 1], sides[:, 0]))
    before, after = np.vstack((normals[:1], normals)), np.vstack((normals, normals[-1:]))
    mitre = before + after
    mitre /= (1.0 + (before * after).sum(axis=1, keepdims=True)).clip(min=0.5)
    return centre + mitre * width_m / 2, centre - mitre * width_m / 2


def roads_of(family: FamilyName, scene: Mapping[str, float]) -> Sequence[Surface]:
    """Returns the surfaces of a scene's net; none where the scene lacks parameters that its family has now."""
    found = family_named(family)
    return _shipped(found.layout(scene).net) if set(found.space.names) <= scene.keys() else ()


@cache  # there are a few nets, and they stay as they are
def _shipped(name: str) -> Sequence[Surface]:
    return surfaces(read_net(Path(sumo_nets.__path__[0]) / name))


def surfaces(net: Net) -> Sequence[Surface]:
    """Returns the surfaces of a net, junctions first so that lanes are drawn over them.

    Lanes inside junctions overlap each other and are left out: the junction's own outline stands for them.
    """
    found = [Surface("junction", outline) for outline in net.junctions]
    for lane in net.lanes.values():
        if lane.use == "crossing" or not lane.edge.startswith(":"):
            found.append(Surface(SURFACES[lane.use], _ribbon(lane.centre, lane.width_m)))
    return found


def _ribbon(centre: Floats, width_m: float) -> Floats:
    """Returns the outline, `2k x 2`, of a ribbon along a line; each point is moved across the line's direction."""
    along = np.gradient(centre, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    left = np.column_stack((-along[:, 1], along[:, 0])) * width_m / 2
    return np.concatenate((centre + left, (centre - left)[::-1]))
