"""Whether two can drive across a junction beside each other.

Ways from lanes beside each other to lanes beside each other are no foes of one another: SUMO's drivers mind nobody there.
Where netconvert bends both sharply, they come nearer to each other than cars are wide.
"""

from collections.abc import Sequence

from risk_sac.scenario.ground import Point
from risk_sac.scenario.maps.around import is_near
from risk_sac.scenario.maps.net import Link, Net

ROOM_M = 2.2  # between the middles of a car's way and a truck's: half of 1.85 m and of 2.4 m, and a bit


def too_near(net: Net, link: Link) -> Link | None:
    """The way beside one across a junction that leaves no room between the two, if there is one."""
    lanes = net.edges[link.source.edge].lanes
    for lane in lanes[max(link.source.index - 1, 0) : link.source.index + 2]:
        for other in net.onward.get(lane.id, ()):
            beside = lane is not link.source and other.target.edge == link.target.edge
            if beside and other.target is not link.target and _come_near(_line(link), _line(other)):
                return other
    return None


def _line(link: Link) -> list[Point]:
    return [point for lane in link.inside for point in lane.line]


def _come_near(line: Sequence[Point], other: Sequence[Point]) -> bool:
    return any(is_near(other, *point, ROOM_M) for point in line) or any(
        is_near(line, *point, ROOM_M) for point in other
    )
