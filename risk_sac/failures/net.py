"""Reads of a SUMO net what pictures and formats need."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import sumolib.net

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.scenario.families import family_named
from risk_sac.world.types import Floats

SurfaceUse = Literal["lane", "sidewalk", "crossing", "junction"]
LaneUse = Literal["lane", "inside", "sidewalk", "crossing"]


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
    height_m: Floats  # `k`, of the ground
    width_m: float
    limit_mps: float
    next: list[str] = field(default_factory=list)  # lanes that follow
    heads: list[Head] = field(default_factory=list)  # at its end


COLOURS = {"r": "red", "u": "red_yellow", "y": "yellow", "g": "green", "o": "off", "s": "green"}


def colour(letter: str) -> str:
    """Returns the colour of one of SUMO's letters of a signal."""
    return COLOURS.get(letter.lower(), "off")


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


@dataclass(frozen=True, slots=True)
class Net:
    """A road network."""

    lanes: Mapping[str, Lane]
    signals: Mapping[str, Program]
    junctions: Sequence[Floats]  # outlines, `k x 2`, m

    def by_signal(self, letters: bytes) -> Mapping[str, bytes]:
        """Returns the letters of each signal; `letters` has those of all, in the order of their names."""
        found, begin = {}, 0
        for name, program in sorted(self.signals.items()):
            end = begin + len(program.phases[0][1])
            found[name] = letters[begin:end]
            begin = end
        return found

    def neighbours(self, lane: Lane) -> tuple[Lane | None, Lane | None]:
        """The lanes of the same edge to its right and to its left."""
        right, left = (self.lanes.get(f"{lane.edge}_{lane.index + step}") for step in (-1, 1))
        return right, left

    def heights_m(self, places: Floats) -> Floats:
        """Returns the heights at places, `n x 2`: those of the nearest lanes' middles, `n`."""
        lines = [np.column_stack((lane.centre, lane.height_m)) for lane in self.lanes.values()]
        starts, ends = (np.concatenate([line[cut] for line in lines]) for cut in (np.s_[:-1], np.s_[1:]))
        sides = ends - starts
        reach = places[:, None] - starts[:, :2]
        share = ((reach * sides[:, :2]).sum(axis=2) / (sides[:, :2] ** 2).sum(axis=1)).clip(0.0, 1.0)
        apart = np.linalg.norm(reach - share[:, :, None] * sides[:, :2], axis=2)
        rows, nearest = np.arange(len(places)), apart.argmin(axis=1)
        heights: Floats = starts[nearest, 2] + share[rows, nearest] * sides[nearest, 2]
        return heights


def read_net(file: Path) -> Net:
    """Reads a net of ours, or one that was checked when it was uploaded."""
    found = sumolib.net.readNet(str(file), withPedestrianConnections=True, withLatestPrograms=True)
    every = [lane for edge in found.getEdges() for lane in edge.getLanes()]
    lanes = {lane.getID(): _lane(lane) for lane in every if lane.getEdge().getFunction() != "walkingarea"}
    for lane in every:
        for connection in lane.getOutgoing():
            _connect(lanes, connection)
    signals = {}
    for light in found.getTrafficLights():
        for program in light.getPrograms().values():  # the latest alone
            phases = [(phase.duration, phase.state) for phase in program.getPhases()]
            signals[light.getID()] = Program(phases, program.getOffset())
    nodes = [node for node in found.getNodes() if node.getType() != "dead_end"]
    return Net(lanes, signals, [np.array(node.getShape()) for node in nodes])


def _lane(lane: Any) -> Lane:
    edge, shape = lane.getEdge(), np.array(lane.getShape3D())
    uses: Mapping[str, LaneUse] = {"crossing": "crossing", "internal": "inside"}
    walks = set(lane.getPermissions()) == {"pedestrian"} and edge.getFunction() != "crossing"
    return Lane(
        id=lane.getID(),
        edge=edge.getID(),
        index=lane.getIndex(),
        use="sidewalk" if walks else uses.get(edge.getFunction(), "lane"),
        centre=shape[:, :2],
        height_m=shape[:, 2],
        width_m=lane.getWidth(),
        limit_mps=lane.getSpeed(),
    )


def _connect(lanes: Mapping[str, Lane], connection: Any) -> None:
    """Follows a connection by way of the lane inside the junction, if it has one."""
    start, end = (lanes.get(lane.getID()) for lane in (connection.getFromLane(), connection.getToLane()))
    signal = connection.getTLSID()
    head = Head(signal=signal, index=connection.getTLLinkIndex(), turn=connection.getDirection().lower())
    after = connection.getViaLaneID() or connection.getToLane().getID()
    if start is not None and after in lanes and after not in start.next:
        start.next.append(after)
    if signal and end is not None and end.use == "crossing":
        end.heads.append(head)  # it comes from a walking area, which is no lane here
    elif signal and start is not None:
        start.heads.append(head)


def boundaries(centre: Floats, width_m: float) -> tuple[Floats, Floats]:
    """Returns the left and the right edge of a lane, `k x 2` each."""
    return moved(centre, width_m / 2), moved(centre, -width_m / 2)


