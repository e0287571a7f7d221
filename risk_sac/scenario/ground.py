"""Ground of a net: convex polygons, kerbs, and room between vehicles.

A vehicle lies along the chord from its front to where its rear passes. Round a bend the chord is shorter than the
way, so its tail swings out; and between the two the chord cuts the corner.

Ways from lanes beside each other are no foes of one another where they do not cross: SUMO's drivers ignore each other
there. Where netconvert bends both sharply, they come nearer to each other than cars are wide.

SUMO lets a turning driver wait where the middle of its front reaches the edge of the lane that it is to cross. A car
that stands askew there has a corner in that lane, and a driver with the right of way does not see it. SUMO does warn a
driver that crosses its way before that place, or joins it.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, lru_cache
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.scenario import layout
from risk_sac.world.net import Crossing, Link, Net, NetLane, once
from risk_sac.world.read_net import parse_net, read_tree
from risk_sac.world.types import Floats, Point

SAMPLED_M = 0.5
ALONG = 9  # points on each side of it
ROOM_M = layout.CAR_WIDTH_M + 0.15  # between the middles of the ways of two cars
SPARE_M = layout.CAR_WIDTH_M / 2 + 0.1  # of the box of a waiting vehicle from the middle of a lane that others drive on


def outlines(link: Link, length_m: float, width_m: float) -> Floats:
    """Samples a vehicle's sides along its way; x and y rows, m."""
    line = np.array([*link.source.line, *link.line, *link.target.line])
    station_m = _stations_m(line)
    stop_m = station_m[len(link.source.line) - 1]
    entry_m = station_m[len(link.source.line) + len(link.line)]
    front_m = np.arange(stop_m, min(entry_m + length_m, station_m[-1]), SAMPLED_M)

    front, rear = (_points(line, station_m, at_m) for at_m in (front_m, np.maximum(front_m - length_m, 0.0)))
    (dx, dy), chord_m = front - rear, np.hypot(*(front - rear))
    forward, left = np.array([dx, dy]) / chord_m, np.array([-dy, dx]) / chord_m
    middle = front[:, :, None] - forward[:, :, None] * np.linspace(0.0, length_m, ALONG)
    sides = [middle + side * width_m / 2 * left[:, :, None] for side in (1.0, -1.0)]
    return np.concatenate([each.reshape(2, -1) for each in sides], axis=1)


def is_near(line: Sequence[Point], x_m: float, y_m: float, within_m: float) -> bool:
    """Whether a line comes so near to a point."""
    for (ax, ay), (bx, by) in pairwise(line):
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        share = 0.0 if square == 0.0 else min(max(((x_m - ax) * dx + (y_m - ay) * dy) / square, 0.0), 1.0)
        if math.hypot(ax + share * dx - x_m, ay + share * dy - y_m) <= within_m:
            return True
    return False


@once
def too_near(net: Net, link: Link) -> Link | None:
    """Finds a neighbouring way across a junction too near for two cars."""
    lanes = net.edges[link.source.edge].lanes
    for lane in lanes[max(link.source.index - 1, 0) : link.source.index + 2]:
        for other in net.onward.get(lane.id, ()):
            beside = lane is not link.source and other.target.edge == link.target.edge
            if beside and other.target is not link.target and _come_near(link.line, other.line):
                return other
    return None


def truck_reaches(net: Net, beside: Link, own: Link) -> bool:
    """Whether a truck reaches into a car on the way beside it.

    Both cross the junction. Where their lanes fork into several of the next road, SUMO's drivers may take any of them.
    """
    ways = [[*each.source.line, *each.line, *each.target.line] for each in _forks(net, own)]
    points = np.concatenate(
        [outlines(each, layout.TRUCK_LENGTH_M, layout.TRUCK_WIDTH_M) for each in _forks(net, beside)], axis=1
    )
    return any(is_near(way, x, y, layout.CAR_WIDTH_M / 2) for way in ways for x, y in points.T.tolist())


def _forks(net: Net, link: Link) -> list[Link]:
    return [other for other in net.onward[link.source.id] if other.target.edge == link.target.edge]


