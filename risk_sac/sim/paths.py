"""Paths of vehicles: centre lines of lanes along a route, with junctions.

A lane that does not lead to the route's next edge still has a path along the route: towards its end, the path leads
over to the nearest lane that does. So a vehicle that has left the lanes of its route finds back.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import libsumo
import numpy as np

from risk_sac.world.types import Floats

AHEAD_M = 120.0  # length of path beyond a lane's end: at 16 m/s more than any driver looks ahead
SAME_POINT_M = 1e-3
SHIFT_M = 1.0  # largest step from the end of one lane to the beginning of the next
TAPER_M = 5.0  # length of the path on which it makes up for that step
CHANGE_M = 50.0  # length before the end of a lane that leads elsewhere on which the path changes lanes
CHANGED = 0.6  # share of that length after which the path has changed
# Choices: the same two lengths as times at the limit, where roads are fast. A lane change then takes 3 s.
AHEAD_S, CHANGE_S, FAST_MPS = 7.0, 5.0, 20.0
CAR = "passenger"  # vehicle class of all our vehicles that start on lanes for cars


# A polyline from the start of a lane on; one column for each point, and these rows.
Path = Floats
X, Y = 0, 1
STATION = 2  # length of the line up to each point, m; 0 at the first
HEADING = 3  # heading of the segment that begins at the point, rad; the last point repeats the one before
LIMIT = 4  # highest speed that SUMO's drivers drive there, m/s; low in bends
COS, SIN = 5, 6  # of the heading


class Along(NamedTuple):
    """A vehicle on its path."""

    path: Path
    station_m: float  # of its front bumper
    offset_m: float  # of its front bumper's middle from the line, positive to the left
    ends_m: float = math.inf  # station at which its lane ends, if that does not lead on along its route


class PathStopLine(NamedTuple):
    """A signal's stop line on a path."""

    station_m: float
    signal: str
    link: int  # index of its letter


class Way(NamedTuple):
    """A path and the stop lines on it."""

    path: Path
    stop_lines: tuple[PathStopLine, ...]
    complete: bool  # whether it ends where its route ends
    lane_m: float  # length of its first lane
    following: str | None  # the lane that follows this one
    ends_m: float  # station at which its first lane ends; inf if that leads on along the route


def way_of(route: Sequence[str], lane: str) -> Way:
    """Returns the way from the start of `lane` along `route`.

    It ends where no lane of an edge leads to the next edge. The simulation must have loaded the net.
    """
    lanes = _lanes_ahead(route, lane)
    lines = [_line(route, lane) for lane in lanes]
    path = path_along(lines, [libsumo.lane.getMaxSpeed(lane) for lane in lanes])
    controlled, stop_lines, station_m = controlled_links(), [], 0.0
    for line, (before, following) in zip(lines, pairwise(lanes), strict=False):
        station_m += _length(line)
        signal = controlled.get((leading_lane(route, before), following))
        if signal is not None:
            stop_lines.append(PathStopLine(station_m, *signal))
    return Way(
        path=path,
        stop_lines=tuple(stop_lines),
        complete=edge_of(lanes[-1]) == route[-1],
        lane_m=_length(lines[0]),
        following=lanes[1] if len(lanes) > 1 else None,
        ends_m=math.inf if leads_on(route, lane) else _length(lines[0]),
    )


def controlled_links() -> dict[tuple[str, str], tuple[str, int]]:
    """Maps pairs of lanes at a stop line to their signal.

    A pair is a lane and the lane behind the line; a signal comes with the index of the letter.
    """
    return {
        (before, via or after): (signal, index)
        for signal in libsumo.trafficlight.getIDList()
        for index, links in enumerate(libsumo.trafficlight.getControlledLinks(signal))
        for before, after, via in links
    }


def leading_lane(route: Sequence[str], lane: str) -> str:
    """Returns the edge's nearest lane that leads on along the route.

    It is the lane itself if none does.
    """
    edge, _, index = lane.rpartition("_")
    beside = sorted(range(libsumo.edge.getLaneNumber(edge)), key=lambda other: abs(other - int(index)))
    return next((other for other in (f"{edge}_{i}" for i in beside) if leads_on(route, other)), lane)


def car_may_use(lane: str) -> bool:
    """Whether cars may use a lane."""
    allowed = libsumo.lane.getAllowed(lane)  # empty: all classes but the disallowed ones
    return CAR in allowed if allowed else CAR not in libsumo.lane.getDisallowed(lane)


def leads_on(route: Sequence[str], lane: str) -> bool:
    """Whether a car lane leads to the route's next edge, if any."""
    if not car_may_use(lane):
        return False
    edge = edge_of(lane)
    if edge not in route[:-1]:
        return True
    following = route[route.index(edge) + 1]
    return any(edge_of(link[0]) == following for link in libsumo.lane.getLinks(lane))


