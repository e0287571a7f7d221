"""Finds ways along an OpenDRIVE file's lanes, and between its roads.

Source: ASAM OpenDRIVE 1.7: road linkage, junctions, lane linkage; ASAM OpenSCENARIO XML 1.3: default route.
"""

import itertools
import math
from collections.abc import Collection, Iterator
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np

from risk_sac.errors import ConfigError
from risk_sac.world.plane_curves import Across, Clothoid
from risk_sac.world.road_geometry import End, RoadFile, Roadway
from risk_sac.world.types import Floats

SAGITTA_M = 0.001  # between a bent line and the straight pieces that stand for it
SHORTEST_M, LONGEST_M = 0.1, 2.0  # of these pieces
MOST_LEGS = 10_000
INSIDE_M = 1e-6  # before the end of a lane section, so that a place lies in it


class LaneEnd(NamedTuple):
    """Begin of a lane, for a vehicle that enters its road."""

    road: str
    lane: int
    forward: bool  # whether s grows along the way


class RoadLeg(NamedTuple):
    """Part of a way on one road."""

    road: str
    forward: bool  # whether s grows along the way
    from_m: float
    to_m: float
    lane: int  # at its begin
    out: int  # at its end; the way changes to this lane

    @property
    def length_m(self) -> float:
        """Along the reference line."""
        return abs(self.to_m - self.from_m)


def lane_through(road: Roadway, lane: int, from_m: float, to_m: float) -> int | None:
    """Returns a lane's id elsewhere on its road; None if it ends."""
    first, last = road.section_index(from_m), road.section_index(to_m)
    step: int = 1 if last >= first else -1
    end: End = "end" if step > 0 else "start"
    for i in range(first, last, step):
        if lane not in road.sections[i].lanes:
            return None
        lane = road.sections[i].lanes[lane].links.get(end, lane)
    return lane if lane in road.sections[last].lanes else None


def following(file: RoadFile, road: Roadway, lane: int, *, forward: bool) -> list[LaneEnd]:
    """Returns lanes that follow at the road's end, or at its begin."""
    end: End = "end" if forward else "start"
    link = road.links.get(end)
    section = road.sections[-1 if forward else 0]
    if link is None or lane not in section.lanes:
        return []
    if link.kind == "road":
        if link.id not in file.roads:
            return []
        ahead = link.contact == "start"
        other = section.lanes[lane].links.get(end)
        if other is None:
            return []
        return [LaneEnd(link.id, other, ahead)] if _has(file.roads[link.id], other, forward=ahead) else []
    ways = []
    for way in file.connections.get(link.id, ()):
        if way.incoming != road.id or way.road not in file.roads or lane not in way.lanes:
            continue
        met = file.roads[way.road].links.get(way.contact)
        if met is not None and met.id == road.id and met.contact != end:
            continue  # the connection of this road's other end
        ahead = way.contact == "start"
        if _has(file.roads[way.road], way.lanes[lane], forward=ahead):
            ways.append(LaneEnd(way.road, way.lanes[lane], ahead))
    return ways


def _has(road: Roadway, lane: int, *, forward: bool) -> bool:
    return lane in road.sections[0 if forward else -1].lanes


def straightest(file: RoadFile, road: Roadway, lane: int, ways: list[LaneEnd], *, forward: bool) -> LaneEnd:
    """Returns the way that turns least, or of equal ones the nearside's."""
    heading = direction_at(road, lane, road.length_m if forward else 0.0, forward=forward)

    def bend(way: LaneEnd) -> tuple[float, float]:
        other = file.roads[way.road]
        to_m = other.length_m if way.forward else 0.0
        last = lane_through(other, way.lane, other.length_m - to_m, to_m)
        if last is None:
            return math.inf, 0.0
        turned = math.remainder(direction_at(other, last, to_m, forward=way.forward) - heading, math.tau)
        return round(abs(turned), 6), -turned if road.keeps_left else turned

    return min(ways, key=bend)


def direction_at(road: Roadway, lane: int, s_m: float, *, forward: bool) -> float:
    """Returns the direction of a lane's middle, along the way."""
    return road.point(s_m, road.middle(lane, s_m))[2] + (0.0 if forward else math.pi)


def lane_end(road: Roadway, lane: int, from_m: float, *, forward: bool) -> tuple[float, int]:
    """Returns where a lane ends on its road, and its id there."""
    i = road.section_index(from_m)
    end: End = "end" if forward else "start"
    while 0 <= i + (step := 1 if forward else -1) < len(road.sections):
        other = road.sections[i].lanes[lane].links.get(end, lane) if lane in road.sections[i].lanes else lane
        if other not in road.sections[i + step].lanes:
            return (road.sections[i + 1].start_m - INSIDE_M if forward else road.sections[i].start_m), lane
        i, lane = i + step, other
    return (road.length_m if forward else 0.0), lane