def _come_near(line: Sequence[Point], other: Sequence[Point]) -> bool:
    return any(is_near(other, *point, ROOM_M) for point in line) or any(
        is_near(line, *point, ROOM_M) for point in other
    )


def waits_in_the_way(net: Net, link: Link) -> NetLane | None:
    """Finds a priority lane that a waiting car reaches into, or None."""
    for before, behind in pairwise(link.inside):
        for lane in net.waits_for.get(behind.id, ()):
            joins = lane.line[-1] == link.inside[-1].line[-1]
            if not joins and not _cross(before.line, lane.line) and _off_m(before, lane) < SPARE_M:
                return lane
    return None


def _off_m(waiting: NetLane, other: NetLane) -> float:
    """Computes a lane's distance from a car at another lane's end.

    It is 0 if the lane comes within the waiting car.
    """
    (x, y), heading = waiting.line[-1], waiting.way_out_rad
    cos, sin = math.cos(heading), math.sin(heading)
    dx, dy = _sampled(np.array(other.line)) - np.array([[x], [y]])
    ahead_m, aside_m = dx * cos + dy * sin, np.abs(dy * cos - dx * sin)
    off_x = np.maximum(np.maximum(ahead_m, -layout.CAR_LENGTH_M - ahead_m), 0.0)
    return float(np.hypot(off_x, np.maximum(aside_m - layout.CAR_WIDTH_M / 2, 0.0)).min())


def _sampled(line: Floats) -> Floats:
    """Returns points along a line, with corners; x and y rows, m."""
    station_m = _stations_m(line)
    return _points(line, station_m, np.union1d(station_m, np.arange(0.0, station_m[-1], SAMPLED_M)))


def _stations_m(line: Floats) -> Floats:
    return np.concatenate([[0.0], np.hypot(*np.diff(line, axis=0).T).cumsum()])


def _points(line: Floats, station_m: Floats, at_m: Floats) -> Floats:
    """Returns a line's points at distances along it; x, y rows, m."""
    return np.array([np.interp(at_m, station_m, each) for each in line.T])


def _cross(line: Sequence[Point], other: Sequence[Point]) -> bool:
    return any(
        _side(a, b, c) * _side(a, b, d) < 0.0 and _side(c, d, a) * _side(c, d, b) < 0.0
        for a, b in pairwise(line)
        for c, d in pairwise(other)
    )


