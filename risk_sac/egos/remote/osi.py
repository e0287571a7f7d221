"""Converts road, signals and perceived actors to ASAM OSI 3.

A road has lanes, their boundaries and speed limits, and the lights at stop lines.

Source: ASAM OSI 3.8, osi_lane.proto, osi_logicallane.proto and osi_trafficlight.proto.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError

from risk_sac.egos.driving import PATH_X, PATH_Y, STATION, lane_edges, point_at
from risk_sac.egos.guard import Malformed
from risk_sac.egos.remote import osi_pb2
from risk_sac.egos.seam import EpisodeStart, Perceived, Trajectory
from risk_sac.scenario.bodies import Shape, body_like
from risk_sac.world.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, Floats, Lane, Road, Signal, X, Y

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
    """Returns an episode's constant part of `osi3.GroundTruth`; message bytes can be joined."""
    numbers = {lane.id: number for number, lane in enumerate(road.lanes)}
    truth = osi_pb2.GroundTruth(
        lane=[_lane(lane, numbers, road) for lane in road.lanes],
        lane_boundary=[side for lane in road.lanes for side in _boundaries(lane, numbers)],
        logical_lane=[_logical_lane(lane, numbers) for lane in road.lanes],
    )
    encoded: bytes = truth.SerializeToString()
    return encoded


def lights(road: Road, signals: tuple[Signal, ...]) -> list[Mapping[str, Any]]:
    """Returns a light per stop line, assigned to the lane beyond it."""
    lanes = {lane.id: (number, lane) for number, lane in enumerate(road.lanes)}
    messages: list[Mapping[str, Any]] = []
    for number, (line, signal) in enumerate(zip(road.stop_lines, signals, strict=True)):
        assigned, _ = lanes[line.leads_to]
        _, before = lanes[line.lane]
        classification = {
            "color": COLOURS.get(signal, 0),
            "mode": CONSTANT,
            "assigned_lane_id": [_id(LANE_ID + assigned)],
        }
        place = {"position": _road_point(before.line[:, -1])}
        messages.append({"id": _id(LIGHT_ID + number), "base": place, "classification": classification})
    return messages


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
            "centerline": [_road_point(point) for point in lane.line.T],
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
            "boundary_line": [{"position": _road_point(point)} for point in line.T],
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


def _road_point(xy: Floats) -> Mapping[str, float]:
    return {"x": float(xy[0]), "y": float(xy[1]), "z": 0.0}


VERSION = {"version_major": 3, "version_minor": 8, "version_patch": 0}
# OSI's numbers.
TYPE_OTHER, TYPE_VEHICLE, TYPE_PEDESTRIAN = 1, 2, 3
TYPES: Mapping[Shape, int] = {"person": TYPE_PEDESTRIAN, "block": TYPE_OTHER}  # the rest are vehicles
TRAJECTORY = 1
SIGNAL_ID = 1 << 32  # id of the one signal ahead; beyond the ids of actors


