"""Adversaries and the bodies of others; what SUMO then drives is tests/integration/test_adversaries.py."""

import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.sim.control import PedestrianControl
from risk_sac.sim.paths import Along
from risk_sac.sim.roads import LateralRoom
from risk_sac.sim.solid import ALONE, Walker
from risk_sac.sim.vehicle_control import VehicleControl
from risk_sac.world.types import HEADING, LENGTH, SPEED, STEP_S, VX, VY, WIDTH, Floats, X, Y
from tests.roads import road
from tests.unit.sim.test_control import LIMITS

CAR_M = (4.6, 1.85)
WALKER_M = (0.5, 0.5)
EGO = (-500.0, 0.0, 0.0, 0.0)  # far away, if a test is not about it
HALF_M = CAR_M[0] / 2
Pose = tuple[float, float, float, float]  # x, y, heading, speed


def frame_of(*actors: Pose, sizes: dict[int, tuple[float, float]] | None = None) -> Floats:
    state = np.zeros((WIDTH + 1, len(actors)))
    for column, (x, y, heading, speed) in enumerate(actors):
        length, width = (sizes or {}).get(column, CAR_M)
        rows = (X, Y, HEADING, VX, VY, SPEED, LENGTH, WIDTH)
        state[rows, column] = x, y, heading, speed * math.cos(heading), speed * math.sin(heading), speed, length, width
    return state


def moved(pose: Pose, time_s: float) -> Pose:
    x, y, heading, speed = pose
    return x + time_s * speed * math.cos(heading), y + time_s * speed * math.sin(heading), heading, speed


def driven(
    action: tuple[float, float], others: list[Pose], *, speed: float = 10.0, ego: Pose = EGO, keeps_clear: bool = True
) -> list[Pose]:
    """6 s of a vehicle from 0 along x under constant action."""
    control, path, wide = VehicleControl(LIMITS, speed), road(), LateralRoom(50.0, 50.0)
    station, offset, poses = 0.0, 0.0, [(-HALF_M, 0.0, 0.0, speed)]
    for step in range(60):
        state = frame_of(ego, poses[-1], *(moved(other, step * STEP_S) for other in others))
        others_there = (state, 1) if keeps_clear else ALONE
        command = control.step(*action, wide, Along(path, station, offset), others=others_there)
        station += (poses[-1][3] + command.speed_mps) / 2 * STEP_S
        offset += command.lateral_mps * STEP_S
        poses.append((station - HALF_M, offset, 0.0, command.speed_mps))
    return poses


@pytest.mark.parametrize("speed", [2.0, 10.0, 16.0])
@pytest.mark.parametrize("beside_m", [-1.8, 0.0, 1.8])
def test_at_full_throttle_a_vehicle_stops_behind_one_that_stands(speed, beside_m):
    standing = (40.0, beside_m, 0.0, 0.0)
    x, _, _, ends_mps = driven((1.0, 0.0), [standing], speed=speed)[-1]
    assert ends_mps == pytest.approx(0.0, abs=1e-3)
    assert 0.0 < 40.0 - x - CAR_M[0] < 1.0
    assert driven((1.0, 0.0), [standing], speed=speed, keeps_clear=False)[-1][0] > 45.0


@pytest.mark.parametrize(
    "other",
    [
        (40.0, 3.3, 0.0, 0.0),  # in the lane beside
        (-15.0, 0.0, 0.0, 20.0),  # behind, and faster
        (40.0, -20.0, math.pi / 2, 0.0),  # stands at a stop line
        (30.0, -30.0, math.pi / 2, 25.0),  # crosses long before
    ],
)
def test_what_is_not_in_its_way_changes_nothing(other):
    assert driven((1.0, 0.0), [other]) == driven((1.0, 0.0), [other], keeps_clear=False)


@pytest.mark.parametrize("side", [-1, 1])
def test_the_ego_is_no_body_to_keep_clear_of(side):
    ego = (2.0, side * 3.3, 0.0, 10.0)
    assert driven((0.0, side), [], ego=ego) == driven((0.0, side), [], keeps_clear=False)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("ahead_m", [-5.0, -2.3, 1.0])
def test_a_vehicle_does_not_steer_into_the_one_beside_it(side, ahead_m):
    beside = (ahead_m, side * 3.3, 0.0, 10.0)
    poses = driven((0.0, side), [beside])
    assert max(side * y for _, y, _, _ in poses) < 3.3 - CAR_M[1]
    assert max(side * y for _, y, _, _ in driven((0.0, side), [beside], keeps_clear=False)) > 3.3


