"""Verdicts on egos that change lanes or leave the road, also mirrored."""

import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.records import ConflictType, Grade
from risk_sac.verdicts.evidence import Evidence, keeps_lane, lane_path
from risk_sac.world.types import Kind
from tests.unit.verdicts.staged import (
    CAR_M,
    LANE_M,
    STREET,
    WALKING,
    crossing_car,
    cut_in,
    judged,
    leader_brakes,
    merge,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
)


def shifted(evidence: Evidence, lanes: int) -> Evidence:
    """Shifts an encounter some lanes left on a road wide enough."""
    by_m = lanes * LANE_M
    ground = evidence.ground
    wide = replace(ground, roadway=tuple(area.grown(by_m) for area in ground.roadway))
    return replace(evidence, y_m=evidence.y_m + by_m, ground=wide)


@pytest.mark.parametrize("lanes", [-1, 1, 2])
@pytest.mark.parametrize(
    "evidence", [cut_in(), cut_in(gap=-3.0, ego=12.0, other=12.0), leader_brakes(), merge(), crossing_car()]
)
def test_the_same_encounter_in_another_lane_has_the_same_verdict(evidence, lanes):
    first, second = judged(evidence), judged(shifted(evidence, lanes))
    assert second.conflict_y_m == pytest.approx(first.conflict_y_m + lanes * LANE_M)
    assert second.model_copy(update={"conflict_y_m": first.conflict_y_m}) == first


def comes_from_next_lane(encounter: Evidence, side: int) -> Evidence:
    """The encounter, before which the ego changed lanes; nothing else is moved."""
    over_s = encounter.time_s[-1] - 6.0
    left_m = LANE_M * np.clip((over_s - encounter.time_s) / 2.0, 0.0, 1.0)
    y, lateral = encounter.y_m.copy(), encounter.lateral_mps.copy()
    y[:, 0] += side * left_m
    lateral[:, 0] += np.diff(y[:, 0], prepend=y[:1, 0]) / encounter.step_s
    return replace(encounter, y_m=y, lateral_mps=lateral)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("evidence", [cut_in(at_s=9.0), leader_brakes(at_s=9.0), pedestrian_crosses(speed=9.0)])
def test_a_lane_change_that_is_over_changes_nothing(evidence, side):
    found = comes_from_next_lane(evidence, side)
    assert abs(found.y_m[0, 0]) == pytest.approx(LANE_M)
    assert judged(found) == judged(evidence)


def test_an_ego_that_comes_over_to_its_neighbour_merges_into_it():
    # 0.375 m off its lane's centre 0.31 s after it began, at 2 s.
    found = judged(merge())
    assert found.kind == "neighbour; ego changes lanes"
    assert (found.conflict_type, found.grade) == (ConflictType.MERGE, Grade.PREVENTABLE)
    assert found.conflict_s == found.noticed_s == pytest.approx(2.4, abs=0.06)
    assert "r157_ttc" not in found.drivers


@pytest.mark.parametrize("rate", [0.4, 1.2, 2.0])
def test_a_merge_right_after_the_release_is_the_egos_own(rate):
    assert judged(merge(rate=rate, at_s=1.0)).conflict_s >= 1.0


@pytest.mark.parametrize(
    ("ego_mps", "other_mps", "expected"),
    [(0.0, 1.2, ConflictType.CUT_IN), (0.3, 1.2, ConflictType.CUT_IN), (1.2, 0.0, ConflictType.MERGE)],
)
def test_who_comes_over_names_the_conflict(ego_mps, other_mps, expected):
    ego = sideways(straight(0.0, 0.0, 0.0, 12.0), 2.0, max(ego_mps, 1e-9), LANE_M)
    other = sideways(straight(-2.0, LANE_M, 0.0, 12.0), 2.0, -max(other_mps, 1e-9), LANE_M)
    assert judged(stage(ego, other)).conflict_type is expected


@pytest.mark.parametrize("side", [1, -1])
def test_an_ego_that_swerves_away_from_a_passing_vehicle_did_not_come_over(side):
    # Its rear corner has just left the ego's front; in its place the ego would have been touched 0.5 s before.
    ego = sideways(straight(0.0, 0.0, 0.0, 12.0), 1.0, -side * 0.8, 0.5)
    passing = sideways(straight(-3.95, side * LANE_M, 0.0, 14.0), 1.0, -side * 1.08, LANE_M)
    assert judged(stage(ego, passing, contact=False, until_s=2.8)).conflict_type is ConflictType.CUT_IN


