"""Whether two can drive across a junction beside each other.

Ways from lanes beside each other are no foes of one another where they do not cross: SUMO's drivers mind nobody there.
Where netconvert bends both sharply, they come nearer to each other than cars are wide. And a long vehicle lies along
the chord from its front to where its rear comes by; round a bend the chord is shorter than it, so its tail swings out.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from risk_sac.scenario.ground import Point
from risk_sac.scenario.maps.around import is_near
from risk_sac.scenario.maps.net import Link, Net

CAR_WIDTH_M = 1.85
ROOM_M = CAR_WIDTH_M + 0.15  # between the middles of the ways of two cars
TRUCK_LENGTH_M, TRUCK_WIDTH_M = 8.0, 2.4
SAMPLED_M = 0.5


def too_near(net: Net, link: Link) -> Link | None:
    """The way beside one across a junction that leaves two cars no room, if there is one."""
    line, lanes = _inside(link), net.edges[link.source.edge].lanes
    for lane in lanes[max(link.source.index - 1, 0) : link.source.index + 2]:
        for other in net.onward.get(lane.id, ()):
            beside = lane is not link.source and other.target.edge == link.target.edge
            if beside and other.target is not link.target and _come_near(line, _inside(other)):
                return other
    return None


def truck_reaches(net: Net, beside: Link, own: Link) -> bool:
    """Whether a truck that drives one way across a junction reaches into a car on the way beside it.

    Where their lanes fork into several of the next road, SUMO's drivers may take any of them.
    """
    ways = [[*each.source.line, *_inside(each), *each.target.line] for each in _forks(net, own)]
    points = [point for each in _forks(net, beside) for point in _outlines(each)]
    return any(is_near(way, *point, CAR_WIDTH_M / 2) for way in ways for point in points)


def _forks(net: Net, link: Link) -> list[Link]:
    return [other for other in net.onward[link.source.id] if other.target.edge == link.target.edge]


def _outlines(link: Link) -> Iterator[Point]:
    """Points on both sides of a truck, wherever it is on its way."""
    x, y = np.array([*link.source.line, *_inside(link), *link.target.line]).T
    station_m = np.concatenate([[0.0], np.hypot(np.diff(x), np.diff(y)).cumsum()])
    stop_m = station_m[len(link.source.line) - 1]
    entry_m = station_m[len(link.source.line) + len(_inside(link))]
    for front_m in np.arange(stop_m, min(entry_m + TRUCK_LENGTH_M, station_m[-1]), SAMPLED_M):
        at_m = (front_m, max(front_m - TRUCK_LENGTH_M, 0.0))
        (front_x, rear_x), (front_y, rear_y) = np.interp(at_m, station_m, x), np.interp(at_m, station_m, y)
        heading = math.atan2(front_y - rear_y, front_x - rear_x)
        cos, sin = math.cos(heading), math.sin(heading)
        for back_m in np.linspace(0.0, TRUCK_LENGTH_M, 9):
            for left_m in (TRUCK_WIDTH_M / 2, -TRUCK_WIDTH_M / 2):
                yield float(front_x - back_m * cos - left_m * sin), float(front_y - back_m * sin + left_m * cos)


def _inside(link: Link) -> list[Point]:
    return [point for lane in link.inside for point in lane.line]


def _come_near(line: Sequence[Point], other: Sequence[Point]) -> bool:
    return any(is_near(other, *point, ROOM_M) for point in line) or any(
        is_near(line, *point, ROOM_M) for point in other
    )
