"""Kinematic limits of commands; tests/integration/test_adversaries.py has what SUMO drives."""

import math
from dataclasses import replace
from itertools import pairwise
from random import Random
from typing import Any, get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.config import Behaviour, DynamicElements, Odd
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.limits import GRAVITY_MPS2, Limits, limits_from_odd
from risk_sac.scenario.odd import intersect
from risk_sac.sim.control import PedestrianControl
from risk_sac.sim.paths import Along, Path
from risk_sac.sim.roads import LateralRoom
from risk_sac.sim.solid import VehicleCommand, Walker
from risk_sac.sim.vehicle_control import CORRECTION_PER_M, VehicleControl
from risk_sac.world.types import STEP_S
from tests.roads import STRAIGHT_M, arc_m, road

LIMITS = Limits(
    speed_mps=16.67,
    accel_mps2=3.5,
    brake_mps2=8.0,
    grip_mps2=9.3,
    jerk_mps3=20.0,
    lateral_mps=1.2,
    lateral_accel_mps2=1.5,
    walk_speed_mps=2.0,
    walk_accel_mps2=1.5,
    walk_brake_mps2=1.5,
    heading_rate_radps=2.0,
)
EPS = 1e-9
WIDE = LateralRoom(left_m=50.0, right_m=50.0)
STRAIGHT = Along(road(), 0.0, 0.0)
Actions = list[tuple[float, float]]


def sequence(seed: int) -> Actions:
    """Actions of 12 s: uniform, bang-bang, flat out, or biased."""
    random = Random(seed)
    kind = random.choice(("uniform", "bang-bang", "flat out", "biased"))
    bias = random.uniform(-1, 1), random.uniform(-1, 1)
    actions = [(1.0, 1.0)]
    for _ in range(120):
        if kind == "uniform":
            actions.append((random.uniform(-1, 1), random.uniform(-1, 1)))
        elif kind == "biased":
            drive_, steer = (min(max(b + random.gauss(0, 0.4), -1.0), 1.0) for b in bias)
            actions.append((drive_, steer))
        elif random.random() < 0.1:
            actions.append((1.0 if kind == "flat out" else random.choice((-1.0, 1.0)), random.choice((-1.0, 1.0))))
        else:
            actions.append(actions[-1])
    return actions


sequences = st.integers(0, 2**32).map(sequence)


def limits_on(friction: float, **dynamic: Any) -> Limits:
    odd = intersect(FAMILIES["dense"].odd, Odd(dynamic=DynamicElements(**dynamic)))
    return limits_from_odd(odd, friction)


def drive(
    actions: Actions,
    limits: Limits,
    start_mps: float,
    path: Path,
    half_m: float,
    start_m: float = 0.0,
    ends_m: float = math.inf,
) -> tuple[VehicleControl, list[VehicleCommand], list[float], list[float]]:
    """Drives a road of 2·half_m; returns control, commands, stations and offsets."""
    control = VehicleControl(limits, start_mps)
    commands, stations, offsets = [VehicleCommand(start_mps, 0.0)], [start_m], [0.0]
    for action in actions:
        room = LateralRoom(left_m=half_m - offsets[-1], right_m=half_m + offsets[-1])
        commands.append(control.step(*action, room, Along(path, stations[-1], offsets[-1], ends_m)))
        stations.append(stations[-1] + (commands[-2].speed_mps + commands[-1].speed_mps) / 2 * STEP_S)
        offsets.append(offsets[-1] + commands[-1].lateral_mps * STEP_S)
    return control, commands, stations, offsets


odds = st.sampled_from([{"behaviour": behaviour} for behaviour in get_args(Behaviour)])
frictions, radii, sides = st.floats(0.3, 1.0), st.floats(7, 40), st.booleans()


@settings(max_examples=50)
@given(sequences, frictions, radii, sides, st.floats(0, 16), st.floats(0.3, 5), odds)
def test_a_vehicle_keeps_the_friction_circle_every_limit_inside_it_and_its_road(
    actions, friction, radius, left, start_mps, half_m, odd
):
    limits = limits_on(friction, **odd)
    _, commands, stations, offsets = drive(actions, limits, start_mps, road(radius, left=left), half_m)
    for before, after in pairwise(commands):  # and it drives no tighter than a car can
        if before.speed_mps > 0.1 and after.speed_mps > 0.1:
            turned = after.lateral_mps / after.speed_mps - before.lateral_mps / before.speed_mps
            tightest = max(limits.curvature_per_m, 1 / radius + CORRECTION_PER_M)
            assert abs(turned) <= tightest * after.speed_mps * STEP_S + EPS
    assert max(map(abs, offsets)) <= half_m
    begin, end = arc_m(radius)
    if start_mps**2 > limits.cornering_mps2 * radius + 2 * limits.approach_mps2 * (begin - 10):
        return  # no braking is hard enough to slow down for the bend in time
    accels = [0.0] + [(b.speed_mps - a.speed_mps) / STEP_S for a, b in pairwise(commands)]
    for step, (before, after) in enumerate(pairwise(commands)):
        across = (after.lateral_mps - before.lateral_mps) / STEP_S
        curvature = 1 / radius if begin <= stations[step] <= end else 0.0
        cornering = max(before.speed_mps, after.speed_mps) ** 2 * curvature
        assert math.hypot(accels[step + 1], cornering + abs(across)) <= friction * GRAVITY_MPS2
        assert 0 <= after.speed_mps <= limits.speed_mps
        assert -limits.brake_mps2 - EPS <= accels[step + 1] <= limits.accel_mps2 + EPS
        assert abs(accels[step + 1] - accels[step]) <= limits.jerk_mps3 * STEP_S + 1e-6
        assert abs(after.lateral_mps) <= min(limits.lateral_mps, limits.slip * after.speed_mps) + EPS
        assert abs(across) <= limits.lateral_accel_mps2 + EPS


