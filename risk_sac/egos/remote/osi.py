"""Egos that speak ASAM OSI 3: they are told an `osi3.GroundTruth` and answer an `osi3.MotionRequest`, both as bytes.

Our side needs no OSI package and no protocol buffers, so that the ego can read and write the bytes with whichever
version its stack has: `osi3.GroundTruth.FromString(told)`, `request.SerializeToString()`. The truth is the ego's: it
holds whom the ego perceives, and nobody else.

Source: ASAM OSI 3.8, osi_groundtruth.proto and osi_motionrequest.proto.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from risk_sac.egos.remote.wire import Message, decode, encode, read_schema
from risk_sac.egos.road import PATH_X, PATH_Y, STATION, point_at
from risk_sac.egos.seam import Episode, Perceived, Trajectory
from risk_sac.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, Kind, Signal, X, Y

SCHEMA = read_schema("osi.proto")
VERSION = {"version_major": 3, "version_minor": 8, "version_patch": 0}
# OSI's numbers.
TYPE_VEHICLE, TYPE_PEDESTRIAN, TYPE_CAR, TYPE_HEAVY_TRUCK = 2, 3, 4, 7
COLOURS = {Signal.RED: 2, Signal.YELLOW: 3, Signal.GREEN: 4}
MODE_CONSTANT = 3
TRAJECTORY = 1
# Choice: what nothing of ours has. Heights are usual ones, and a long body is a truck.
CAR_HEIGHT_M, TRUCK_HEIGHT_M, WALKER_HEIGHT_M = 1.5, 3.0, 1.75
TRUCK_FROM_M = 6.5
SIGNAL_ID = 1 << 32  # of the one signal ahead; beyond the ids of actors


class OsiEgo(ABC):
    """What an ego of one's own derives from; `version` and `response_time_s` are its own, as of any other."""

    @abstractmethod
    def drive(self, ground_truth: bytes) -> bytes:
        """One step.

        Args:
          ground_truth: `osi3.GroundTruth` of whom it perceives: its own car, which is `host_vehicle_id`, and others as
            `moving_object`; the signal ahead as a `traffic_light` at its stop line; its way as the `reference_line`.

        Returns:
          `osi3.MotionRequest` with a desired trajectory, or a desired state, of the middle of the rear axle.
        """

    def reset(self, episode: Episode) -> None:
        """Begins an episode."""
        self._vehicle = episode.vehicle
        self._numbers: dict[str, int] = {}

    def act(self, perceived: Perceived) -> Trajectory:
        """One step, in OSI.

        Raises:
          ValueError: the answer is no motion request.
        """
        request = self.drive(ground_truth(perceived, self._numbers))
        return trajectory_of(request, perceived, self._vehicle.wheelbase_m / 2)

    def close(self) -> None:  # noqa: B027 - whoever holds something overrides it
        """Holds nothing."""


def ground_truth(perceived: Perceived, numbers: dict[str, int]) -> bytes:
    """Whom an ego perceives, as `osi3.GroundTruth`.

    Args:
      perceived: by it.
      numbers: of the actors, whose ids are texts with us; who comes anew is added.
    """
    p = perceived
    for id_ in p.ids:
        numbers.setdefault(id_, len(numbers) + 1)
    path = (p.path[row].tolist() for row in (PATH_X, PATH_Y, STATION))
    line = [{"world_position": _vector(x, y), "s_position": s} for x, y, s in zip(*path, strict=True)]
    truth = {
        "version": VERSION,
        "timestamp": _timestamp(p.time_s),
        "host_vehicle_id": {"value": numbers[p.ids[0]]},
        "moving_object": [_moving(p, column, numbers[id_]) for column, id_ in enumerate(p.ids)],
        "traffic_light": [_light(p)] if p.signal in COLOURS and math.isfinite(p.stop_line_m) else [],
        "reference_line": [{"id": {"value": SIGNAL_ID + 1}, "poly_line": line, "type": 0}],
    }
    return encode("GroundTruth", truth, SCHEMA)


def trajectory_of(request: bytes, perceived: Perceived, rear_axle_m: float) -> Trajectory:
    """What an `osi3.MotionRequest` commands.

    Args:
      request: its bytes. Times are those of the simulation.
      perceived: what it answers.
      rear_axle_m: how far behind the middle of the body the axle is whose middle OSI means.

    Raises:
      ValueError: these bytes are no motion request, or it lacks what it has to say.
    """
    asked = decode("MotionRequest", request, SCHEMA)
    now = perceived.state[:, 0]
    try:
        if asked["motion_request_type"] == TRAJECTORY:
            points = [_point(each, rear_axle_m) for each in asked["desired_trajectory"]["trajectory_point"]]
            time_s, x_m, y_m = np.array(points).T
            speed_mps = np.hypot(np.gradient(x_m, time_s), np.gradient(y_m, time_s))
        else:
            wanted = asked["desired_state"]
            then_s, x, y = _point(wanted, rear_axle_m)
            velocity = wanted["velocity"]
            time_s, x_m, y_m = np.array(((perceived.time_s, then_s), (now[X], x), (now[Y], y)))
            speed_mps = np.array((now[SPEED], math.hypot(velocity["x"], velocity["y"])))
    except (IndexError, KeyError, ValueError) as error:
        raise ValueError(f"a motion request that lacks {error}") from error
    return Trajectory(np.maximum(time_s - perceived.time_s, 0.0), x_m, y_m, speed_mps)


def _moving(perceived: Perceived, column: int, number: int) -> Message:
    state = perceived.state[:, column]
    walks, truck = perceived.kind[column] == Kind.PEDESTRIAN, state[LENGTH] > TRUCK_FROM_M
    height_m = WALKER_HEIGHT_M if walks else TRUCK_HEIGHT_M if truck else CAR_HEIGHT_M
    base = {
        "dimension": {"length": state[LENGTH], "width": state[WIDTH], "height": height_m},
        "position": _vector(state[X], state[Y], height_m / 2),
        "orientation": {"roll": 0.0, "pitch": 0.0, "yaw": math.remainder(state[HEADING], math.tau)},
        "velocity": _vector(state[VX], state[VY]),
    }
    told: dict[str, Any] = {"id": {"value": number}, "base": base, "type": TYPE_PEDESTRIAN if walks else TYPE_VEHICLE}
    if not walks:
        told["vehicle_classification"] = {"type": TYPE_HEAVY_TRUCK if truck else TYPE_CAR}
    return told


def _light(perceived: Perceived) -> Message:
    """The signal ahead, at its stop line."""
    x, y = point_at(perceived.path, perceived.station_m + perceived.stop_line_m)
    return {
        "id": {"value": SIGNAL_ID},
        "base": {"position": _vector(x, y)},
        "classification": {"color": COLOURS[perceived.signal], "mode": MODE_CONSTANT},
    }


def _vector(x: float, y: float, z: float = 0.0) -> Mapping[str, float]:
    return {"x": x, "y": y, "z": z}


def _timestamp(time_s: float) -> Mapping[str, int]:
    seconds, nanos = divmod(round(time_s * 1e9), 10**9)
    return {"seconds": seconds, "nanos": nanos}


def _point(told: Message, rear_axle_m: float) -> tuple[float, float, float]:
    """Time, and where the middle of the body is to be then."""
    at, place, yaw = told["timestamp"], told["position"], told["orientation"]["yaw"]
    time_s = at["seconds"] + at["nanos"] / 1e9
    return time_s, place["x"] + rear_axle_m * math.cos(yaw), place["y"] + rear_axle_m * math.sin(yaw)
