"""Kinematic limits as properties: of the commands, and of what SUMO then drove."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES, Family
from risk_sac.scenario.limits import Limits, limits_from_odd
from risk_sac.sim.control import Adversaries, PedestrianControl, VehicleControl
from risk_sac.sim.sumo import Room, SumoSimulation, Walker
from risk_sac.types import STEP_S, Floats, Frame, Kind

LIMITS = Limits(
    speed_mps=16.67,
    accel_mps2=3.5,
    brake_mps2=8.0,
    walk_speed_mps=4.0,
    walk_accel_mps2=3.0,
    walk_brake_mps2=4.0,
)
EPS = 1e-9
ROUNDING = 0.02  # of SUMO's positions and speeds, divided by the step where a derivative is taken
WIDE = Room(left_m=50.0, right_m=50.0)
action = st.one_of(st.sampled_from((-1.0, 0.0, 1.0)), st.floats(-1, 1))
stretch = st.tuples(action, action, st.integers(1, 25)).map(lambda s: [s[:2]] * s[2])  # a manoeuvre lasts a while
actions = st.lists(stretch, min_size=1, max_size=8).map(lambda parts: [a for part in parts for a in part])
grip = st.floats(0.3, 1.0)


def slippery(friction: float) -> Limits:
    return limits_from_odd(FAMILIES["low"].odd, friction)


@given(actions, st.floats(0, 1), grip)
def test_commanded_speed_acceleration_and_jerk_keep_their_limits(
    sequence: list[tuple[float, float]], start: float, friction: float
) -> None:
    limits = slippery(friction)
    control = VehicleControl(limits, start * limits.speed_mps)
    speeds = [control.speed_mps] + [control.step(*a, WIDE).speed_mps for a in sequence]
    accels = [0.0] + [(after - before) / STEP_S for before, after in pairwise(speeds)]
    assert all(0.0 <= speed <= limits.speed_mps for speed in speeds)
    assert all(-limits.brake_mps2 - EPS <= a <= limits.accel_mps2 + EPS for a in accels)
    assert all(abs(after - before) <= limits.jerk_mps3 * STEP_S + 1e-6 for before, after in pairwise(accels))


@given(actions, st.floats(0, 16.67), st.floats(0, 4), st.floats(0, 4))
def test_commanded_lateral_motion_keeps_its_limits_and_the_road(
    sequence: list[tuple[float, float]], speed_mps: float, left_m: float, right_m: float
) -> None:
    control, offset, previous = VehicleControl(LIMITS, speed_mps), 0.0, 0.0
    for drive, steer in sequence:
        command = control.step(drive, steer, Room(left_m=left_m - offset, right_m=right_m + offset))
        assert abs(command.lateral_mps) <= LIMITS.lateral_mps + EPS
        assert abs(command.lateral_mps) <= LIMITS.slip * command.speed_mps + EPS
        assert abs(command.lateral_mps - previous) <= LIMITS.lateral_accel_mps2 * STEP_S + EPS
        offset, previous = offset + command.lateral_mps * STEP_S, command.lateral_mps
        assert -right_m - 0.01 <= offset <= left_m + 0.01


def test_a_full_action_reaches_the_limits_it_is_a_share_of() -> None:
    control = VehicleControl(LIMITS, 10.0)
    for _ in range(5):
        command = control.step(-1.0, 1.0, WIDE)
    assert control.accel_mps2 == pytest.approx(-8.0)  # 2 m/s² more per step at 20 m/s³
    assert command.lateral_mps == pytest.approx(0.2 * command.speed_mps)  # of 2.0 allowed, 1.4 at this speed
    control = VehicleControl(LIMITS, 12.0)
    for _ in range(5):
        command = control.step(1.0, 1.0, WIDE)
    assert control.accel_mps2 == pytest.approx(3.5)
    assert command.lateral_mps == pytest.approx(2.0)


def test_braking_to_a_halt_by_hand() -> None:
    control = VehicleControl(LIMITS, 10.0)
    speeds = [control.step(-1.0, 0.0, WIDE).speed_mps for _ in range(30)]
    assert speeds[:4] == pytest.approx([9.8, 9.4, 8.8, 8.0])  # a = -2, -4, -6, -8
    assert speeds[4] == pytest.approx(7.2)
    assert speeds[-1] == pytest.approx(0.0, abs=0.05)


def test_a_standing_vehicle_does_not_slide_sideways() -> None:
    control = VehicleControl(LIMITS, 0.0)
    assert [control.step(-1.0, 1.0, WIDE).lateral_mps for _ in range(10)] == pytest.approx([0.0] * 10)


@given(actions, st.floats(0, 4), st.floats(-math.pi, math.pi))
def test_pedestrians_keep_their_limits(sequence: list[tuple[float, float]], speed_mps: float, heading: float) -> None:
    control = PedestrianControl(LIMITS, Walker(0.0, 0.0, heading, speed_mps))
    walked = [control.state] + [control.step(*a) for a in sequence]
    for before, after in pairwise(walked):
        accel = (after.speed_mps - before.speed_mps) / STEP_S
        assert 0.0 <= after.speed_mps <= LIMITS.walk_speed_mps
        assert -LIMITS.walk_brake_mps2 - EPS <= accel <= LIMITS.walk_accel_mps2 + EPS
        assert after.accel_mps2 == pytest.approx(accel)
        assert abs(after.heading_rad - before.heading_rad) <= LIMITS.heading_rate_radps * STEP_S + EPS
        distance = math.hypot(after.x_m - before.x_m, after.y_m - before.y_m)
        assert distance == pytest.approx((before.speed_mps + after.speed_mps) / 2 * STEP_S)


def test_a_pedestrian_turns_left_by_hand() -> None:
    control = PedestrianControl(LIMITS, Walker(1.0, 2.0, 0.0, 1.0))
    walker = control.step(1.0, 1.0)
    assert walker.speed_mps == pytest.approx(1.3)
    assert walker.heading_rad == pytest.approx(0.15)
    assert (walker.x_m, walker.y_m) == pytest.approx((1.0 + 0.115 * math.cos(0.15), 2.0 + 0.115 * math.sin(0.15)))


@pytest.fixture(scope="module")
def sim() -> Iterator[SumoSimulation]:
    simulation = SumoSimulation(EgoConfig())
    yield simulation
    simulation.close()


def driver(kind: str, size: int, generator: np.random.Generator) -> Iterator[Floats]:
    """Endless joint actions."""
    value = np.zeros(size)
    while True:
        if kind == "uniform":
            value = generator.uniform(-1, 1, size)
        elif kind == "correlated":  # AR(1), as a policy that keeps to a manoeuvre
            value = np.clip(0.95 * value + 0.3 * generator.standard_normal(size), -1, 1)
        else:  # bang-bang: the limits themselves, switched now and then
            value = np.where(generator.random(size) < 0.1, generator.choice((-1.0, 1.0), size), np.sign(value + EPS))
        yield value


def drive(family: Family, sim: SumoSimulation, kind: str, seed: int) -> tuple[Limits, list[Frame], bool]:
    """One episode of random actions: its limits, all frames, and whether the check called it inside the limits."""
    generator = np.random.default_rng(seed)
    scene = family.space.from_unit(generator.random(family.space.dimension))
    layout = family.layout(scene.values)
    limits = limits_from_odd(family.odd, layout.friction)
    frames = [sim.reset(layout, seed)]
    adversaries = Adversaries(family, limits, layout, frames[0])
    source, kept = driver(kind, 2 * len(family.adversaries), generator), True
    for _ in range(family.horizon_steps):
        adversaries.command(next(source).tolist(), sim)
        frames.append(sim.step())
        kept &= adversaries.keep_limits(frames[-1])
    return limits, frames, kept


def track(frames: list[Frame], id_: str, name: str) -> Floats:
    """One actor's column over the frames that have it."""
    return np.array([getattr(f, name)[f.ids.index(id_)] for f in frames if id_ in f.ids])