class OsiEgo(ABC):
    """Base of egos that speak OSI; they declare `version` and `response_time_s`."""

    @abstractmethod
    def drive(self, ground_truth: bytes) -> bytes:
        """Answers one step.

        Args:
          ground_truth: `osi3.GroundTruth` of what it perceives and of nothing else: its own car, `host_vehicle_id`, and
            others as `moving_object`; the signal ahead as the first `traffic_light`, at its stop line, then one for
            each stop line of the road; its way as the `reference_line`; the road as `lane`, `lane_boundary` and, with
            its speed limit, `logical_lane`.

        Returns:
          `osi3.MotionRequest` with a desired trajectory, or a desired state, of the middle of the rear axle.
        """

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode."""
        self._vehicle = episode.vehicle
        self._numbers: dict[str, int] = {}
        self._road, self._lanes = episode.road, road_message(episode.road)

    def act(self, perceived: Perceived) -> Trajectory:
        """Answers one step in OSI."""
        request = self.drive(ground_truth(perceived, self._numbers, self._road) + self._lanes)
        return trajectory_of(request, perceived, self._vehicle.wheelbase_m / 2)

    def close(self) -> None:  # noqa: B027 - an ego that holds something overrides it
        """Holds nothing."""


def ground_truth(perceived: Perceived, numbers: dict[str, int], road: Road) -> bytes:
    """Returns perceptions as `osi3.GroundTruth`; adds new actors to `numbers`."""
    p = perceived
    for id_ in p.ids:
        numbers.setdefault(id_, len(numbers) + 1)
    seconds, nanos = divmod(round(p.time_s * 1e9), 10**9)
    points = p.path[[PATH_X, PATH_Y, STATION]].T.tolist()
    line = [{"world_position": _vector(x, y), "s_position": s} for x, y, s in points]
    truth = {
        "version": VERSION,
        "timestamp": {"seconds": seconds, "nanos": nanos},
        "host_vehicle_id": {"value": numbers[p.ids[0]]},
        "moving_object": [_moving(p, column, numbers[id_]) for column, id_ in enumerate(p.ids)],
        "traffic_light": (
            ([_light(p)] if p.signal in COLOURS and math.isfinite(p.stop_line_m) else []) + lights(road, p.signals)
        ),
        "reference_line": [{"id": {"value": SIGNAL_ID + 1}, "poly_line": line, "type": 0}],
    }
    encoded: bytes = osi_pb2.GroundTruth(**truth).SerializeToString()
    return encoded


def trajectory_of(request: bytes, perceived: Perceived, rear_axle_m: float) -> Trajectory:
    """Returns the trajectory that an `osi3.MotionRequest` commands, in the simulation's time.

    Args:
      request: its bytes.
      perceived: what it answers.
      rear_axle_m: from the middle of the body back to the axle, whose middle OSI means.

    Raises:
      Malformed: this is no complete motion request.
    """
    if not isinstance(request, bytes):
        raise Malformed(f"a {type(request).__name__}; wanted the bytes of a motion request")
    try:
        asked = osi_pb2.MotionRequest.FromString(request)
    except DecodeError as error:
        raise Malformed(f"{len(request)} bytes that are no motion request") from error
    if missing := asked.FindInitializationErrors():
        raise Malformed(f"a motion request that lacks {', '.join(missing)}")
    now = perceived.state[:, 0]
    if asked.motion_request_type == TRAJECTORY:
        points = [_point(each, rear_axle_m) for each in asked.desired_trajectory.trajectory_point]
        if len(points) < 2:
            raise Malformed(f"a motion request with {len(points)} trajectory points; expected 2 or more")
        time_s, x_m, y_m = np.array(points).T
        with np.errstate(all="ignore"):  # a NaN or inf is refused with the whole trajectory
            speed_mps = np.hypot(np.gradient(x_m, time_s), np.gradient(y_m, time_s))
    elif asked.HasField("desired_state"):
        then_s, x, y = _point(asked.desired_state, rear_axle_m)
        velocity = asked.desired_state.velocity
        time_s, x_m, y_m = np.array(((perceived.time_s, then_s), (now[X], x), (now[Y], y)))
        speed_mps = np.array((now[SPEED], math.hypot(velocity.x, velocity.y)))
    else:
        raise Malformed("a motion request that lacks desired_state")
    return Trajectory(np.maximum(time_s - perceived.time_s, 0.0), x_m, y_m, speed_mps)


def _moving(perceived: Perceived, column: int, number: int) -> Mapping[str, Any]:
    state = perceived.state[:, column]
    body = body_like(float(state[LENGTH]), float(state[WIDTH]))
    height_m = body.height_m
    base = {
        "dimension": {"length": state[LENGTH], "width": state[WIDTH], "height": height_m},
        "position": _vector(state[X], state[Y], height_m / 2),
        "orientation": {"roll": 0.0, "pitch": 0.0, "yaw": math.remainder(state[HEADING], math.tau)},
        "velocity": _vector(state[VX], state[VY]),
    }
    told: dict[str, Any] = {"id": {"value": number}, "base": base, "type": TYPES.get(body.shape, TYPE_VEHICLE)}
    if told["type"] == TYPE_VEHICLE:
        told["vehicle_classification"] = {"type": body.export.osi}
    return told


def _light(perceived: Perceived) -> Mapping[str, Any]:
    x, y = point_at(perceived.path, perceived.station_m + perceived.stop_line_m)
    return {
        "id": {"value": SIGNAL_ID},
        "base": {"position": _vector(x, y)},
        "classification": {"color": COLOURS[perceived.signal], "mode": CONSTANT},
    }


def _vector(x: float, y: float, z: float = 0.0) -> Mapping[str, float]:
    return {"x": x, "y": y, "z": z}


def _point(told: Any, rear_axle_m: float) -> tuple[float, float, float]:
    time_s = told.timestamp.seconds + told.timestamp.nanos / 1e9
    place, yaw = told.position, told.orientation.yaw
    return time_s, place.x + rear_axle_m * math.cos(yaw), place.y + rear_axle_m * math.sin(yaw)
