import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.egos.bicycle import advance
from risk_sac.egos.seam import Vehicle
from risk_sac.sim.pilot import Motion

CAR = Vehicle(length_m=4.6, width_m=1.85)
numbers = st.floats(-1e6, 1e6)


def drive(motion: Motion, accel: float, steering: float, steps: int, vehicle: Vehicle = CAR) -> list[Motion]:
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
    motions = drive(Motion(0.0, 0.0, 0.0, 10.0), -100.0, 0.0, 30)
    assert motions[1].accel_mps2 == pytest.approx(-1.265)
    assert min(m.accel_mps2 for m in motions) == pytest.approx(-9.0)
    assert motions[-1].speed_mps == 0.0
    assert motions[-1].x_m == motions[-2].x_m


@settings(deadline=None)
@given(numbers, numbers, st.floats(0, 40), st.floats(2, 10))
def test_no_command_takes_it_beyond_its_limits(accel, steering, speed, grip):
    car = Vehicle(length_m=4.6, width_m=1.85, brake_mps2=min(9.0, grip), grip_mps2=grip)
    before, *after = drive(Motion(0.0, 0.0, 0.0, speed), accel, steering, 5, car)
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
    left, right = (drive(Motion(0.0, 0.0, 0.0, 8.0), 1.0, side * 0.2, 20)[-1] for side in (1, -1))
    assert (left.x_m, left.y_m, left.heading_rad) == pytest.approx((right.x_m, -right.y_m, -right.heading_rad))