episodes = pytest.mark.parametrize("kind", ["uniform", "correlated", "bang-bang"])
each_family = pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)


@episodes
@each_family
def test_vehicles_drive_inside_their_limits_in_sumo(family: Family, kind: str, sim: SumoSimulation) -> None:
    for seed in range(12):
        limits, frames, kept = drive(family, sim, kind, seed)
        assert kept, seed
        for id_ in family.vehicles:
            speed, lateral = track(frames, id_, "speed_mps"), track(frames, id_, "lateral_mps")
            accel = np.concatenate(([0.0], np.diff(speed) / STEP_S))
            assert np.all((speed >= 0) & (speed <= limits.speed_mps + ROUNDING)), (seed, id_)
            assert np.all(accel <= limits.accel_mps2 + ROUNDING), (seed, id_)
            assert np.all(accel >= -limits.brake_mps2 - ROUNDING), (seed, id_)
            assert np.all(np.abs(np.diff(accel)) <= limits.jerk_mps3 * STEP_S + ROUNDING), (seed, id_)
            assert np.all(np.abs(lateral) <= limits.lateral_mps + ROUNDING), (seed, id_)
            assert np.all(np.abs(lateral) <= limits.slip * speed + ROUNDING), (seed, id_)
            change = np.abs(np.diff(lateral))
            # SUMO pauses lateral motion where it would leave a junction's inner lane: it may end at once, never start.
            paused = (np.abs(lateral[1:]) < EPS) & (family.name != "low")
            assert np.all(paused | (change <= limits.lateral_accel_mps2 * STEP_S + ROUNDING)), (seed, id_, change.max())


