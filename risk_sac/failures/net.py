"""Surfaces and signal heads of a net, as pictures and formats show them."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.scenario.families import family_named
from risk_sac.world.net import Head, Net, NetLane, Program
from risk_sac.world.read_net import read_net
from risk_sac.world.types import Floats

SurfaceUse = Literal["lane", "sidewalk", "crossing", "junction"]


@dataclass(frozen=True, slots=True)
class Surface:
    """Ground that one drives or walks on: a lane, crossing or junction."""

    use: SurfaceUse
    outline: Floats  # `k x 2`, m, a closed ring without its last point


COLOURS = {"r": "red", "u": "red_yellow", "y": "yellow", "g": "green", "o": "off", "s": "green"}


def colour(letter: str) -> str:
    """Returns the colour of one of SUMO's letters of a signal."""
    return COLOURS.get(letter.lower(), "off")


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
    """Returns the surfaces of a scene's net."""
    return shipped_surfaces(family_named(family).layout(scene).net)


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

    Lanes inside junctions overlap each other and are left out: the junction's own outline stands for them. A lane that
    is closed to cars is shown as a sidewalk.
    """
    shown = [
        Surface("junction", np.array(junction.outline))
        for junction in net.junctions.values()
        if junction.outline and junction.type != "dead_end"
    ]
    for lane in net.lanes.values():
        if lane.use != "inside":
            use: SurfaceUse = "sidewalk" if lane.use == "lane" and not lane.drivable else lane.use
            shown.append(Surface(use, ribbon(lane.centre, lane.width_m)))
    return shown


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
    """Returns the heads of a scene's signals."""
    layout = family_named(family).layout(scene)
    net, heads = shipped_net(layout.net), []
    for lane in net.lanes.values():
        if lane.heads:
            head = min(lane.heads, key=lambda head: (head.turn != "s", head.index))
            offset_s = layout.signal_offset_s if head.signal == layout.signal else 0.0
            changes = _changes(net.programs[head.signal], head, offset_s)
            heads += [SignalHead(*place, lane.width_m, changes) for place in _places(lane)]
    return heads


def _places(lane: NetLane) -> list[tuple[float, float, float]]:
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
