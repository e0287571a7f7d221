"""The planners of `fiss-planner` on roads drawn by hand, from either side."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.egos import registry
from risk_sac.egos.guard import Guarded
from risk_sac.egos.pilot import advance
from risk_sac.egos.planners.route import SignalStops, stops
from risk_sac.egos.seam import EpisodeStart, Perceived, Trajectory, Vehicle
from risk_sac.sim.pilot import Motion
from risk_sac.world.types import (
    ACCEL,
    HEADING,
    LENGTH,
    SPEED,
    STEP_S,
    VX,
    VY,
    WIDTH,
    Kind,
    Lane,
    Road,
    Signal,
    StopLine,
    X,
    Y,
)

PLANNERS = ("fop", "fiss", "fiss-plus")
VEHICLE = Vehicle(length_m=4.6, width_m=1.85)
WIDTH_M, LIMIT_MPS, END_M = 3.3, 13.9, 400.0
Other = Callable[[float], tuple[float, float, float]]  # its x, y and speed along x at a time


def two_lanes(*, right: bool = True, change: bool = True, stop_line: bool = False) -> Road:
    """Straight road along x with a lane beside, divided at 300 m."""
    side = -WIDTH_M if right else WIDTH_M
    names = ("own", "beside") if right else ("beside", "own")  # from left to right
    lanes = []
    for part, first_m, last_m in (("a", 0.0, 300.0), ("b", 300.0, END_M)):
        for name, y in (("own", 0.0), ("beside", side)):
            line = np.array([[first_m, last_m], [y, y]])
            left, other = ("", f"{part}_{names[1]}") if name == names[0] else (f"{part}_{names[0]}", "")
            after = (f"b_{name}",) if part == "a" else ()
            may = bool(left) and change, bool(other) and change
            lanes.append(Lane(f"{part}_{name}", line, WIDTH_M, LIMIT_MPS, left, other, *may, after, True))
    lines = tuple(StopLine(f"a_{name}", f"b_{name}", "signal", i) for i, name in enumerate(("own", "beside")))
    return Road(tuple(lanes), lines if stop_line else ())


def perceived(motion: Motion, time_s: float, others: list[tuple[float, float, float]], signal: Signal) -> Perceived:
    state = np.full((WIDTH + 1, 1 + len(others)), np.nan)
    cos, sin = math.cos(motion.heading_rad), math.sin(motion.heading_rad)
    own = (motion.x_m, motion.y_m, motion.heading_rad, motion.speed_mps * cos, motion.speed_mps * sin, motion.speed_mps)
    columns = [own, *((x, y, 0.0, speed, 0.0, abs(speed)) for x, y, speed in others)]
    state[[X, Y, HEADING, VX, VY, SPEED]] = np.array(columns).T
    state[[LENGTH, WIDTH]] = [[VEHICLE.length_m], [VEHICLE.width_m]]
    state[ACCEL, 0] = motion.accel_mps2
    kind = np.full(state.shape[1], Kind.VEHICLE, dtype=np.int8)
    ids = ("ego", *(f"other{i}" for i in range(len(others))))
    return Perceived(time_s, ids, kind, state, np.empty((7, 0)), 0.0, 0.0, signal, math.inf, (signal,) * 2)


def drive(
    name: str,
    road: Road,
    others: tuple[Other, ...] = (),
    *,
    steps: int = 120,
    start: Motion,
    signal: Signal = Signal.NONE,
) -> list[Motion]:
    """Motions of an ego among others that nothing stops."""
    make, _ = registry.make(name, "ego")
    ego, motions = Guarded(make, math.inf), [start]
    ego.reset(EpisodeStart(seed=0, net="", route=(), vehicle=VEHICLE, step_s=STEP_S, road=road))
    for step in range(steps):
        seen = [other(step * STEP_S) for other in others]
        lit = signal if road.stop_lines else Signal.NONE
        view = perceived(motions[-1], step * STEP_S, seen, lit)
        command = ego.act(view if road.stop_lines else view._replace(signals=()))
        assert not isinstance(command, Trajectory)
        motions.append(advance(motions[-1], *command, VEHICLE, STEP_S))
    return motions


@pytest.mark.parametrize("name", PLANNERS)
@pytest.mark.parametrize("signal", [Signal.RED, Signal.GREEN])
def test_it_stops_before_a_red_light_only(name, signal):
    start = Motion(220.0, 0.0, 0.0, 12.0)
    last = drive(name, two_lanes(stop_line=True), steps=130, start=start, signal=signal)[-1]
    front_m = last.x_m + VEHICLE.length_m / 2
    if signal is Signal.RED:
        assert 290.0 < front_m <= 300.0
        assert last.speed_mps < 0.3
    else:
        assert front_m > 310.0


def slow(time_s: float, x_m: float = 60.0, speed_mps: float = 3.0) -> tuple[float, float, float]:
    return x_m + speed_mps * time_s, 0.0, speed_mps


@pytest.mark.parametrize("name", ["fop", "fiss-plus"])  # FISS stays behind it
@pytest.mark.parametrize("right", [True, False])
@pytest.mark.parametrize("change", [True, False])
def test_it_overtakes_where_the_markings_let_it(name, right, change):
    motions = drive(name, two_lanes(right=right, change=change), (slow,), start=Motion(20.0, 0.0, 0.0, 12.0))
    aside_m = max(motion.y_m * (-1.0 if right else 1.0) for motion in motions)
    ahead_m = motions[-1].x_m - slow(12.0)[0]
    if change:
        assert aside_m == pytest.approx(WIDTH_M, abs=0.6)
        assert ahead_m > VEHICLE.length_m
    else:
        assert abs(motions[-1].y_m) < 0.7
        assert ahead_m < -VEHICLE.length_m


def test_a_mirrored_scene_is_driven_mirrored():
    left, right = (
        drive("fiss-plus", two_lanes(right=side), (slow,), start=Motion(20.0, 0.0, 0.0, 12.0)) for side in (False, True)
    )
    np.testing.assert_allclose([m.x_m for m in left], [m.x_m for m in right], atol=0.5)
    np.testing.assert_allclose([m.y_m for m in left], [-m.y_m for m in right], atol=0.3)


@pytest.mark.parametrize("name", PLANNERS)
def test_it_brakes_as_hard_as_the_car_can_where_it_finds_no_plan(name):
    wall = partial(slow, x_m=42.0, speed_mps=0.0)
    motions = drive(name, two_lanes(change=False), (wall,), steps=20, start=Motion(20.0, 0.0, 0.0, 13.0))
    assert min(motion.accel_mps2 for motion in motions) == pytest.approx(-VEHICLE.brake_mps2)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_follows_its_plan_back_to_the_middle_of_its_lane(side):
    road = two_lanes(right=side > 0.0, change=False)
    motions = drive("fiss-plus", road, steps=40, start=Motion(20.0, 0.8 * side, 0.15 * side, 8.0))
    assert max(side * motion.y_m for motion in motions) < 1.9  # as its plans, which reach 1.7 m


@pytest.mark.parametrize(("ahead_m", "stopped"), [(25.0, True), (10.0, False)])
def test_a_yellow_light_stops_it_where_it_can_still_stop(ahead_m, stopped):
    motion = Motion(300.0 - ahead_m - VEHICLE.length_m / 2, 0.0, 0.0, 12.0)  # from 12 m/s, 4.5 m/s² take 16 m
    view = perceived(motion, 0.0, [], Signal.YELLOW)
    assert stops(two_lanes(stop_line=True), view, SignalStops())[0] is stopped


def test_it_keeps_stopping_at_a_yellow_light_until_the_light_changes():
    signals = SignalStops()
    near = {"speed_mps": 12.0, "way_m": 10.0}  # 4.5 m/s² no longer do
    assert not signals.at(0, Signal.YELLOW, **near)
    assert signals.at(0, Signal.YELLOW, speed_mps=12.0, way_m=25.0)
    assert signals.at(0, Signal.YELLOW, **near)
    assert not signals.at(1, Signal.YELLOW, **near)
    assert not signals.at(0, Signal.GREEN, **near)
    assert not signals.at(0, Signal.YELLOW, **near)


CAR = Vehicle(length_m=4.6, width_m=1.85)
numbers = st.floats(-1e6, 1e6)


def bicycle_drive(motion: Motion, accel: float, steering: float, steps: int, vehicle: Vehicle = CAR) -> list[Motion]:
    found = [motion]
    for _ in range(steps):
        found.append(advance(found[-1], accel, steering, vehicle, 0.1))
    return found


@pytest.mark.parametrize("steering", [0.1, -0.1])
def test_it_comes_back_to_where_it_began_on_a_circle_of_the_steering_s_radius(steering):
    curvature = 2 * math.sin(math.atan(math.tan(steering) / 2)) / CAR.wheelbase_m
    start = Motion(0.0, 0.0, 0.0, 5.0, 0.0, steering)
    steps = 240
    around = 2 * math.pi / abs(curvature) / 5.0 / steps
    motion = start
    for _ in range(steps):
        motion = advance(motion, 0.0, steering, CAR, around)
    assert math.hypot(motion.x_m, motion.y_m) < 1e-6
    assert abs(motion.heading_rad) == pytest.approx(2 * math.pi)


def test_a_braking_builds_up_at_its_jerk_and_ends_at_a_standstill():
    motions = bicycle_drive(Motion(0.0, 0.0, 0.0, 10.0), -100.0, 0.0, 30)
    assert motions[1].accel_mps2 == pytest.approx(-1.265)
    assert min(m.accel_mps2 for m in motions) == pytest.approx(-9.0)
    assert motions[-1].speed_mps == 0.0
    assert motions[-1].x_m == motions[-2].x_m


@settings(deadline=None)
@given(numbers, numbers, st.floats(0, 40), st.floats(2, 10))
def test_no_command_takes_it_beyond_its_limits(accel, steering, speed, grip):
    car = Vehicle(length_m=4.6, width_m=1.85, brake_mps2=min(9.0, grip), grip_mps2=grip)
    before, *after = bicycle_drive(Motion(0.0, 0.0, 0.0, speed), accel, steering, 5, car)
    for m in after:
        sideways = before.speed_mps * abs(m.heading_rad - before.heading_rad) / 0.1
        assert math.hypot(m.accel_mps2, min(sideways, grip)) <= grip * 1.01 + 0.05
        assert sideways <= grip * 1.01 + 0.3  # the speed of a step changes while it lasts
        assert -car.brake_mps2 - 1e-9 <= m.accel_mps2 <= car.accel_mps2 + 1e-9
        assert m.accel_mps2 >= before.accel_mps2 - car.brake_jerk_mps3 * 0.1 - 1e-9 or before.accel_mps2 > 0
        assert abs(m.steering_rad) <= car.steering_rad
        assert m.speed_mps >= 0.0
        before = m


def test_left_and_right_are_mirrored():
    left, right = (bicycle_drive(Motion(0.0, 0.0, 0.0, 8.0), 1.0, side * 0.2, 20)[-1] for side in (1, -1))
    assert (left.x_m, left.y_m, left.heading_rad) == pytest.approx((right.x_m, -right.y_m, -right.heading_rad))
