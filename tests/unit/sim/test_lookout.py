"""Actors that a driver stops for or follows, on a straight road."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely import LineString, Point

from risk_sac.sim.lookout import MARGIN_M, project, targets
from risk_sac.sim.paths import Path, path_along, path_through
from risk_sac.world.types import Kind
from tests.roads import road
from tests.unit.sim.contacts import CAR, WALKER, WIDTH_M, Actor, frames

FRONT_M, SPEED_MPS, ACCEL_MPS2 = 20.0, 10.0, 2.6
CORRIDOR_M = WIDTH_M / 2 + MARGIN_M  # 1.3
EGO: Actor = (FRONT_M - 2.3, 0.0, 0.0, SPEED_MPS, 0.0, CAR)
sides = pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])


class Target(NamedTuple):
    gap_m: float
    lead_mps: float


def target(other: Actor, path: Path | None = None, speed_mps: float = SPEED_MPS, offset_m: float = 0.0) -> Target:
    """What the other is to a driver 20 m down the path."""
    known = np.ones(2, dtype=np.bool_)
    _, frame = frames((*EGO[:3], speed_mps, *EGO[4:]), other, share=1.0)
    points, vehicle = (road() if path is None else path), frame.kind == Kind.VEHICLE
    found = targets(points, FRONT_M, offset_m, 0, ACCEL_MPS2, frame.state, vehicle, known).tolist()
    assert [actor for actor, _, _ in found] in ([], [1])
    return Target(*found[0][1:]) if found else CLEAR


def walker(x: float, y: float, vy: float = 0.0) -> Actor:
    return (x, y, math.pi / 2, 0.0, vy, WALKER)


CLEAR = Target(math.inf, 0.0)


@sides
@pytest.mark.parametrize(
    ("x", "aside_m", "expected"),
    [
        (50.0, 0.0, Target(29.75, 0.0)),
        (50.0, CORRIDOR_M + 0.24, Target(29.75, 0.0)),
        (50.0, CORRIDOR_M + 0.26, CLEAR),
        (72.0, 0.0, Target(51.75, 0.0)),
        (73.5, 0.0, CLEAR),  # speeding up to the limit of 13.89 m/s, it comes 52.6 m far in 4 s
        (20.25, 0.0, Target(0.0, 0.0)),  # at its bumper
        (19.0, CORRIDOR_M, CLEAR),  # beside it already
    ],
)
def test_who_stands_in_the_corridor_is_stopped_for(x, aside_m, expected, side):
    assert target(walker(x, side * aside_m)) == pytest.approx(expected)


# At 10 m/s and 2.6 m/s² at the most, some part of the ego is at x = 50 from 2.3 to 3.4 s on.
@sides
@pytest.mark.parametrize(
    ("enters_s", "expected"),
    [(0.0, CLEAR), (0.3, Target(29.75, 0.0)), (2.5, Target(29.75, 0.0)), (3.3, Target(29.75, 0.0)), (3.6, CLEAR)],
)
def test_who_walks_into_the_corridor_is_stopped_for_if_both_are_there_together(enters_s, expected, side):
    aside_m = CORRIDOR_M + 0.25 + 1.4 * enters_s - 1e-6
    assert target(walker(50.0, side * aside_m, -side * 1.4)) == pytest.approx(expected)


@sides
def test_a_driver_that_has_stopped_waits_until_the_pedestrian_has_left_its_corridor(side):
    # From the middle it takes 1.1 s, in which the car would be 1.6 m further.
    assert target(walker(21.5, 0.0, side * 1.4), speed_mps=0.0) == pytest.approx(Target(1.25, 0.0))
    assert target(walker(22.0, 0.0, side * 1.4), speed_mps=0.0) == CLEAR
    assert target(walker(21.5, side * 1.3, side * 1.4), speed_mps=0.0) == CLEAR


@sides
@pytest.mark.parametrize("step_m", [0.0, 0.01, -0.01, 0.35, -0.35])
def test_who_walks_in_where_one_lane_leads_to_another_is_seen_from_either_side(step_m, side):
    """The second lane begins beside the first: locally a path across it."""
    before, behind = [(0.0, 0.0), (50.0, 0.0)], [(50.0, step_m), (300.0, step_m)]
    path = path_along([np.array(before), np.array(behind)], [13.9, 13.9])
    for x in np.arange(48.0, 52.0, 0.25):
        for enters_s in (0.3, 1.0, 2.0):
            aside_m = CORRIDOR_M + 0.25 + 1.4 * enters_s
            found = target(walker(x, side * aside_m + step_m, -side * 1.4), path)
            assert found == pytest.approx(Target(x - FRONT_M - 0.25, 0.0), abs=0.2), (x, enters_s)


@sides
def test_who_walks_in_between_the_way_there_and_the_way_back_is_seen(side):
    """Round a roundabout and back: all actors are nearer the way back."""
    angles = np.linspace(-0.5, 0.5, 21)[1:-1] * 1.9 * math.pi
    there, back = [(0.0, 0.0), (60.0, 0.0)], [(60.0, side * 3.5), (0.0, side * 3.5)]
    ring = [(75.0 + 14.0 * -math.cos(a), side * (1.75 + 14.0 * math.sin(a))) for a in angles]
    path = path_along([np.array(line) for line in (there, ring, back)], [13.9, 8.3, 13.9])
    aside_m = CORRIDOR_M + 0.25 + 1.4
    assert target(walker(50.0, side * aside_m, -side * 1.4), path) == pytest.approx(Target(29.75, 0.0))


@sides
def test_the_corridor_is_where_the_vehicle_is_in_its_lane(side):
    beside = walker(50.0, side * 2.0)
    assert target(beside) == CLEAR
    assert target(beside, offset_m=side * 0.5) == pytest.approx(Target(29.75, 0.0))


@sides
@pytest.mark.parametrize(
    ("sideways_mps", "expected"), [(0.0, CLEAR), (0.5, CLEAR), (1.2, Target(5.0, 8.0))], ids=["keeps", "drifts", "in"]
)
def test_who_cuts_in_within_two_seconds_is_followed(sideways_mps, expected, side):
    # In the corridor after 0.9 s at 1.2 m/s, and not in 2 s at 0.5 m/s.
    assert target((27.3, side * 3.3, 0.0, 8.0, -side * sideways_mps, CAR)) == pytest.approx(expected)


@sides
@pytest.mark.parametrize(
    ("enters_s", "expected"), [(1.0, Target(19.075, 0.0)), (1.1, Target(19.075, 0.0)), (1.3, CLEAR)]
)
def test_crossing_traffic_is_stopped_for_once_it_would_have_to_brake_hard(enters_s, expected, side):
    # From 6 m/s it stops by 2.5 m/s² in 7.2 m, which it covers in 1.2 s.
    y = side * (CORRIDOR_M + 2.3 + 6.0 * enters_s - 1e-6)
    assert target((40.0, y, -side * math.pi / 2, 0.0, -side * 6.0, CAR)) == pytest.approx(expected)


@settings(max_examples=100)
@given(
    st.floats(10, 90),
    st.floats(-10, 10),
    st.floats(-math.pi, math.pi),
    st.floats(0, 10),
    st.sampled_from((CAR, WALKER)),
    st.sampled_from((None, 8.0, 20.0)),
    st.floats(0, 13),
)
def test_the_mirrored_scene_has_the_mirrored_targets(x, y, heading, pace, kind, radius, speed):
    vx, vy = pace * math.cos(heading), pace * math.sin(heading)
    left = target((x, y, heading, vx, vy, kind), road(radius), speed)
    right = target((x, -y, -heading, vx, -vy, kind), road(radius, left=False), speed)
    assert left == pytest.approx(right)


@settings(max_examples=100)
@given(st.floats(5, 150), st.floats(-60, 60), st.sampled_from((8.0, 20.0, 40.0)), st.booleans())
def test_the_nearest_place_is_the_one_that_shapely_finds(x, y, radius, left):
    path = road(radius, left=left)
    line = LineString(path[:2].T)
    assume(0.0 < line.project(Point(x, y)) < line.length)  # its ends do not go on
    station, offset, _ = project(path, x, y)
    if 0.0 <= station <= line.length:
        nearest_m = line.distance(Point(x, y))
        assert Point(x, y).distance(line.interpolate(station)) == pytest.approx(nearest_m, abs=1e-6)
    assert abs(offset) <= line.distance(Point(x, y)) + 1e-6


def test_whom_it_passes_at_its_speed_it_may_meet_at_that_of_a_bend():
    x = np.arange(0.0, 200.0, 10.0)
    straight, slow = (
        path_through(x, np.zeros_like(x), x, np.zeros_like(x), limit)
        for limit in (np.full_like(x, 13.89), np.where(x < 30.0, 13.89, 4.0))
    )
    late = walker(40.0, -6.0, 1.4)  # in the corridor after 3.2 s: at 13 m/s the ego is past, at 4 m/s it is there
    assert target(late, straight, speed_mps=13.0) == CLEAR
    assert target(late, slow, speed_mps=13.0).gap_m == pytest.approx(19.75)