def onward(
    file: RoadFile,
    begin: LaneEnd,
    from_m: float,
    distance_m: float,
    roads: Collection[str] = (),
    *,
    by_lane: bool = True,
) -> tuple[list[RoadLeg], float]:
    """Returns a way's legs along a lane, and its remaining length.

    Args:
      file: with the roads.
      begin: road, lane and direction.
      from_m: s where it begins.
      distance_m: at least 0.
      roads: that it keeps to where it can.
      by_lane: whether the distance is that along the lane's middle; else along the reference lines.
    """
    legs, here, left_m = list[RoadLeg](), begin, distance_m
    for _ in range(MOST_LEGS):
        road = file.road(here.road)
        to_m, out = lane_end(road, here.lane, from_m, forward=here.forward)
        if by_lane:
            most_m = min(abs(to_m - from_m), 2.0 * left_m + LONGEST_M)  # no bend makes a lane half as long
            near_m = from_m + (most_m if here.forward else -most_m)
            to_m = near_m if lane_length(road, here.lane, from_m, near_m) >= left_m else to_m
        room_m = lane_length(road, here.lane, from_m, to_m) if by_lane else abs(to_m - from_m)
        if left_m <= room_m + INSIDE_M:
            if by_lane:
                to_m = _station(road, here.lane, from_m, to_m, left_m)
            else:
                to_m = min(max(from_m + (left_m if here.forward else -left_m), 0.0), road.length_m)
            out = lane_through(road, here.lane, from_m, to_m) or out
            return [*legs, RoadLeg(here.road, here.forward, from_m, to_m, here.lane, out)], 0.0
        legs.append(RoadLeg(here.road, here.forward, from_m, to_m, here.lane, out))
        left_m -= room_m
        ways = following(file, road, out, forward=here.forward) if to_m in (0.0, road.length_m) else []
        if not ways:
            break
        ways = [way for way in ways if way.road in roads] or ways
        here = straightest(file, road, out, ways, forward=here.forward)
        from_m = 0.0 if here.forward else file.roads[here.road].length_m
    return legs, left_m


def road_path(file: RoadFile, begin: LaneEnd, from_m: float, goal: LaneEnd, to_m: float) -> list[RoadLeg]:
    """Returns the shortest way between places along the reference lines.

    Raises:
      ConfigError: no lane leads there.
    """
    first = (begin.road, begin.forward)
    if first == (goal.road, goal.forward) and (to_m >= from_m) == goal.forward:
        return [RoadLeg(goal.road, goal.forward, from_m, to_m, begin.lane, goal.lane)]
    seen, queue = dict[tuple[str, bool], float](), [(0.0, 0, [first])]
    order = itertools.count(1)
    while queue:
        length_m, _, path = heappop(queue)
        id_, forward = path[-1]
        if path[-1] in seen:
            continue
        if len(path) > 1:
            seen[path[-1]] = length_m
            if path[-1] == (goal.road, goal.forward):
                return _legs(file, path, begin, from_m, goal, to_m)
        road = file.road(id_)
        own_m = road.length_m if len(path) > 1 else abs((road.length_m if forward else 0.0) - from_m)
        for way in _exits(file, road, forward=forward):
            if (way.road, way.forward) not in seen:
                heappush(queue, (length_m + own_m, next(order), [*path, (way.road, way.forward)]))
    got = f"no way along lanes from road {begin.road!r} to road {goal.road!r}"
    raise ConfigError("waypoints", got, "waypoints that lanes lead to")


def _exits(file: RoadFile, road: Roadway, *, forward: bool) -> Iterator[LaneEnd]:
    """Lanes that those of a road's traffic direction lead to."""
    for lane in road.sections[-1 if forward else 0].lanes:
        if road.backwards(lane) != forward:
            yield from following(file, road, lane, forward=forward)


def _legs(
    file: RoadFile, path: list[tuple[str, bool]], begin: LaneEnd, from_m: float, goal: LaneEnd, to_m: float
) -> list[RoadLeg]:
    """Chooses a way's lanes, with the fewest changes on each road."""
    legs, lane = list[RoadLeg](), begin.lane
    for (id_, forward), (after, after_forward) in itertools.pairwise(path):
        road = file.road(id_)
        end_m = road.length_m if forward else 0.0
        begin_m = from_m if not legs else road.length_m - end_m
        through = lane_through(road, lane, begin_m, end_m)
        kept = lane if through is None else through
        exits = [
            (abs(out - kept), out, way.lane)
            for out in road.sections[-1 if forward else 0].lanes
            for way in following(file, road, out, forward=forward)
            if (way.road, way.forward) == (after, after_forward) and (out > 0) == (kept > 0)
        ]
        if not exits:
            raise ConfigError("waypoints", f"no lane of road {id_!r} that leads to {after!r}", "another way")
        _, out, entered = min(exits)
        legs.append(RoadLeg(id_, forward, begin_m, end_m, lane, out))
        lane = entered
    begin_m = 0.0 if goal.forward else file.road(goal.road).length_m
    return [*legs, RoadLeg(goal.road, goal.forward, begin_m, to_m, lane, goal.lane)]


