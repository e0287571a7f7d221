"""Beginning of each conflict type against times by hand, and mirrored."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.records import ConflictType
from risk_sac.verdicts.conflict import find_conflict, unresponsive
from risk_sac.verdicts.course import polyline, pose_at, project, towards
from tests.unit.verdicts.staged import (
    LANE_M,
    WALKING,
    crossing_car,
    cut_in,
    hangs_over,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
)


@pytest.fixture(params=[False, True], ids=["as it is", "mirrored"])
def found(request):
    return lambda evidence: find_conflict(mirrored(evidence) if request.param else evidence, 1)


def test_a_leader_counts_from_braking_harder_than_5(found):
    hard, soft = leader_brakes(gap=25.0, braking=5.5), leader_brakes(gap=25.0, braking=4.5)
    assert found(hard).type is ConflictType.LEADER
    assert found(hard).time_s == pytest.approx(2.15, abs=0.06)
    # 4.5: the gap is 25 − 2.25 t², the closing speed 4.5 t; below 2 s from t² + 4 t = 11.11 on, t = 1.89.
    assert found(soft).time_s == pytest.approx(2.0 + 1.89, abs=0.16)


def test_a_cut_in_begins_0_375_m_off_its_lane_below_two_seconds(found):
    conflict = found(cut_in(gap=8.0))  # 5 m/s closing: 1.6 s from the start; 0.375 m take 0.3125 s of 1.2 m/s
    assert conflict.type is ConflictType.CUT_IN
    assert conflict.time_s == pytest.approx(2.3125, abs=0.1)
    assert conflict.position == "ahead"


def test_who_drifts_over_alongside_is_in_conflict_whatever_its_speed(found):
    conflict = found(cut_in(gap=-3.0, ego=12.0, other=12.0))
    assert (conflict.type, conflict.position) == (ConflictType.CUT_IN, "alongside")
    assert conflict.time_s == pytest.approx(2.3125, abs=0.1)


def test_a_vehicle_that_keeps_its_lane_does_not_cut_in_on_an_ego_that_swerves_out_behind_it(found):
    """The ego is 1.7 m aside and touches the rear corner."""
    swerves = sideways(straight(0.0, 0.0, 0.0, 12.0), 0.5, 0.8, 1.7)
    conflict = found(stage(swerves, straight(60.0, 0.0, 0.0, 5.0)))
    assert (conflict.type, conflict.came_over) == (ConflictType.LEADER, False)


def test_who_hangs_over_alongside_is_noticed_and_in_conflict_once_it_comes(found):
    conflict = found(hangs_over(at_s=1.0, comes_at_s=3.0))
    assert (conflict.type, conflict.position) == (ConflictType.CUT_IN, "alongside")
    assert conflict.noticed_s == pytest.approx(1.3125, abs=0.1)
    assert conflict.time_s == pytest.approx(3.0, abs=0.11)


def test_without_recorded_offsets_the_place_across_the_path_decides(found):
    evidence = cut_in(gap=8.0)
    unknown = replace(evidence, lane_offset_m=np.full_like(evidence.lane_offset_m, np.nan))
    assert found(unknown) == found(evidence)


@pytest.mark.parametrize(("speed", "before_s"), [(8.5, 1.15 + 8.5 / 3.4), (14.0, 4.0)])
def test_a_pedestrian_counts_within_the_time_to_stop(found, speed, before_s):
    evidence = pedestrian_crosses(speed=speed, walk=1.4)
    conflict = found(evidence)
    assert conflict.type is ConflictType.PEDESTRIAN
    assert evidence.time_s[-1] - conflict.time_s == pytest.approx(before_s, abs=0.2)


@pytest.mark.parametrize("side", [1, -1])
def test_a_pedestrian_that_would_just_clear_the_way_counts_before_it_stops_in_it(found, side):
    # It walks at 2 m/s, would be out of the corridor just before the ego comes, and brakes from 2.2 s on.
    walker = straight(40.0, side * 4.6, -side * math.pi / 2, 2.0, (2.2, -2.8), start_s=0.0)
    evidence = stage(straight(0.0, 0.0, 0.0, 12.0, start_s=0.0), walker, kinds=WALKING, from_s=0.0)
    assert evidence.time_s[-1] - found(evidence).time_s > 2.5


@pytest.mark.parametrize(("off_m", "rate", "before_s"), [(0.6, 0.0, 0.8), (0.9, 0.0, 2.9)], ids=["in its lane", "over"])
def test_a_neighbour_is_in_conflict_once_it_is_over_the_line_and_not_while_it_keeps_its_lane(
    found, off_m, rate, before_s
):
    """It is level and as fast; the marking is 0.725 m off."""
    beside = sideways(straight(0.0, LANE_M, 0.0, 12.0), 0.5, -2.0, off_m)
    evidence = stage(straight(0.0, 0.0, 0.0, 12.0), sideways(beside, 3.0, -1.0, LANE_M - off_m))
    assert evidence.time_s[-1] - found(evidence).time_s == pytest.approx(before_s, abs=1.0)


@pytest.mark.parametrize("seen_from_s", [5.0, 6.0, 7.5])
def test_a_hidden_pedestrians_conflict_begins_with_its_sight(found, seen_from_s):
    conflict = found(pedestrian_crosses(seen_from_s=seen_from_s))
    assert conflict.time_s == pytest.approx(seen_from_s)
    assert conflict.hidden


@pytest.mark.parametrize("side", [1, -1])
def test_a_crossing_vehicle_counts_within_four_seconds(found, side):
    evidence = crossing_car(side=side)
    conflict = found(evidence)
    assert conflict.type is ConflictType.CROSSING
    assert evidence.time_s[-1] - conflict.time_s == pytest.approx(4.0, abs=0.15)


def test_an_ego_that_drifts_into_its_neighbour_is_in_conflict_on_a_collision_course(found):
    ego = sideways(straight(0.0, 0.0, 0.0, 12.0), 1.0, 1.0, LANE_M)
    evidence = stage(ego, straight(0.0, LANE_M, 0.0, 12.0))
    conflict = found(evidence)
    assert conflict.position == "alongside"
    assert conflict.time_s < evidence.time_s[-1]


@pytest.mark.parametrize(
    ("evidence", "smells"),
    [
        pytest.param(pedestrian_crosses(), True, id="drives on for 4 s"),
        pytest.param(pedestrian_crosses(seen_from_s=7.0), False, id="saw it for 1.1 s only"),
        pytest.param(
            stage(straight(0.0, 0.0, 0.0, 12.0, (3.0, -3.0)), straight(70.0, 0.0, 0.0, 0.0)), False, id="brakes at last"
        ),
        pytest.param(
            stage(straight(0.0, 0.0, 0.0, 12.0, (3.0, -1.3)), straight(70.0, 0.0, 0.0, 0.0)), True, id="only dawdles"
        ),
        pytest.param(stage(straight(0.0, 0.0, 0.0, 12.0), straight(70.0, 0.0, 0.0, 0.0)), True, id="into a parked car"),
    ],
)
def test_an_ego_that_never_brakes_for_what_it_sees_is_unresponsive(evidence, smells):
    assert unresponsive(evidence, find_conflict(evidence, 1)) is smells


@pytest.mark.parametrize("side", [1, -1])
def test_a_crossing_vehicle_that_brakes_is_trusted_until_the_two_would_meet(found, side):
    # From 12 m/s it brakes with 4 m/s² from 2 s to 3.8 s, and goes on with 4.8 m/s into the ego, 44.9 m from its start.
    # At 2 s it could stop within 12²/12 = 12 m by braking firmly, within 21 m gently; the corridor is 17 m away.
    # From 3 s and 8 m/s on the two would meet if both kept their speeds: it is 10.9 m from the ego's axis, 1.4 s.
    crossing = straight(60.0, side * 44.9, -side * math.pi / 2, 12.0, (2.0, -4.0), (3.8, 0.0), start_s=0.0)
    conflict = found(stage(straight(0.0, 0.0, 0.0, 12.0, start_s=0.0), crossing, from_s=0.0))
    assert conflict.type is ConflictType.CROSSING
    assert conflict.noticed_s == pytest.approx(1.7, abs=0.25)
    assert conflict.time_s == pytest.approx(3.0, abs=0.15)


@given(st.floats(-9.0, 9.0))
def test_a_wrapped_offset_says_what_the_place_says(across):
    offset = (across + LANE_M / 2) % LANE_M - LANE_M / 2
    assert towards(across, offset, LANE_M) == pytest.approx(towards(across, math.nan, LANE_M))


@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=8, unique=True), st.floats(0, 1)
)
def test_a_point_of_the_path_projects_onto_itself(points, share):
    x, y = np.array(points).T
    path = polyline(x, y)
    here = pose_at(path, share * path.s[-1])
    s, left, _ = project(path, 0, here[0], here[1])
    assert left == pytest.approx(0.0, abs=1e-6)
    assert pose_at(path, s)[:2] == pytest.approx(here[:2], abs=1e-5)
