"""Ego that speaks ASAM OSI: literals by osi-python 3.8.0, and an episode."""

import math
from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.egos import Lane, StopLine
from risk_sac.egos.registry import SHIPPED
from risk_sac.egos.remote.osi import OsiEgo, ground_truth, road_message, trajectory_of
from risk_sac.egos.remote.osi_pb2 import GroundTruth, MotionRequest
from risk_sac.egos.seam import Perceived
from risk_sac.env.env import RiskSacEnv
from risk_sac.world.types import HEADING, LENGTH, OFFSET, SPEED, VX, VY, WIDTH, Kind, Road, Signal, X, Y

AHEAD_S, STEP_S = 2.0, 0.5

# Written by osi3.
GROUND_TRUTH = (
    "0a060803100818001208080110808c8d9e021a0208012a80010a02080112740a1b09000000000000124011000000000000fc3f19"
    "000000000000f83f121b09000000000000244011000000000000004019000000000000e83f1a1b09000000000000000011000000"
    "000000000019000000000000d03f221b0900000000000020401100000000000000401900000000000000001802320208042a8001"
    "0a02080212740a1b090000000000002440110000000000000440193333333333330b40121b090000000000004440110000000000"
    "00044019333333333333fb3f1a1b090000000000000000110000000000000000190000000000000000221b090000000000001840"
    "11000000000000000019000000000000000018023202080c2a7c0a02080312740a1b09000000000000e03f11000000000000e03f"
    "19000000000000fc3f121b090000000000004e4011000000000000184019000000000000ec3f1a1b090000000000000000110000"
    "00000000000019000000000000f8bf221b09000000000000000011000000000000f0bf19000000000000000018033a2d0a060880"
    "80808010121d121b0900000000008051401100000000000000001900000000000000001a04080218038a0182010a060881808080"
    "1012260a1b09000000000000000011000000000000000019000000000000000011000000000000000012260a1b09000000000000"
    "494011000000000000000019000000000000000011000000000000494012260a1b09000000000000594011000000000000000019"
    "00000000000000001100000000000059401800"
)
REQUEST = (
    "0a02080318012a9b010a320a08080110808c8d9e02121b0900000000000021401100000000000000401900000000000000001a09"
    "1900000000000000000a310a0708021080c2d72f121b0900000000000029401100000000000000401900000000000000001a0919"
    "00000000000000000a320a08080210808c8d9e02121b0900000000008030401100000000000000401900000000000000001a0919"
    "0000000000000000"
)


def perceived() -> Perceived:
    state = np.full((WIDTH + 1, 3), np.nan)
    state[[X, Y, HEADING, VX, VY, SPEED, LENGTH, WIDTH]] = [
        [10.0, 40.0, 60.0],
        [2.0, 2.5, 6.0],
        [0.25, 0.0, -1.5],
        [8.0, 6.0, 0.0],
        [2.0, 0.0, -1.0],
        [8.25, 6.0, 1.0],
        [4.5, 10.0, 0.5],
        [1.75, 2.5, 0.5],
    ]
    x, zero = np.array([0.0, 50.0, 100.0]), np.zeros(3)
    return Perceived(
        time_s=1.6,
        ids=("ego", "truck", "walker"),
        kind=np.array([Kind.VEHICLE, Kind.VEHICLE, Kind.PEDESTRIAN], dtype=np.int8),
        state=state,
        path=np.array([x, zero, x, zero, zero + 14.0, zero + 1.0, zero]),
        station_m=12.25,
        offset_m=2.0,
        signal=Signal.RED,
        stop_line_m=57.75,
    )


def test_what_is_told_is_an_osi_ground_truth():
    """The literal is what `osi3.GroundTruth.FromString` read, `SerializeToString` wrote again, byte for byte."""
    assert ground_truth(perceived(), {}, Road()).hex() == GROUND_TRUTH


A, B, THROUGH = (
    Lane("a_0", np.array([[0.0, 50.0], [0.0, 0.0]]), 4.0, 12.5, "a_1", "", True, False, (":j_0",), True),
    Lane("a_1", np.array([[0.0, 50.0], [4.0, 4.0]]), 4.0, 12.5, "", "a_0", False, False, (), False),
    Lane(":j_0", np.array([[50.0, 60.0], [0.0, 0.0]]), 4.0, 10.0, "", "", False, False, (), True),
)
ROAD = Road((A, B, THROUGH), (StopLine("a_0", ":j_0", "j", 0),))
# Written by osi3.
ROAD_MESSAGE = (
    "4a4a0a06088080808040121d0a1b090000000000000000110000000000000040190000000000000000121d0a1b090000000000004940"
    "1100000000000000401900000000000000001a0208044a4a0a06088180808040121d0a1b0900000000000000001100000000000000c0"
    "190000000000000000121d0a1b0900000000000049401100000000000000c01900000000000000001a0208064a4a0a06088280808040"
    "121d0a1b090000000000000000110000000000001840190000000000000000121d0a1b09000000000000494011000000000000184019"
    "00000000000000001a0208064a4a0a06088380808040121d0a1b09000000000000000011000000000000004019000000000000000012"
    "1d0a1b0900000000000049401100000000000000401900000000000000001a0208034a4a0a06088480808040121d0a1b090000000000"
    "004940110000000000000040190000000000000000121d0a1b090000000000004e401100000000000000401900000000000000001a02"
    "08024a4a0a06088580808040121d0a1b0900000000000049401100000000000000c0190000000000000000121d0a1b09000000000000"
    "4e401100000000000000c01900000000000000001a020802526a0a06088080808020126008021a1b0900000000000000001100000000"
    "000000001900000000000000001a1b09000000000000494011000000000000000019000000000000000020012a060881808080203a08"
    "120608828080802042060881808080404a0608808080804052600a06088180808020125608021a1b0900000000000000001100000000"
    "000010401900000000000000001a1b090000000000004940110000000000001040190000000000000000200132060880808080204206"
    "0883808080404a0608828080804052620a06088280808020125808041a1b090000000000004940110000000000000000190000000000"
    "0000001a1b090000000000004e4011000000000000000019000000000000000020013a080a0608808080802042060885808080404a06"
    "0884808080409a01290a0708808080808001100222080a060880808080208a011108001a0d0a0b09000000000080464010039a01290a"
    "0708818080808001100222080a060881808080208a011108001a0d0a0b09000000000080464010039a01290a07088280808080011002"
    "22080a060882808080208a011108001a0d0a0b0900000000000042401003"
)