def moved(centre: Floats, left_m: float) -> Floats:
    """Returns a line, `k x 2`, moved to the left, mitred where its sides meet."""
    sides = np.diff(centre, axis=0)
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    normals = np.column_stack((-sides[:, 1], sides[:, 0]))
    before, after = np.vstack((normals[:1], normals)), np.vstack((normals, normals[-1:]))
    mitre = before + after
    mitre /= (1.0 + (before * after).sum(axis=1, keepdims=True)).clip(min=0.5)
    line: Floats = centre + mitre * left_m
    return line


def ribbon(centre: Floats, width_m: float) -> Floats:
    """Returns the outline of a lane, `2k x 2`: its left edge, and its right edge back."""
    left, right = boundaries(centre, width_m)
    return np.concatenate((left, right[::-1]))


def roads_of(family: FamilyName, scene: Mapping[str, float]) -> Sequence[Surface]:
    """Returns the surfaces of a scene's net; none where the scene lacks parameters that its family has now."""
    found = family_named(family)
    return shipped_surfaces(found.layout(scene).net) if set(found.space.names) <= scene.keys() else ()


def net_of(family: FamilyName, scene: Mapping[str, float]) -> Net | None:
    """Returns a scene's net; None where the scene lacks parameters that its family has now."""
    found = family_named(family)
    return shipped_net(found.layout(scene).net) if set(found.space.names) <= scene.keys() else None


@cache  # there are a few nets, and they stay as they are
def shipped_net(name: str) -> Net:
    """Returns a net by its file's name."""
    return read_net(Path(sumo_nets.__path__[0]) / name)


@cache
def shipped_surfaces(name: str) -> Sequence[Surface]:
    """Returns the surfaces of a net by its file's name."""
    return surfaces(shipped_net(name))


def surfaces(net: Net) -> Sequence[Surface]:
    """Returns the surfaces of a net, junctions first so that lanes are drawn over them.

    Lanes inside junctions overlap each other and are left out: the junction's own outline stands for them.
    """
    found = [Surface("junction", outline) for outline in net.junctions]
    for lane in net.lanes.values():
        if lane.use != "inside":
            found.append(Surface(lane.use, ribbon(lane.centre, lane.width_m)))
    return found


SignalColour = Literal["red", "yellow", "green", "off"]
Changes = Sequence[tuple[float, SignalColour]]
SHOWN_S = 60.0  # more than the longest episode
A_MOMENT_S = 1e-6  # as in `Program.letters`
OPEN = 0.25  # share of the lane's width, from each side, that a green signal's mark covers
LETTERS: Mapping[str, SignalColour] = {"r": "red", "u": "yellow", "y": "yellow", "g": "green", "s": "green"}
LAMPS: Mapping[SignalColour, str] = {"red": "#e5484d", "yellow": "#f5b700", "green": "#30a46c", "off": "#808080"}


@dataclass(frozen=True, slots=True)
class SignalHead:
    """The signal at the end of a lane, or at one end of a crossing."""

    x_m: float
    y_m: float
    heading_rad: float  # along the lane
    width_m: float
    changes: Changes  # when it begins to show a colour; 0 s is the start of the episode

    def colour(self, time_s: float) -> SignalColour:
        """Returns the colour that a frame at this time shows."""
        begun = bisect_left([at for at, _ in self.changes], time_s - A_MOMENT_S)
        return self.changes[max(begun - 1, 0)][1]

    def marks(self, time_s: float) -> list[Floats]:
        """Returns lines across the lane, `2 x 2` each.

        One closes it; where it is green there is an end on each side.
        """
        across = np.array((-np.sin(self.heading_rad), np.cos(self.heading_rad))) * self.width_m / 2
        ends = ((-1.0, 1.0),) if self.colour(time_s) != "green" else ((-1.0, 2 * OPEN - 1), (1 - 2 * OPEN, 1.0))
        return [np.array((self.x_m, self.y_m)) + np.outer(pair, across) for pair in ends]


def signal_heads(family: FamilyName, scene: Mapping[str, float]) -> Sequence[SignalHead]:
    """Returns the heads of a scene's signals; none where the scene lacks parameters that its family has now."""
    net = net_of(family, scene)
    if net is None:
        return ()
    layout = family_named(family).layout(scene)
    found = []
    for lane in net.lanes.values():
        if lane.heads:
            head = min(lane.heads, key=lambda head: (head.turn != "s", head.index))
            offset_s = layout.signal_offset_s if head.signal == layout.signal else 0.0
            changes = _changes(net.signals[head.signal], head, offset_s)
            found += [SignalHead(*place, lane.width_m, changes) for place in _places(lane)]
    return found


def _places(lane: Lane) -> list[tuple[float, float, float]]:
    """Returns x, y and heading at the end of a lane.

    A crossing is entered from both sides, so it has two.
    """
    ends = [(lane.centre[-1], lane.centre[-1] - lane.centre[-2])]
    if lane.use == "crossing":
        ends.append((lane.centre[0], lane.centre[0] - lane.centre[1]))
    return [(float(x), float(y), float(np.arctan2(*along[::-1]))) for (x, y), along in ends]


def _changes(program: Program, head: Head, offset_s: float) -> Changes:
    """Returns when a link's colour changes, from the cycle that runs at the start."""
    changes: list[tuple[float, SignalColour]] = []
    time_s = -((offset_s - program.offset_s) % program.cycle_s)
    while time_s < SHOWN_S:
        for duration_s, letters in program.phases:
            colour = LETTERS.get(letters[head.index].lower(), "off")
            if not changes or changes[-1][1] != colour:
                changes.append((time_s, colour))
            time_s += duration_s
    return changes
