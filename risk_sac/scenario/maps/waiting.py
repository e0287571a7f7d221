"""Whether who waits inside a junction stands clear of those that it waits for.

SUMO lets a turning driver wait where the middle of its front comes to the edge of the lane that it is to cross. A
driver whose car stands askew there has a corner in that lane, and whoever has the right of way sees nobody and drives
into it. Whoever crosses its way before that place, or joins it, is told of it by SUMO.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

from risk_sac.scenario.ground import Point
from risk_sac.scenario.layout import CAR_LENGTH_M, CAR_WIDTH_M
from risk_sac.scenario.maps.net import Lane, Link, Net

CLEAR_M = CAR_WIDTH_M / 2 + 0.1  # of the box of who waits from the middle of a lane that others drive on
SAMPLED_M = 0.5


def waits_in_the_way(net: Net, link: Link) -> Lane | None:
    """A lane of those who have the right of way, which a car that waits for them reaches into; None if it is clear."""
    for before, behind in pairwise(link.inside):
        for lane in net.waits_for.get(behind.id, ()):
            joins = lane.line[-1] == link.inside[-1].line[-1]
            if not joins and not _cross(before.line, lane.line) and _off_m(before, lane) < CLEAR_M:
                return lane
    return None


def _off_m(waiting: Lane, other: Lane) -> float:
    """How far a lane comes from a car whose front is at the end of another; 0 if it comes within it."""
    (x, y), heading = waiting.line[-1], waiting.way_out_rad
    cos, sin = math.cos(heading), math.sin(heading)
    least_m = math.inf
    for px, py in _sampled(other):
        ahead_m = (px - x) * cos + (py - y) * sin
        aside_m = abs((py - y) * cos - (px - x) * sin)
        off_m = math.hypot(max(ahead_m, -CAR_LENGTH_M - ahead_m, 0.0), max(aside_m - CAR_WIDTH_M / 2, 0.0))
        least_m = min(least_m, off_m)
    return least_m


def _sampled(lane: Lane) -> list[Point]:
    found = []
    for (ax, ay), (bx, by) in pairwise(lane.line):
        steps = max(math.ceil(math.hypot(bx - ax, by - ay) / SAMPLED_M), 1)
        found += [(ax + i / steps * (bx - ax), ay + i / steps * (by - ay)) for i in range(steps + 1)]
    return found


def _cross(line: Sequence[Point], other: Sequence[Point]) -> bool:
    return any(_segments_cross(*a, *b) for a in pairwise(line) for b in pairwise(other))


def _segments_cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    return _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0


def _side(a: Point, b: Point, c: Point) -> float:
    """Above 0 where a point is to the left of a line."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