def test_the_road_is_told_as_osi_lanes():
    """The literal is what `osi3.GroundTruth.FromString` read, `SerializeToString` wrote again, byte for byte."""
    assert road_message(ROAD).hex() == ROAD_MESSAGE
    own = ground_truth(perceived()._replace(signals=(Signal.YELLOW,)), {}, ROAD)
    truth = GroundTruth.FromString(own + road_message(ROAD))
    first, second, through = truth.lane
    assert [each.value for each in first.classification.left_adjacent_lane_id] == [second.id.value]
    assert first.classification.lane_pairing[0].successor_lane_id == through.id
    assert through.classification.lane_pairing[0].antecessor_lane_id == first.id
    left, right = truth.lane_boundary[:2]
    assert [point.position.y for point in left.boundary_line] == [2.0, 2.0]
    assert (left.classification.type, right.classification.type) == (4, 6)  # dashed, edge of the road
    assert truth.lane_boundary[3].classification.type == 3  # solid
    assert truth.logical_lane[0].traffic_rule[0].speed_limit.speed_limit_value.value == 45.0
    ahead, at_line = truth.traffic_light
    assert (ahead.classification.color, at_line.classification.color) == (2, 3)  # red, as perceived ahead; yellow
    assert at_line.base.position.x == 50.0
    assert list(at_line.classification.assigned_lane_id) == [through.id]
    assert len(truth.moving_object) == 3


def test_an_osi_motion_request_is_a_trajectory_of_the_middle_of_the_body():
    found = trajectory_of(bytes.fromhex(REQUEST), perceived(), 1.5)
    np.testing.assert_allclose(found.time_s, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(found.x_m, [10.0, 14.0, 18.0])
    np.testing.assert_allclose(found.y_m, [2.0, 2.0, 2.0])
    np.testing.assert_allclose(found.speed_mps, [8.0, 8.0, 8.0])


@pytest.mark.parametrize("nothing", ["", "0a00", "1801", "2200", "18012a020a00", "ff", "22"])
def test_what_is_no_motion_request_is_refused(nothing):
    with pytest.raises(ValueError, match="motion request"):
        trajectory_of(bytes.fromhex(nothing), perceived(), 1.5)


class ByOsi(OsiEgo):
    """Drives along its reference line at 8 m/s, by OSI messages only."""

    version = "1"
    response_time_s = 1.0

    def drive(self, told: bytes) -> bytes:
        truth = GroundTruth.FromString(told)
        now_s = truth.timestamp.seconds + truth.timestamp.nanos / 1e9
        (own,) = (each for each in truth.moving_object if each.id == truth.host_vehicle_id)
        position = own.base.position
        x, y = np.array([(at.world_position.x, at.world_position.y) for at in truth.reference_line[0].poly_line]).T
        along = np.insert(np.cumsum(np.hypot(np.diff(x), np.diff(y))), 0, 0.0)
        stations = np.arange(0.0, along[-1], 0.1)
        xs, ys = np.interp(stations, along, x), np.interp(stations, along, y)
        here = stations[np.argmin(np.hypot(xs - position.x, ys - position.y))]
        points = []
        for k in range(1, round(AHEAD_S / STEP_S) + 1):
            at = here + 8.0 * STEP_S * k - 1.35 + np.array((0.0, 0.1))  # of the rear axle
            (x0, x1), (y0, y1) = np.interp(at, along, x), np.interp(at, along, y)
            seconds, nanos = divmod(round((now_s + k * STEP_S) * 1e9), 10**9)
            pose = {"position": {"x": x0, "y": y0}, "orientation": {"yaw": math.atan2(y1 - y0, x1 - x0)}}
            points.append(pose | {"timestamp": {"seconds": seconds, "nanos": nanos}})
        request = MotionRequest(motion_request_type=1, desired_trajectory={"trajectory_point": points})
        return request.SerializeToString()


def test_it_drives_an_episode(monkeypatch):
    monkeypatch.setitem(SHIPPED, "by-osi", "tests.unit.egos.test_osi:ByOsi")
    spec = RunSpec(family="low", method="random", seed=0, ego=EgoConfig(driver="by-osi"))
    with closing(RiskSacEnv(RiskSacEnv.of(spec).problem, spec.learner.reward, controlled=False)) as env:
        env.reset(seed=2)
        for _ in range(60):
            env.step(np.zeros(env.action_size, dtype=np.float32))
        frames = env.trace.frames
    assert frames[-1].speed_mps[0] == pytest.approx(8.0, abs=0.3)
    assert abs(frames[-1].state[OFFSET, 0]) < 0.3
