"""Whether two can drive across a junction beside each other.

Ways from lanes beside each other are no foes of one another where they do not cross: SUMO's drivers mind nobody there.
Where netconvert bends both sharply, they come nearer to each other than cars are wide. And the tail of a long vehicle
swings out.
"""

from collections.abc import Sequence

import numpy as np

from risk_sac.scenario.ground import Point
from risk_sac.scenario.layout import CAR_WIDTH_M, TRUCK_LENGTH_M, TRUCK_WIDTH_M
from risk_sac.scenario.maps.around import is_near
from risk_sac.scenario.maps.net import Link, Net
from risk_sac.scenario.maps.swept import inside, outlines

ROOM_M = CAR_WIDTH_M + 0.15  # between the middles of the ways of two cars


def too_near(net: Net, link: Link) -> Link | None:
    """The way beside one across a junction that leaves two cars no room, if there is one."""
    line, lanes = inside(link), net.edges[link.source.edge].lanes
    for lane in lanes[max(link.source.index - 1, 0) : link.source.index + 2]:
        for other in net.onward.get(lane.id, ()):
            beside = lane is not link.source and other.target.edge == link.target.edge
            if beside and other.target is not link.target and _come_near(line, inside(other)):
                return other
    return None


def truck_reaches(net: Net, beside: Link, own: Link) -> bool:
    """Whether a truck that drives one way across a junction reaches into a car on the way beside it.

    Where their lanes fork into several of the next road, SUMO's drivers may take any of them.
    """
    ways = [[*each.source.line, *inside(each), *each.target.line] for each in _forks(net, own)]
    points = np.concatenate([outlines(each, TRUCK_LENGTH_M, TRUCK_WIDTH_M) for each in _forks(net, beside)], axis=1)
    return any(is_near(way, x, y, CAR_WIDTH_M / 2) for way in ways for x, y in points.T.tolist())


def _forks(net: Net, link: Link) -> list[Link]:
    return [other for other in net.onward[link.source.id] if other.target.edge == link.target.edge]


def _come_near(line: Sequence[Point], other: Sequence[Point]) -> bool:
    return any(is_near(other, *point, ROOM_M) for point in line) or any(
        is_near(line, *point, ROOM_M) for point in other
    )
