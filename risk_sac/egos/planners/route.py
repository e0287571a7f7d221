"""Prepares a planner's input: route lanes, stop lines, room, others in view."""

import math
from collections.abc import Mapping, Sequence
from heapq import heappop, heappush

import numpy as np

from risk_sac.egos.driving import LAST_STOP_MPS2
from risk_sac.egos.seam import Perceived, Vehicle
from risk_sac.world.types import HEADING, LENGTH, SPEED, WIDTH, Bools, Floats, Kind, Lane, Road, Signal, X, Y

BEGINS_MPS2 = 2.5  # braking at which a planner without stop lines of its own begins to stop at one
BEFORE_LINE_M = 1.0  # distance from the stop line at which it stops
BESIDE_M = 0.1  # distance between the ego's body and the lane's edge


def lanes_ahead(road: Road, start: str) -> list[str]:
    """Returns route lanes from `start` on, with the fewest lane changes.

    It ends on the lane from which the route leads no farther. If the route is out of reach, it is the first lane alone.
    """
    lanes = {lane.id: lane for lane in road.lanes}
    ways: list[tuple[int, int, list[str]]] = [(0, 0, [start])]  # changes, order of finding, lanes
    seen: set[str] = set()
    while ways:
        changes, order, way = heappop(ways)
        if way[-1] in seen:
            continue
        seen.add(way[-1])
        lane = lanes[way[-1]]
        following = [each for each in lane.successors if lanes[each].on_route]
        if lane.on_route and not following:
            return way
        beside = [lane.left] * lane.may_change_left + [lane.right] * lane.may_change_right
        for cost, each in [*((0, each) for each in following), *((1, each) for each in beside)]:
            order += 1
            heappush(ways, (changes + cost, order, [*way, each]))
    return [start]


class SignalStops:
    """Decides at which red or yellow signals the ego stops.

    Once it stops at a yellow one, it does until the signal changes, however hard it has to brake then.
    """

    def __init__(self) -> None:
        self._yellow: set[int] = set()  # lines at which it stops

    def at(self, line: int, signal: Signal, speed_mps: float, way_m: float) -> bool:
        """Decides for a stop line's signal; `line` is any lasting number."""
        possible = speed_mps * speed_mps <= 2.0 * LAST_STOP_MPS2 * way_m
        if signal is Signal.YELLOW and possible:
            self._yellow.add(line)
        elif signal is not Signal.YELLOW:
            self._yellow.discard(line)
        return signal is Signal.RED or line in self._yellow


def stops(road: Road, perceived: Perceived, signals: SignalStops) -> list[bool]:
    """Returns for each stop line whether its signal stops the ego.

    Of a lane on the route, the signal for the route's direction counts.
    """
    p, lanes = perceived, {lane.id: lane for lane in road.lanes}
    x_m, y_m, heading, speed, half_m = p.state[[X, Y, HEADING, SPEED, LENGTH], 0].tolist()
    front = x_m + half_m / 2 * math.cos(heading), y_m + half_m / 2 * math.sin(heading)
    stopping = []
    for number, (line, signal) in enumerate(zip(road.stop_lines, p.signals, strict=True)):
        holds = lanes[line.leads_to].on_route or not lanes[line.lane].on_route
        way_m = math.dist(front, lanes[line.lane].line[:, -1])
        stopping.append(holds and signals.at(number, signal, speed, way_m))
    return stopping


def way_to_stop_m(p: Perceived, signals: SignalStops) -> float | None:
    """Returns the way to a signal's stop, or None while none applies."""
    if not math.isfinite(p.stop_line_m):
        return None
    speed, station_m = float(p.state[SPEED, 0]), p.station_m + p.stop_line_m
    if not signals.at(round(station_m), p.signal, speed, p.stop_line_m):
        return None
    way_m = p.stop_line_m - BEFORE_LINE_M
    return way_m if way_m < speed * speed / (2.0 * BEGINS_MPS2) + speed + 5.0 else None


def room_aside_m(lanes: Sequence[Lane], p: Perceived, car: Vehicle) -> float:
    """Returns how far aside the ego's body stays within its lane."""
    x_m, y_m = p.state[[X, Y], 0]
    own = min(lanes, key=lambda lane: float(np.hypot(lane.line[0] - x_m, lane.line[1] - y_m).min()))
    return max(own.width_m / 2 - car.width_m / 2 - BESIDE_M, BESIDE_M)


def in_view(p: Perceived) -> Bools:
    """Returns which objects a planner heeds: all except vehicles behind in lane."""
    x_m, y_m, heading, length_m, width_m = p.state[[X, Y, HEADING, LENGTH, WIDTH], 0]
    away_x, away_y = p.state[X] - x_m, p.state[Y] - y_m
    along_m = away_x * math.cos(heading) + away_y * math.sin(heading)
    across_m = away_y * math.cos(heading) - away_x * math.sin(heading)
    behind: Bools = (p.kind == Kind.VEHICLE) & (along_m < -length_m / 2) & (np.abs(across_m) < width_m)
    behind[0] = True  # the ego itself
    return ~behind


def in_pieces(road: Road, piece_m: float, spacing_m: float) -> Road:
    """Returns the road with long lanes cut into pieces of spaced points.

    A planner may work on whole lanes wherever the ego is. Pieces of lanes beside each other are cut alike.
    """
    lanes = {lane.id: lane for lane in road.lanes}
    count = {id_: max(math.ceil(_length(_rightmost(lane, lanes)) / piece_m), 1) for id_, lane in lanes.items()}
    pieces = []
    for lane in road.lanes:
        last = count[lane.id] - 1
        for k in range(last + 1):
            following = tuple(piece(id_, 0) for id_ in lane.successors) if k == last else (piece(lane.id, k + 1),)
            pieces.append(
                lane._replace(
                    id=piece(lane.id, k),
                    line=_cut(lane, k / (last + 1), (k + 1) / (last + 1), spacing_m),
                    left=lane.left and piece(lane.left, k),
                    right=lane.right and piece(lane.right, k),
                    successors=following,
                )
            )
    stop_lines = tuple(
        line._replace(lane=piece(line.lane, count[line.lane] - 1), leads_to=piece(line.leads_to, 0))
        for line in road.stop_lines
    )
    return Road(tuple(pieces), stop_lines)


def piece(lane: str, number: int) -> str:
    """Returns the id of a piece of a lane."""
    return f"{lane}/{number}"


def _rightmost(lane: Lane, lanes: Mapping[str, Lane]) -> Lane:
    while lane.right:
        lane = lanes[lane.right]
    return lane


def _cut(lane: Lane, first: float, last: float, spacing_m: float) -> Floats:
    """Returns a lane's line between two shares of its length."""
    station = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(lane.line, axis=1)))))
    first_m, last_m = first * station[-1], last * station[-1]
    at = np.linspace(first_m, last_m, max(round((last_m - first_m) / spacing_m), 1) + 1)
    return np.array([np.interp(at, station, row) for row in lane.line])


def _length(lane: Lane) -> float:
    return float(np.hypot(*np.diff(lane.line, axis=1)).sum())