@pytest.mark.parametrize("side", [-1, 1])
def test_a_vehicle_lets_another_cross(side):
    crossing = (40.0, side * -28.0, side * math.pi / 2, 9.0)  # at x = 40 after 3.1 s
    for step, (x, _, _, _) in enumerate(driven((1.0, 0.0), [crossing])):
        y = moved(crossing, step * STEP_S)[1]
        assert abs(y) > (CAR_M[0] + CAR_M[1]) / 2 or abs(x - 40.0) > (CAR_M[0] + CAR_M[1]) / 2


def leaves_late(side: int, at_m: float, *, statics: int = 1, beside: Pose | None = None) -> list[Pose]:
    """Steers aside `at_m` before a standing body, at 15 m/s."""
    control, path, wide = VehicleControl(LIMITS, 15.0), road(), LateralRoom(50.0, 50.0)
    station, offset, poses = 0.0, 0.0, [(-HALF_M, 0.0, 0.0, 15.0)]
    standing = (100.0, 0.0, 0.0, 0.0)
    for step in range(80):
        others = [poses[-1], *([moved(beside, step * STEP_S)] if beside else []), standing]
        near = 100.0 - HALF_M - station < at_m
        action = (0.0, float(side) if near else 0.0)
        state = frame_of(EGO, *others)
        command = control.step(*action, wide, Along(path, station, offset), others=(state, 1), statics=statics)
        station += (poses[-1][3] + command.speed_mps) / 2 * STEP_S
        offset += command.lateral_mps * STEP_S
        poses.append((station - HALF_M, offset, 0.0, command.speed_mps))
    return poses


def touched(poses: list[Pose], standing_m: float = 100.0) -> bool:
    return any(abs(standing_m - x) < CAR_M[0] and abs(y) < CAR_M[1] for x, y, _, _ in poses)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_vehicle_goes_round_a_static_body_before_which_it_could_not_stop_any_more(side):
    poses = leaves_late(side, 36.0)
    x, y, _, _ = poses[-1]
    assert not touched(poses)
    assert x > 105.0
    assert y * side > CAR_M[1]
    assert min(pose[3] for pose in poses) > 14.9
    stays_able = leaves_late(side, 36.0, statics=0)  # before one that may move it stays able to stop
    assert not touched(stays_able)
    assert min(pose[3] for pose in stays_able if pose[0] < 95.0) < 14.0


@pytest.mark.parametrize("side", [-1, 1])
def test_a_vehicle_stops_before_a_static_body_that_it_cannot_go_round(side):
    for poses in (leaves_late(side, 15.0), leaves_late(side, 36.0, beside=(-HALF_M, side * 3.3, 0.0, 15.0))):
        assert not touched(poses)
        assert poses[-1][3] < 0.1


def walked(turn: float, parked: Pose) -> list[Walker]:
    """6 s of a pedestrian running from the origin along x."""
    control = PedestrianControl(LIMITS, Walker(0.0, 0.0, 0.0, 1.5))
    walkers = [control.state]
    for _ in range(60):
        at = walkers[-1]
        me = (at.x_m, at.y_m, at.heading_rad, at.speed_mps)
        walkers.append(control.step(1.0, turn, (frame_of(EGO, me, parked, sizes={1: WALKER_M}), 1)))
    return walkers


@pytest.mark.parametrize("heading", [0.0, math.pi / 2, -math.pi / 2, math.pi])
@pytest.mark.parametrize("turn", [-0.1, 0.0, 0.1])
def test_a_pedestrian_stops_before_a_parked_car(turn, heading):
    walkers = walked(turn, (6.0, 0.5, heading, 0.0))
    near_m = 6.0 - (CAR_M[0] if abs(math.cos(heading)) > 0.5 else CAR_M[1]) / 2
    assert max(w.x_m for w in walkers) < near_m - 0.25
    assert walkers[-1].speed_mps < 0.1


def test_a_pedestrian_walks_on_from_a_car_that_it_stands_at():
    away = PedestrianControl(LIMITS, Walker(0.0, 0.0, 0.0, 0.0))
    parked = (-HALF_M - 0.36, 0.0, 0.0, 0.0)
    for _ in range(30):
        at = away.state
        away.step(1.0, 0.0, (frame_of(EGO, (at.x_m, at.y_m, 0.0, at.speed_mps), parked, sizes={1: WALKER_M}), 1))
    assert away.state.x_m > 2.0
    assert replace(away.state, x_m=0.0, speed_mps=0.0, accel_mps2=0.0) == Walker(0.0, 0.0, 0.0, 0.0)
