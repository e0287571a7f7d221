"""Competent drivers in the ego's place, against a hand-written R157 driver."""

import numpy as np
import pytest

from risk_sac.verdicts.competent import avoided_by
from risk_sac.verdicts.course import recorded_path
from risk_sac.verdicts.evidence import Evidence
from tests.unit.verdicts.staged import CAR_M, LANE_M, Motion, mirrored, sideways, stage, straight

BEGINS_S = 2.0
WAY = recorded_path(np.array([0.0, 2000.0]), np.zeros(2), np.zeros(2))
BOTH = {"r157": True, "fsm": True}


def cut_in(gap_m: float, across_mps: float, other_mps: float, ego: Motion, ego_mps: float) -> Evidence:
    """A vehicle comes over from the left, `gap_m` ahead of the ego."""
    start = ego_mps * BEGINS_S + CAR_M[0] + gap_m - other_mps * BEGINS_S
    beside = straight(start, LANE_M, 0.0, other_mps, start_s=0.0)
    return stage(ego, sideways(beside, BEGINS_S, -across_mps, LANE_M), from_s=0.0, until_s=12.0, contact=False)


def steady(ego_mps: float) -> Motion:
    return straight(0.0, 0.0, 0.0, ego_mps, start_s=0.0)


def regulation_avoids(gap_m: float, across_mps: float, other_mps: float, ego_mps: float) -> bool:
    """R157's driver in a cut-in at constant speeds, by simulation.

    0.375 m, 0.4 s, 0.75 s, then 12.65 m/s³ up to 0.774 g.
    """
    step_s, speed, gap, t = 0.001, ego_mps, gap_m, 0.0
    acts_s, overlaps_s = 0.375 / across_mps + 0.4, (LANE_M - CAR_M[1]) / across_mps
    while t < 12.0 and gap > -2 * CAR_M[0]:
        since = t - acts_s - 0.75
        if t > acts_s:
            speed = max(speed - min(0.4 + 12.65 * max(since, 0.0), 0.774 * 9.81) * step_s, 0.0)
        gap += (other_mps - speed) * step_s
        t += step_s
        if gap <= 0.0 and t >= overlaps_s:
            return False
    return True


@pytest.mark.parametrize("across_mps", [0.8, 1.2, 1.6])
@pytest.mark.parametrize(("ego_mps", "other_mps"), [(16.7, 5.6), (16.7, 11.1), (25.0, 15.0)])
def test_the_boundary_of_cut_ins_is_the_regulations(across_mps, ego_mps, other_mps):
    """The largest unpreventable gap agrees to 1 m; frames every 0.1 s."""
    gaps = np.arange(1.0, 60.0)

    def last_unpreventable(avoids: list[bool]) -> float:
        return float(gaps[np.flatnonzero(~np.array(avoids))].max())

    wanted = [regulation_avoids(gap, across_mps, other_mps, ego_mps) for gap in gaps]
    found = [avoided_by(cut_in(gap, across_mps, other_mps, steady(ego_mps), ego_mps), WAY)["r157"] for gap in gaps]
    assert last_unpreventable(found) == pytest.approx(last_unpreventable(wanted), abs=1.5)
    assert found[-1]


@pytest.mark.parametrize("gap_m", [3.0, 8.0, 25.0])
def test_the_mirror_image_has_the_same_verdict(gap_m):
    recorded = cut_in(gap_m, 1.2, 8.0, steady(16.7), 16.7)
    assert avoided_by(recorded, WAY) == avoided_by(mirrored(recorded), WAY)


@pytest.mark.parametrize("gap_m", [3.0, 8.0, 25.0])
def test_what_the_ego_did_makes_no_difference(gap_m):
    """The ego goes on, brakes at the cut-in, or was slower before."""
    brakes = straight(0, 0, 0, 16.7, (BEGINS_S + 0.5, -7.0), start_s=0.0)
    slower = straight(0, 0, 0, 16.7, (0.2, -4.0), (0.7, 0.0), start_s=0.0)
    behind_m = 16.7 * BEGINS_S - slower(BEGINS_S)[0]
    recorded = [(steady(16.7), gap_m), (brakes, gap_m), (slower, gap_m - behind_m)]
    verdicts = [avoided_by(cut_in(gap, 1.2, 8.0, ego, 16.7), WAY) for ego, gap in recorded]
    assert verdicts[1:] == verdicts[:1] * 2


def test_without_a_contact_there_is_nothing_to_avoid():
    keeps_its_lane = stage(steady(15.0), straight(20, LANE_M, 0, 5.0, start_s=0.0), from_s=0.0, contact=False)
    strikes_from_behind = stage(steady(15.0), straight(-30, 0, 0, 20.0, start_s=0.0), from_s=0.0, contact=False)
    assert avoided_by(keeps_its_lane, WAY) == BOTH
    assert avoided_by(strikes_from_behind, WAY) == BOTH


def test_a_vehicle_in_plain_view_far_ahead_is_no_danger_and_one_that_comes_into_sight_late_is():
    def stands(at_m: float, seen_from_s: float = 0.0) -> Evidence:
        return stage(
            steady(16.7), straight(at_m, 0, 0, 0.0, start_s=0.0), from_s=0.0, seen_from_s=seen_from_s, contact=False
        )

    assert avoided_by(stands(100.0), WAY)["r157"]
    assert not avoided_by(stands(100.0, seen_from_s=4.5), WAY)["r157"]  # 20 m before it


def test_a_leader_that_brakes_hard_is_avoided_from_a_proper_distance_alone():
    """Avoided at the regulation's 2 s of headway, not at 0.4 s."""

    def braking(gap_m: float) -> Evidence:
        leader = straight(CAR_M[0] + gap_m, 0, 0, 16.7, (2.0, -9.0), start_s=0.0)
        return stage(steady(16.7), leader, from_s=0.0, contact=False)

    assert avoided_by(braking(33.0), WAY)["r157"]
    assert not avoided_by(braking(6.0), WAY)["r157"]


@pytest.mark.parametrize("gap_m", [5.0, 10.0, 15.0, 20.0])
def test_a_record_that_ends_with_a_contact_has_the_same_verdict(gap_m):
    """The vehicle is not yet in the ego's lane then."""
    whole = cut_in(gap_m, 1.2, 5.6, steady(16.7), 16.7)
    until = next((t for t in range(len(whole.time_s)) if whole.y_m[t, 1] < 1.8), 0)
    assert avoided_by(whole.until(until), WAY) == avoided_by(whole, WAY)
