"""Places on the lanes of a SUMO net, and ways from edge to edge."""

import itertools
import math
from collections.abc import Collection, Iterable, Sequence
from functools import lru_cache
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
import shapely

from risk_sac.scenario.travel_line import Pose, TravelLine, line_of
from risk_sac.world.net import Link, Net, NetLane, once
from risk_sac.world.types import Floats

FARTHEST_M = 30.0  # of a pose from the line of its lane
TURNED_M = 3.0  # choice: what a lane at right angles to a pose is farther away by than one along it


class LanePlace(NamedTuple):
    """Place on a lane of the SUMO net."""

    lane: NetLane
    at_m: float  # along the lane's line
    left_m: float  # of the lane's line


class _Pieces(NamedTuple):
    """Straight pieces of the lines of all lanes for cars."""

    lanes: list[NetLane]
    rows: Floats  # x, y, cos, sin, length and station of each
    tree: shapely.STRtree  # of the pieces


@once
def _pieces(net: Net) -> _Pieces:
    lanes, rows = list[NetLane](), [np.empty((0, 6))]
    for lane in net.lanes.values():
        if lane.drivable and lane.use in ("lane", "inside"):
            line = lane_line(lane)
            steps, lengths = np.diff(line.points, axis=0), np.diff(line.station_m)
            rows.append(np.column_stack((line.points[:-1], steps / lengths[:, None], lengths, line.station_m[:-1])))
            lanes += [lane] * len(lengths)
    pieces = np.concatenate(rows)
    ends = pieces[:, :2] + pieces[:, 2:4] * pieces[:, 4:5]
    return _Pieces(lanes, pieces, shapely.STRtree(shapely.linestrings(np.stack((pieces[:, :2], ends), axis=1))))


@lru_cache(maxsize=4096)
def lane_line(lane: NetLane) -> TravelLine:
    """Returns a lane's middle."""
    return line_of(lane.centre)


def nearest_lane(
    net: Net, x_m: float, y_m: float, heading_rad: float | None, among: Collection[str] = ()
) -> LanePlace | None:
    """Returns the place on the nearest lane for cars within 30 m.

    The lane leads within 90° of the heading, if there is one; lanes with the original names `among` are preferred, such
    as `0_-4`.
    """
    lanes, rows, tree = _pieces(net)
    if not (math.isfinite(x_m) and math.isfinite(y_m)):
        return None
    near = tree.query(shapely.Point(x_m, y_m), predicate="dwithin", distance=FARTHEST_M)
    if among:
        named = [i for i in near.tolist() if not set(among).isdisjoint(lanes[i].original)]
        near = np.array(named, dtype=np.intp) if named else near
    x, y, cos, sin, lengths, stations = rows[near].T
    dx, dy = x_m - x, y_m - y
    on = np.clip(dx * cos + dy * sin, 0.0, lengths)
    apart = np.hypot(dx - on * cos, dy - on * sin)
    if heading_rad is not None:
        fit = cos * math.cos(heading_rad) + sin * math.sin(heading_rad)
        apart = np.where(fit > 0.0, apart + TURNED_M * (1.0 - fit), np.inf)
    if not len(near) or not np.isfinite(apart.min()):
        return None
    i = int(np.argmin(apart))
    return LanePlace(lanes[near[i]], float(stations[i] + on[i]), float(dy[i] * cos[i] - dx[i] * sin[i]))


def spot_pose(spot: LanePlace) -> Pose:
    """Returns the pose of a place, in the lane's direction."""
    return lane_line(spot.lane).pose(spot.at_m, spot.left_m)


def beside(net: Net, spot: LanePlace, lanes: int) -> LanePlace | None:
    """Returns the place lanes to the left, at the same height, or None."""
    other = net.lanes.get(f"{spot.lane.edge}_{spot.lane.index + lanes}")
    if other is None or not other.drivable:
        return None
    x_m, y_m, _ = spot_pose(spot)
    return LanePlace(other, *lane_line(other).project(x_m, y_m))


def lanes_ahead(net: Net, lane: NetLane, length_m: float, edges: Sequence[str] = ()) -> list[NetLane]:
    """Returns a lane and those that follow it, along edges where it leads to them, else straight on."""
    lanes, left_m = [lane], length_m
    while left_m > 0.0:
        links = _links(net, lanes[-1])
        links = [link for link in links if link.target.edge in edges] or links
        if not links or links[0].target in lanes:
            break
        lanes += [*links[0].inside, links[0].target]
        left_m -= links[0].inside_m + links[0].target.length_m
    return lanes


def _through(net: Net, lane: NetLane) -> Link | None:
    return next((link for links in net.onward.values() for link in links if lane in link.inside), None)


def entry_of(net: Net, lane: NetLane) -> NetLane | None:
    """Returns the lane before one inside a junction."""
    link = _through(net, lane)
    return None if link is None else link.source


def _links(net: Net, lane: NetLane) -> list[Link]:
    """Returns a lane's links, the straightest first."""
    if lane.use == "inside":
        link = _through(net, lane)
        return [] if link is None else [Link(lane, link.target, link.inside[link.inside.index(lane) + 1 :], None, None)]
    return sorted(net.onward.get(lane.id, ()), key=lambda link: abs(link.turn_rad))


def edge_path(net: Net, begin: str, end: str) -> list[str] | None:
    """Returns the edges of the shortest way from one to another, with both; None if there is none."""
    order, queue, seen = itertools.count(1), [(0.0, 0, [begin])], set[str]()
    while queue:
        length_m, _, path = heappop(queue)
        if path[-1] == end:
            return path
        if path[-1] in seen:
            continue
        seen.add(path[-1])
        for lane in net.edges[path[-1]].drivable:
            for link in net.onward.get(lane.id, ()):
                if (target := link.target.edge) not in seen:
                    through_m = length_m + link.inside_m + link.target.length_m
                    heappush(queue, (through_m, next(order), [*path, target]))
    return None


def joined(net: Net, edges: Iterable[str]) -> list[str]:
    """Returns edges in driving order, with those between them that lead on."""
    path = list[str]()
    for edge in edges:
        if not path:
            path = [edge]
        elif edge != path[-1]:
            path += (edge_path(net, path[-1], edge) or [edge])[1:]
    return path


def extended(net: Net, edges: Sequence[str], metres: float) -> tuple[str, ...]:
    """Extends a way straight on until it is long enough or ends."""
    way = list(edges)
    left_m = metres - sum(net.edges[edge].lanes[0].length_m for edge in way)
    while left_m > 0.0:
        links = [link for lane in net.edges[way[-1]].drivable for link in net.onward.get(lane.id, ())]
        links = [link for link in links if link.target.edge not in way]
        if not links:
            break
        link = min(links, key=lambda link: abs(link.turn_rad))
        way.append(link.target.edge)
        left_m -= link.inside_m + link.target.length_m
    return tuple(way)