@pytest.mark.parametrize(("other_m", "expected"), [(1.2, ConflictType.CUT_IN), (0.0, ConflictType.MERGE)])
def test_an_ego_that_drifts_comes_over_if_its_neighbour_came_less_far(other_m, expected):
    # The neighbour passes 0.4 m beside the ego's place, into which the ego moves at last.
    ego = sideways(straight(0.0, 0.0, 0.0, 12.0), 2.5, 0.8, 0.6)
    passing = sideways(straight(-12.0, 2.25 + other_m, 0.0, 15.0), 1.0, -0.8, other_m)
    assert judged(stage(ego, passing)).conflict_type is expected


def test_a_reference_driver_keeps_its_lane_and_looks_out_for_who_is_there():
    # The leader brakes hard and the ego swerves into its neighbour: in the lane, a careful driver brakes too late.
    ego = sideways(straight(0.0, 0.0, 0.0, 14.0), 2.0, 2.0, LANE_M)
    neighbour = straight(-2.0, LANE_M, 0.0, 14.0)
    leader = straight(CAR_M[0] + 9.0, 0.0, 0.0, 14.0, (1.5, -9.0))
    kinds = (Kind.VEHICLE,) * 3
    alone = judged(stage(ego, neighbour))
    behind_leader = stage(ego, neighbour, leader, kinds=kinds)
    assert behind_leader.time_s[-1] == pytest.approx(2.8)
    assert alone.grade is Grade.PREVENTABLE
    assert judged(behind_leader).grade is Grade.FULL_BRAKING


def bend(t: float, radius_m: float = 60.0, speed: float = 10.0) -> tuple[float, float, float]:
    """Place and heading of a lane's middle that turns left."""
    angle = speed * max(t, 0.0) / radius_m
    return radius_m * math.sin(angle) + speed * min(t, 0.0), radius_m * (1 - math.cos(angle)), angle


@pytest.mark.parametrize(
    ("recorded", "next_lane"), [(True, False), (True, True), (False, False)], ids=["ditch", "next lane", "no offsets"]
)
def test_the_lane_that_an_ego_leaves_goes_on_round_the_bend(recorded, next_lane):
    def leaves(t):
        x, y, heading = bend(t)
        right_m = max(t - 2.0, 0.0)
        return x + right_m * math.sin(heading), y - right_m * math.cos(heading), heading - 0.1 * (t > 2.0)

    x, y, heading = bend(6.0)
    post = straight(x + 3.5 * math.sin(heading), y - 3.5 * math.cos(heading), heading, 0.0)
    ground = replace(STREET, roadway=())
    evidence = stage(leaves, post, kinds=WALKING, ground=ground)
    leaving = evidence.time_s > 2.0 + 1e-9
    lateral, offset = evidence.lateral_mps.copy(), evidence.lane_offset_m.copy()
    lateral[:, 0] = np.where(leaving, -1.0, 0.0)
    offset[:, 0] = leaving * (2.0 - evidence.time_s - CAR_M[0] / 2 * math.sin(0.1))  # of its front
    offset[offset < -LANE_M / 2] += LANE_M * next_lane
    evidence = replace(
        evidence, lateral_mps=lateral, lane_offset_m=offset if recorded else np.full_like(offset, np.nan)
    )
    began = int(np.searchsorted(evidence.time_s, 2.0))
    path = lane_path(evidence, began)
    wanted = np.array([bend(t) for t in evidence.time_s]).T
    assert np.hypot(path.x - wanted[0], path.y - wanted[1]).max() < 0.05
    assert np.abs(path.heading - wanted[2])[began + 1 :].max() < 0.02
    assert not keeps_lane(evidence, began)
    assert keeps_lane(evidence, len(evidence.time_s) - 2)


def leaves_the_road(walker_y: float = -9.0) -> Evidence:
    """The ego leaves the road to the right, where a pedestrian stands."""
    ego = sideways(straight(0.0, 0.0, 0.0, 10.0), 2.0, -3.0, 9.0)
    return stage(ego, straight(60.0, walker_y, math.pi / 2, 0.0), kinds=WALKING)


def test_a_pedestrian_beside_the_road_is_struck_by_an_ego_that_left_it():
    found = judged(leaves_the_road())
    assert found.conflict_s == pytest.approx(2.2, abs=0.11)
    assert (found.hidden, found.grade) == (False, Grade.PREVENTABLE)


@pytest.mark.parametrize("speed", [8.0, 12.0])
def test_an_ego_that_drifts_into_oncoming_traffic_is_avoided_by_keeping_the_lane(speed):
    ego = sideways(straight(0.0, 0.0, 0.0, speed), 3.0, 1.5, LANE_M)
    found = judged(stage(ego, straight(120.0, LANE_M, math.pi, 10.0)))
    assert found.conflict_s >= 3.0
    assert (found.conflict_type, found.grade) == (ConflictType.CROSSING, Grade.PREVENTABLE)