def _line(route: Sequence[str], lane: str) -> Floats:
    """Returns a lane's middle, `points x 2`, that ends in its `leading_lane`."""
    line, leading = np.array(libsumo.lane.getShape(lane)), leading_lane(route, lane)
    if leading == lane:
        return line
    lanes = abs(int(lane.rpartition("_")[2]) - int(leading.rpartition("_")[2]))
    length_m, beside = _length(line), np.array(libsumo.lane.getShape(leading))
    limit_mps = libsumo.lane.getMaxSpeed(lane)
    change_m = max(CHANGE_M, CHANGE_S * limit_mps) if limit_mps > FAST_MPS else CHANGE_M
    leaves_m = max(length_m - change_m * lanes, 0.0)
    arrives_m = leaves_m + CHANGED * (length_m - leaves_m)
    first, _ = _cut(line, leaves_m)
    _, last = _cut(beside, arrives_m * _length(beside) / length_m)
    return np.concatenate((first, last))


def _cut(line: Floats, station_m: float) -> tuple[Floats, Floats]:
    """Cuts a line, `points x 2`, at a station."""
    stations = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    at = [np.interp(station_m, stations, line[:, 0]), np.interp(station_m, stations, line[:, 1])]
    return np.vstack((line[stations < station_m], at)), np.vstack((at, line[stations > station_m]))


def _length(line: Floats) -> float:
    return float(np.hypot(*np.diff(line, axis=0).T).sum())


def _lanes_ahead(route: Sequence[str], lane: str) -> list[str]:
    """Returns the lane and those ahead for `AHEAD_M`, or farther if fast."""
    lanes, length_m, fastest_mps = [lane], 0.0, libsumo.lane.getMaxSpeed(lane)
    while length_m < max(AHEAD_M, AHEAD_S * fastest_mps):
        following = _next_lane(route, lanes[-1])
        if following is None:
            break
        lanes.append(following)
        length_m += libsumo.lane.getLength(following)
        fastest_mps = max(fastest_mps, libsumo.lane.getMaxSpeed(following))
    return lanes


def needs_lane_change(route: Sequence[str], lane: str) -> bool:
    """Whether a vehicle has to change lanes to follow its route."""
    return _reach(route[1:], lane) < len(route) - 1


def _next_lane(route: Sequence[str], lane: str) -> str | None:
    edge, lane = edge_of(lane), leading_lane(route, lane)
    links = libsumo.lane.getLinks(lane)
    following: tuple[str, ...] = ()
    if edge in route:
        following = tuple(route[route.index(edge) + 1 :])
        links = [link for link in links if following and edge_of(link[0]) == following[0]]
    if not links:
        return None
    # Of the lanes that one forks into, SUMO's drivers take the one that leads farthest; of equals the first, the right.
    link = max(links, key=lambda link: _reach(following[1:], link[0]))
    return str(link[4] or link[0])  # what leads there across the junction, if that has lanes


def _reach(edges: Sequence[str], lane: str) -> int:
    """Along how many of the edges that follow a lane leads."""
    lanes = {lane}
    for reached, edge in enumerate(edges):
        lanes = {link[0] for id_ in lanes for link in libsumo.lane.getLinks(id_) if edge_of(link[0]) == edge}
        if not lanes:
            return reached
    return len(edges)


def edge_of(lane: str) -> str:
    """Returns the edge of a lane."""
    return lane.rpartition("_")[0]


def path_along(lines: Sequence[Floats], limits_mps: Sequence[float]) -> Path:
    """Returns the path along consecutive lanes' lines, `points x 2`, with limits."""
    lines = joined(lines)
    points, limit = np.concatenate(lines), np.repeat(limits_mps, [len(line) for line in lines])
    # Where lanes meet there are two points; the one that stays is the first of the lane that follows.
    apart = np.append(np.hypot(*np.diff(points, axis=0).T) > SAME_POINT_M, True)
    points, limit = points[apart], limit[apart]
    steps = np.diff(points, axis=0)
    station = np.concatenate(([0.0], np.cumsum(np.hypot(*steps.T))))
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    return path_through(points[:, 0], points[:, 1], station, np.append(heading, heading[-1]), limit)


def path_through(x_m: Floats, y_m: Floats, station_m: Floats, heading_rad: Floats, limit_mps: Floats) -> Path:
    """The path through points, given its rows but the last two."""
    return np.array((x_m, y_m, station_m, heading_rad, limit_mps, np.cos(heading_rad), np.sin(heading_rad)))


def joined(lines: Sequence[Floats]) -> list[Floats]:
    """Returns consecutive lanes' lines, `points x 2` each, without steps between them.

    Nets are rounded to centimetres, and some are drawn less exactly, so that a lane may begin beside the end of the one
    before. That step would be a segment of the path in any direction, across it or back; actors near it would be on the
    path for a moment. So the last `TAPER_M` of a lane that leads to such a step are left out.
    """
    tapered = list(lines)
    for i, (line, following) in enumerate(pairwise(lines)):
        if SAME_POINT_M < math.dist(line[-1], following[0]) <= SHIFT_M:
            last_m = math.dist(line[-2], line[-1])
            off = [line[-1] + (line[-2] - line[-1]) * TAPER_M / last_m] if last_m > TAPER_M else []
            tapered[i] = np.array([*line[:-1], *off])
    return tapered
