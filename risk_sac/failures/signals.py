"""Signal heads of a scene: where they stand, and which colour they show when."""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from risk_sac.config import FamilyName
from risk_sac.failures.net import Head, Lane, Program, net_of
from risk_sac.scenario.families import family_named
from risk_sac.types import Floats

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