def lane_length(road: Roadway, lane: int, from_m: float, to_m: float) -> float:
    """Returns the length of a lane's middle between two places."""
    return float(_lengths(road, lane, from_m, to_m)[1][-1])


def _station(road: Roadway, lane: int, from_m: float, to_m: float, length_m: float) -> float:
    """Returns the s at which a lane's middle has a length."""
    stations, lengths = _lengths(road, lane, from_m, to_m)
    return float(np.interp(length_m, lengths, stations))


def _lengths(road: Roadway, lane: int, from_m: float, to_m: float) -> tuple[list[float], Floats]:
    """Returns places along a lane, and its middle's length to each."""
    out = lane_through(road, lane, from_m, to_m)
    points = leg_line(road, RoadLeg(road.id, to_m >= from_m, from_m, to_m, lane, lane if out is None else out))
    changes = out is None
    lengths = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))))
    return _stations(road, from_m, to_m, changes=changes), lengths


def leg_line(road: Roadway, leg: RoadLeg) -> Floats:
    """Returns x, y and direction along a leg's middle, `n x 3`.

    Where the lane is changed, the line passes over evenly from one middle to the other.
    """
    changes = leg.out != lane_through(road, leg.lane, leg.from_m, leg.to_m)
    stations = _stations(road, leg.from_m, leg.to_m, changes=changes)
    across, constant = np.empty((len(stations), 2)), dict[int, Across]()
    for i, s_m in enumerate(stations):
        here = road.interval(s_m)
        across[i] = constant[here] if here in constant else _across(road, leg, s_m)
        if road.plain[here] and not changes:
            constant[here] = Across(*across[i].tolist())
    x_m, y_m, heading, curvature = road.reference(np.array(stations)).T
    turned = np.arctan2(across[:, 1], np.maximum(1.0 - curvature * across[:, 0], 1e-6))
    x_m, y_m = x_m - np.sin(heading) * across[:, 0], y_m + np.cos(heading) * across[:, 0]
    return np.column_stack((x_m, y_m, heading + turned + (0.0 if leg.forward else math.pi)))


def _across(road: Roadway, leg: RoadLeg, s_m: float) -> Across:
    """Returns the lateral place of a leg, with its slope."""
    here = lane_through(road, leg.lane, leg.from_m, s_m) or _nearest(road, leg.lane, s_m)
    there = lane_through(road, leg.out, leg.to_m, s_m) or _nearest(road, leg.out, s_m)
    across = road.middle(here, s_m)
    if there == here:
        return across
    length_m, other = max(leg.length_m, 1e-9), road.middle(there, s_m)
    share, apart = abs(s_m - leg.from_m) / length_m, other.t_m - across.t_m
    share, rate = share**2 * (3 - 2 * share), 6 * share * (1 - share) / length_m
    slope = across.slope + share * (other.slope - across.slope) + apart * rate * (1 if leg.forward else -1)
    return Across(across.t_m + share * apart, slope)


def _nearest(road: Roadway, lane: int, s_m: float) -> int:
    """Returns the lane on the same side whose id is nearest."""
    ids = [id_ for id_ in road.section(s_m).lanes if (id_ > 0) == (lane > 0)]
    return min(ids or [0], key=lambda id_: abs(id_ - lane))


def _stations(road: Roadway, from_m: float, to_m: float, *, changes: bool = False) -> list[float]:
    """Returns places along a road, closer where its lanes bend."""
    low, high = sorted((from_m, to_m))
    inner = {s for s in road.breaks_m if low < s < high}
    stations = [low]
    for a, b in itertools.pairwise(sorted({low, high, *inner})):
        piece = road.curves[max(int(np.searchsorted(road.starts_m, (a + b) / 2, side="right")) - 1, 0)]
        if isinstance(piece, Clothoid):
            curvature = max(abs(piece.curvature_start), abs(piece.curvature_end))
        else:
            curvature = float(np.abs(road.reference(np.linspace(a, b, 9))[:, 3]).max())
        plain = curvature == 0.0 and not changes and road.plain[road.interval((a + b) / 2)]
        step = b - a
        if not plain:
            step = LONGEST_M if curvature == 0.0 else math.sqrt(8 * SAGITTA_M / curvature)
            step = min(max(step, SHORTEST_M), LONGEST_M)
        stations += np.linspace(a, b, max(math.ceil((b - a) / step), 1) + 1)[1:].tolist()
    return stations if to_m >= from_m else stations[::-1]