def _side(a: Point, b: Point, c: Point) -> float:
    """Above 0 where a point is to the left of a line."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


CROSSINGS_M = 60.0  # crossings up to this far from a place are recorded
WALKED_M = 40.0  # a pedestrian's longest way in an episode
JUNCTIONS_M = 120.0
KERB_M = 0.05  # of the crossing before its ends: a pedestrian at the kerb is on the road's edge
CLEAR_M, MOST_BACK_M = 0.3, 5.0  # of the kerb from cars that turn across it, and how far it is moved for that
BESIDE_M = 1.9 + 0.25  # from the crossing's axis, that a pedestrian may reach
LEGS = 3  # of a junction where ways can cross
GROUND_FILE = "ground.json"  # beside a net: its ground, where that was measured by hand
Polygons = Sequence[Sequence[Point]]


@lru_cache(maxsize=64)
def net_of(file: str) -> Net:
    """Reads a net below `sumo_nets/` or at an absolute path; raises `MapError`."""
    return parse_net(read_tree(Path(str(files("sumo_nets"))) / file))


class GroundAreas(NamedTuple):
    """Areas where vehicles and pedestrians meet."""

    crossings: tuple[layout.Area, ...] = ()  # for pedestrians; drivers yield there
    roadway: tuple[layout.Area, ...] = ()  # where vehicles drive, as far as pedestrians may get there
    junctions: tuple[layout.Area, ...] = ()  # where the ways of vehicles cross


@cache
def ground_of(file: str, places: tuple[Point, ...], *, walked: bool) -> GroundAreas:
    """Returns the ground of a net around places, x and y, m.

    Beside the file may lie a `ground.json`, which says it for the whole net. Crossings and roadway are left out if no
    pedestrian may get there.
    """
    measured = Path(str(files("sumo_nets"))) / Path(file).parent / GROUND_FILE
    if measured.exists():
        return GroundAreas(
            **{name: layout.areas(corners) for name, corners in json.loads(measured.read_bytes()).items()}
        )
    net = net_of(file)
    kinds: tuple[list[Sequence[Point]], ...] = [], [], []
    for x_m, y_m in places:
        for polygons, new in zip(kinds, _around(net, x_m, y_m, walked=walked), strict=True):
            polygons += [polygon for polygon in _rounded(new) if polygon not in polygons]
    return GroundAreas(*map(layout.areas, kinds))


def _around(net: Net, x_m: float, y_m: float, *, walked: bool) -> tuple[Polygons, Polygons, Polygons]:
    """Crossings, roadway and junctions around a point."""
    junctions = [
        triangle
        for junction in net.junctions.values()
        if math.hypot(junction.x_m - x_m, junction.y_m - y_m) <= JUNCTIONS_M and len(junction.foes) >= LEGS
        for triangle in layout.triangles(junction.outline)
    ]
    if not walked:
        return [], [], junctions
    crossings = [
        quad
        for crossing in net.crossings
        if is_near(crossing.line, x_m, y_m, CROSSINGS_M)
        for quad in layout.ribbon(crossing.line, crossing.width_m)
    ]
    lanes = [lane for edge in net.edges.values() for lane in edge.drivable if is_near(lane.line, x_m, y_m, WALKED_M)]
    for junction in net.junctions.values():
        if math.hypot(junction.x_m - x_m, junction.y_m - y_m) <= 3 * WALKED_M:
            lanes += [lane for lane in net.inside.get(junction.id, ()) if is_near(lane.line, x_m, y_m, WALKED_M)]
    quads = (quad for lane in lanes for quad in layout.ribbon(lane.line, lane.width_m))
    return crossings, [quad for quad in quads if is_near((*quad, quad[0]), x_m, y_m, WALKED_M)], junctions


def _rounded(polygons: Iterable[Sequence[Point]]) -> Iterator[tuple[Point, ...]]:
    return (tuple((round(x, 3), round(y, 3)) for x, y in polygon) for polygon in polygons)


class Kerb(NamedTuple):
    """The end of a way across a road."""

    x_m: float
    y_m: float
    along_x: float  # unit vector across the road
    along_y: float


def kerb_of(net: Net, crossing: Crossing, driven_rad: float) -> Kerb:
    """Returns the kerb of a crossing on a driver's right.

    Where cars turn round the corner across the end of a crossing, the kerb is beyond them, so a waiting pedestrian is
    clear.
    """
    right = (math.sin(driven_rad), -math.cos(driven_rad))
    (x0, y0), (x1, y1) = crossing.line[0], crossing.line[-1]
    line = crossing.line if (x0 - x1) * right[0] + (y0 - y1) * right[1] >= 0.0 else crossing.line[::-1]
    (x, y), (to_x, to_y) = line[0], line[1]
    length = math.hypot(to_x - x, to_y - y)
    kerb = Kerb(x, y, (to_x - x) / length, (to_y - y) / length)
    back_m = _turned_over_m(net, crossing.junction, kerb) - KERB_M
    return kerb._replace(x_m=x - kerb.along_x * back_m, y_m=y - kerb.along_y * back_m)


def _turned_over_m(net: Net, junction: str, kerb: Kerb) -> float:
    """Computes how far a kerb moves back clear of turning cars, m."""
    links = [link for edge in net.arriving[junction] for lane in edge.drivable for link in net.onward.get(lane.id, ())]
    if not links:
        return 0.0
    x, y = np.concatenate([outlines(link, layout.CAR_LENGTH_M, layout.CAR_WIDTH_M) for link in links], axis=1)
    along_m = (x - kerb.x_m) * kerb.along_x + (y - kerb.y_m) * kerb.along_y
    across_m = (y - kerb.y_m) * kerb.along_x - (x - kerb.x_m) * kerb.along_y
    met = (np.abs(across_m) <= BESIDE_M) & (along_m >= -MOST_BACK_M) & (along_m < CLEAR_M)
    return min(float(CLEAR_M - along_m[met].min()), MOST_BACK_M) if met.any() else 0.0