@settings(max_examples=50)
@given(sequences, frictions, radii, st.floats(0, 16))
def test_steering_the_other_way_on_the_mirrored_road_is_mirrored(actions, friction, radius, start_mps):
    mirrored = [(a, -s) for a, s in actions]
    _, one, *_ = drive(actions, limits_on(friction), start_mps, road(radius), 2.0)
    _, other, *_ = drive(mirrored, limits_on(friction), start_mps, road(radius, left=False), 2.0)
    for a, b in zip(one, other, strict=True):
        assert a.speed_mps == pytest.approx(b.speed_mps, abs=1e-9)
        assert a.lateral_mps == pytest.approx(-b.lateral_mps, abs=1e-9)


@pytest.mark.parametrize("friction", [0.6, 0.8, 1.0])
@pytest.mark.parametrize("radius", [7.0, 10.0, 20.0])
@pytest.mark.parametrize("left", [True, False])
def test_who_wants_through_a_bend_at_full_speed_is_slowed_and_goes_on(friction, radius, left):
    limits = limits_on(friction)
    _, commands, stations, _ = drive([(1.0, 0.0)] * 200, limits, 13.0, road(radius, left=left), 1.0)
    begin, end = arc_m(radius)
    through = [c.speed_mps for c, s in zip(commands, stations, strict=True) if begin <= s <= end]
    assert max(through) ** 2 / radius <= friction * GRAVITY_MPS2
    assert max(through) ** 2 / radius >= 0.4 * friction * GRAVITY_MPS2  # and it does not creep either
    assert commands[-1].speed_mps > 13.0


@settings(max_examples=50)
@given(sequences, st.floats(0.6, 1.0), st.floats(8, 14), sides)
def test_who_starts_too_fast_inside_a_bend_slows_down_until_it_may_drive_as_it_wants(actions, friction, radius, left):
    limits = limits_on(friction)
    start_mps = 1.2 * math.sqrt(limits.grip_mps2 * radius)
    path = road(radius, left=left, turn_rad=3 * math.pi)
    _, commands, stations, _ = drive(actions, limits, start_mps, path, 1.0, start_m=STRAIGHT_M + 6.0)
    _, end = arc_m(radius, 3 * math.pi)
    inside = [c.speed_mps for c, station in zip(commands, stations, strict=True) if station < end]
    for before, after in pairwise(inside[6:]):  # its jerk takes it some steps to begin
        if before**2 / radius > 1.02 * limits.grip_mps2:
            assert after < before


def test_a_vehicle_at_full_speed_stops_just_before_its_lane_ends():
    _, commands, stations, _ = drive([(1.0, 0.0)] * 150, LIMITS, 15.0, road(), 1.75, ends_m=90.0)
    assert 85.0 < stations[-1] < 90.0
    assert commands[-1].speed_mps == pytest.approx(0.0, abs=0.1)
    accels = [(after.speed_mps - before.speed_mps) / STEP_S for before, after in pairwise(commands)]
    assert min(accels) > -LIMITS.brake_mps2 - EPS


def test_braking_to_a_halt_by_hand():
    control = VehicleControl(LIMITS, 10.0)
    speeds = [control.step(-1.0, 0.0, WIDE, STRAIGHT).speed_mps for _ in range(30)]
    assert speeds[:4] == pytest.approx([9.8, 9.4, 8.8, 8.0])  # a = -2, -4, -6, -8
    assert speeds[4] == pytest.approx(7.2)
    assert speeds[-1] == pytest.approx(0.0, abs=0.05)


@settings(max_examples=50)
@given(sequences, st.floats(0, 2), st.floats(-math.pi, math.pi), st.sampled_from((2.0, 3.0)))
def test_pedestrians_keep_their_limits(actions, speed_mps, heading, top_mps):
    limits = replace(LIMITS, walk_speed_mps=top_mps)
    control = PedestrianControl(limits, Walker(0.0, 0.0, heading, speed_mps))
    walked = [control.state] + [control.step(*a) for a in actions]
    for before, after in pairwise(walked):
        accel = (after.speed_mps - before.speed_mps) / STEP_S
        rate = (after.heading_rad - before.heading_rad) / STEP_S
        assert 0.0 <= after.speed_mps <= top_mps
        assert after.accel_mps2 == pytest.approx(accel)
        assert abs(accel - before.accel_mps2) <= limits.walk_jerk_mps3 * STEP_S + 1e-6
        assert abs(rate) <= limits.heading_rate_radps + EPS
        assert math.hypot(accel, max(before.speed_mps, after.speed_mps) * rate) <= 1.5 + 1e-6
    for a, b, c in zip(walked, walked[1:], walked[2:], strict=False):  # and as the positions tell it
        assert math.hypot(a.x_m - 2 * b.x_m + c.x_m, a.y_m - 2 * b.y_m + c.y_m) / STEP_S**2 <= 1.5 + 1e-6


@settings(max_examples=50)
@given(sequences, st.floats(0, 2))
def test_a_pedestrian_that_turns_the_other_way_is_mirrored(actions, speed_mps):
    one, other = (PedestrianControl(LIMITS, Walker(0.0, 0.0, 0.0, speed_mps)) for _ in range(2))
    for drive_, turn in actions:
        a, b = one.step(drive_, turn), other.step(drive_, -turn)
        assert (a.x_m, a.y_m, a.speed_mps) == pytest.approx((b.x_m, -b.y_m, b.speed_mps))
