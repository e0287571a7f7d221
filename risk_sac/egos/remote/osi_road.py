"""Converts the road to ASAM OSI 3.

That is lanes, their boundaries and speed limits, and the lights at stop lines.

Source: ASAM OSI 3.8, osi_lane.proto, osi_logicallane.proto and osi_trafficlight.proto.
"""

from collections.abc import Mapping
from itertools import product
from typing import Any

from risk_sac.egos.remote import osi_pb2
from risk_sac.egos.road import lane_edges
from risk_sac.types import Floats, Lane, Road, Signal

# OSI's numbers.
DRIVING, INTERSECTION, NORMAL = 2, 4, 2
NO_LINE, SOLID, DASHED, ROAD_EDGE = 2, 3, 4, 6
SPEED_LIMIT, KMH = 0, 3
COLOURS = {Signal.RED: 2, Signal.YELLOW: 3, Signal.GREEN: 4}
CONSTANT = 3
PAIR = ("antecessor_lane_id", "successor_lane_id")
# Ids beyond those of actors, which count from 1.
LIGHT_ID, LANE_ID, BOUNDARY_ID, LOGICAL_ID = (1 << 32) + 2, 1 << 33, 1 << 34, 1 << 35


def road_message(road: Road) -> bytes:
    """Returns the part of `osi3.GroundTruth` that stays the same in an episode; bytes of messages can be joined."""
    numbers = {lane.id: number for number, lane in enumerate(road.lanes)}
    truth = osi_pb2.GroundTruth(
        lane=[_lane(lane, numbers, road) for lane in road.lanes],
        lane_boundary=[side for lane in road.lanes for side in _boundaries(lane, numbers)],
        logical_lane=[_logical_lane(lane, numbers) for lane in road.lanes],
    )
    encoded: bytes = truth.SerializeToString()
    return encoded


def lights(road: Road, signals: tuple[Signal, ...]) -> list[Mapping[str, Any]]:
    """Returns a light for each stop line, at its lane's end, assigned to the lane behind."""
    lanes = {lane.id: (number, lane) for number, lane in enumerate(road.lanes)}
    found: list[Mapping[str, Any]] = []
    for number, (line, signal) in enumerate(zip(road.stop_lines, signals, strict=True)):
        assigned, _ = lanes[line.leads_to]
        _, before = lanes[line.lane]
        classification = {
            "color": COLOURS.get(signal, 0),
            "mode": CONSTANT,
            "assigned_lane_id": [_id(LANE_ID + assigned)],
        }
        place = {"position": _point(before.line[:, -1])}
        found.append({"id": _id(LIGHT_ID + number), "base": place, "classification": classification})
    return found


def _lane(lane: Lane, numbers: Mapping[str, int], road: Road) -> Mapping[str, Any]:
    number = numbers[lane.id]
    before: list[int | None] = [numbers[other.id] for other in road.lanes if lane.id in other.successors]
    after: list[int | None] = [numbers[other] for other in lane.successors]
    pairing = [
        {key: _id(LANE_ID + each) for key, each in zip(PAIR, pair, strict=True) if each is not None}
        for pair in product(before or [None], after or [None])
        if any(each is not None for each in pair)
    ]
    return {
        "id": _id(LANE_ID + number),
        "classification": {
            "type": INTERSECTION if _in_junction(lane) else DRIVING,
            "centerline": [_point(point) for point in lane.line.T],
            "centerline_is_driving_direction": True,
            "left_adjacent_lane_id": [_id(LANE_ID + numbers[lane.left])] if lane.left else [],
            "right_adjacent_lane_id": [_id(LANE_ID + numbers[lane.right])] if lane.right else [],
            "lane_pairing": pairing,
            "left_lane_boundary_id": [_id(BOUNDARY_ID + 2 * number)],
            "right_lane_boundary_id": [_id(BOUNDARY_ID + 2 * number + 1)],
        },
    }


def _boundaries(lane: Lane, numbers: Mapping[str, int]) -> list[Mapping[str, Any]]:
    sides = ((lane.left, lane.may_change_left), (lane.right, lane.may_change_right))
    return [
        {
            "id": _id(BOUNDARY_ID + 2 * numbers[lane.id] + side),
            "boundary_line": [{"position": _point(point)} for point in line.T],
            "classification": {"type": _marking(lane, *sides[side])},
        }
        for side, line in enumerate(lane_edges(lane))
    ]


def _marking(lane: Lane, neighbour: str, may_change: bool) -> int:
    if _in_junction(lane):
        return NO_LINE
    if not neighbour:
        return ROAD_EDGE
    return DASHED if may_change else SOLID


def _logical_lane(lane: Lane, numbers: Mapping[str, int]) -> Mapping[str, Any]:
    limit = {"value": 3.6 * lane.limit_mps, "value_unit": KMH}
    return {
        "id": _id(LOGICAL_ID + numbers[lane.id]),
        "type": NORMAL,
        "physical_lane_reference": [{"physical_lane_id": _id(LANE_ID + numbers[lane.id])}],
        "traffic_rule": [{"traffic_rule_type": SPEED_LIMIT, "speed_limit": {"speed_limit_value": limit}}],
    }


def _in_junction(lane: Lane) -> bool:
    return lane.id.startswith(":")  # SUMO's mark


def _id(value: int) -> Mapping[str, int]:
    return {"value": value}


def _point(xy: Floats) -> Mapping[str, float]:
    return {"x": float(xy[0]), "y": float(xy[1]), "z": 0.0}