@episodes
def test_the_reported_motion_is_the_one_the_bodies_made(kind: str, sim: SumoSimulation) -> None:
    # On the straight road x is along and y across, so positions are an independent account.
    for seed in range(6):
        _, frames, _ = drive(FAMILIES["low"], sim, kind, seed)
        for id_ in FAMILIES["low"].vehicles:
            heading, half = track(frames, id_, "heading_rad"), track(frames, id_, "length_m") / 2
            front_x = track(frames, id_, "x_m") + half * np.cos(heading)
            front_y = track(frames, id_, "y_m") + half * np.sin(heading)
            speed = track(frames, id_, "speed_mps")
            mean = (speed[1:] + speed[:-1]) / 2  # over the step, as SUMO integrates it
            np.testing.assert_allclose(np.diff(front_x) / STEP_S, mean, atol=0.01)
            np.testing.assert_allclose(np.diff(front_y) / STEP_S, track(frames, id_, "lateral_mps")[1:], atol=0.01)


@pytest.mark.parametrize("name", ["low", "mixed"])
def test_adversaries_stay_on_the_drivable_lanes(name: str, sim: SumoSimulation) -> None:
    family = FAMILIES[name]
    low, high = {"low": (-4.95, 4.95), "mixed": (-6.6, 0.0)}[name]
    for seed in range(8):
        _, frames, _ = drive(family, sim, "bang-bang", seed)
        for id_ in family.vehicles:
            heading, half = track(frames, id_, "heading_rad"), track(frames, id_, "length_m") / 2
            front_y = track(frames, id_, "y_m") + half * np.sin(heading)
            half_width = track(frames, id_, "width_m")[0] / 2
            assert front_y.min() - half_width >= low - 0.05, (seed, id_)
            assert front_y.max() + half_width <= high + 0.05, (seed, id_)


@episodes
@pytest.mark.parametrize("name", ["mixed", "dense"])
def test_pedestrians_walk_inside_their_limits_in_the_frames(name: str, kind: str, sim: SumoSimulation) -> None:
    family = FAMILIES[name]
    for seed in range(4):
        limits, frames, _ = drive(family, sim, kind, seed)
        for id_ in family.pedestrians:
            x, y = track(frames, id_, "x_m"), track(frames, id_, "y_m")
            speed, heading = track(frames, id_, "speed_mps"), track(frames, id_, "heading_rad")
            accel = np.diff(speed) / STEP_S
            assert frames[0].kind[frames[0].ids.index(id_)] == Kind.PEDESTRIAN
            assert np.all((speed >= 0) & (speed <= limits.walk_speed_mps))
            assert np.all((accel <= limits.walk_accel_mps2 + EPS) & (accel >= -limits.walk_brake_mps2 - EPS))
            assert np.all(np.abs(np.diff(heading)) <= limits.heading_rate_radps * STEP_S + EPS)
            assert np.all(np.hypot(np.diff(x), np.diff(y)) <= limits.walk_speed_mps * STEP_S + EPS)


@settings(deadline=None, max_examples=20)
@given(sequence=st.lists(st.lists(action, min_size=6, max_size=6), min_size=5, max_size=40), seed=st.integers(0, 99))
def test_no_sequence_of_actions_breaks_the_limits_on_the_straight_road(
    sim: SumoSimulation, sequence: list[list[float]], seed: int
) -> None:
    family = FAMILIES["low"]
    layout = family.layout(family.space.from_unit(np.full(family.space.dimension, 0.5)).values)
    frame = sim.reset(layout, seed)
    adversaries = Adversaries(family, limits_from_odd(family.odd, layout.friction), layout, frame)
    for joint in sequence:
        adversaries.command(joint, sim)
        assert adversaries.keep_limits(sim.step())


def test_a_vehicle_that_does_not_obey_is_reported(sim: SumoSimulation) -> None:
    family = FAMILIES["low"]
    layout = family.layout(family.space.from_unit(np.full(family.space.dimension, 0.5)).values)
    frame = sim.reset(layout, 0, controlled=False)  # SUMO's own models keep the last word
    adversaries = Adversaries(family, limits_from_odd(family.odd, layout.friction), layout, frame)
    kept = True
    for _ in range(10):
        adversaries.command([1.0, 0.0] * 3, sim)  # 3.5 m/s², where SUMO's default car accelerates with 2.6
        kept &= adversaries.keep_limits(sim.step())
    assert not kept
