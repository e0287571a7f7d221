"""Defensive driver by its four rules: momentarily, and in the ego's place."""

import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.scenario.bodies import CODES
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.course import Path, polyline
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.online import DefensiveReflex
from risk_sac.verdicts.reference import reference_outcomes
from risk_sac.world.types import STEP_S, Frame, Kind
from tests.builders import frame_of
from tests.unit.verdicts.staged import (
    CAR_M,
    LANE_M,
    STREET,
    cut_in,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
    waiting,
)

Actor = tuple[float, float, float, float, Kind]  # x, y, heading, speed, kind
CAR, WALKER = Kind.VEHICLE, Kind.PEDESTRIAN
SIDES = pytest.mark.parametrize("side", [1, -1])
NO_FASTER = 1e-3  # m/s²: braking that only keeps the ego from speeding up is less


def braking(*others: Actor, ego: float = 12.0, side: int = 1, after_s: float = 0.0, **changes: object) -> float:
    """Braking before the crossing at 98 m, `after_s` it saw the others."""
    x, y, heading, speed, kinds = zip((60.0, 0.0, 0.0, ego, CAR), *others, strict=True)
    frame = frame_of(
        kinds, x_m=x, y_m=side * np.array(y), heading_rad=side * np.array(heading), speed_mps=speed, **changes
    )
    reflex, path = DefensiveReflex(STREET), polyline(np.array([60.0, 200.0]), np.zeros(2))
    return _after(reflex, frame, path, after_s)


def _after(reflex: DefensiveReflex, frame: Frame, path: Path, after_s: float) -> float:
    for step in range(round(after_s / STEP_S) + 1):
        found = reflex.braking(frame._replace(time_s=step * STEP_S), path, np.ones(len(frame.ids), dtype=np.bool_))
    return found


@SIDES
def test_it_can_stop_before_what_it_does_not_see_of_a_crossing(side):
    beside = (92.0, -LANE_M, 0.0, 0.0, CAR)  # its front 3.7 m before the crossing
    assert braking(ego=14.0, side=side) == 0.0
    assert braking(beside, ego=14.0, side=side) == pytest.approx(3.4)  # 35.7 m: 14 m/s take 39.3 m
    assert braking(beside, ego=8.0, side=side) == 0.0  # 15.4 m
    assert braking((120.0, -LANE_M, 0.0, 0.0, CAR), ego=14.0, side=side) == 0.0  # beyond it


@SIDES
@pytest.mark.parametrize(("name", "restrains"), [("car", True), ("motorcycle", False), ("obstacle", False)])
def test_what_a_body_hides_restrains_it_only_if_the_body_s_row_says_that_it_conceals(name, restrains, side):
    frame = frame_of(x_m=[60.0, 92.0], y_m=[0.0, -side * LANE_M], speed_mps=[14.0, 0.0])
    frame = frame._replace(body=np.array([CODES["car"], CODES[name]], dtype=np.int8))
    path = polyline(np.array([60.0, 200.0]), np.zeros(2))
    assert (_after(DefensiveReflex(STREET), frame, path, 0.0) > 0.0) is restrains


def test_it_creeps_past_what_stays_hidden():
    frame = frame_of((CAR, CAR), x_m=[95.0, 95.0], y_m=[0.0, -LANE_M], heading_rad=[0.0, 0.0], speed_mps=[1.0, 0.0])
    path = polyline(np.array([95.0, 200.0]), np.zeros(2))
    assert _after(DefensiveReflex(STREET), frame, path, 20.0) == 0.0


def test_a_signal_that_gives_it_priority_counts_as_an_empty_crossing():
    beside = (90.0, -LANE_M, 0.0, 6.0, CAR)
    assert braking(beside, ego=14.0) == pytest.approx(3.4)
    assert braking(beside, ego=14.0, link=np.array([ord("G"), 0], dtype=np.uint8)) == 0.0


@SIDES
def test_it_sees_the_whole_crossing_before_it_passes_a_vehicle_that_stops_there(side):
    # Two lanes away it hides places too far away to matter before the ego has passed.
    drives, brakes = ((84.0, -2 * LANE_M + 0.8, 0.0, 9.0, CAR) for _ in range(2))
    assert braking(drives, ego=14.0, side=side) == 0.0
    assert braking(brakes, ego=14.0, side=side, accel_mps2=[0.0, -4.0]) == pytest.approx(3.4)


@SIDES
@pytest.mark.parametrize(
    ("pedestrian", "restrained"),
    [
        pytest.param((72.0, -2.5, 0.0, 0.0, WALKER), True, id="stands 0.95 m beside the corridor"),
        pytest.param((72.0, -3.3, 0.0, 0.0, WALKER), False, id="stands 1.75 m beside it"),
        pytest.param((72.0, -5.0, math.pi / 2, 1.4, WALKER), True, id="would be there in 2.5 s"),
        pytest.param((72.0, -6.5, math.pi / 2, 1.4, WALKER), False, id="would be there in 3.5 s"),
        pytest.param((55.0, -2.0, 0.0, 0.0, WALKER), False, id="stands behind it"),
    ],
)
def test_it_does_not_start_beside_a_pedestrian(pedestrian, restrained, side):
    assert (braking(pedestrian, ego=0.0, side=side) > 0.0) is restrained


def test_it_does_not_speed_up_beside_a_pedestrian_and_then_slows_down():
    beside = (80.0, -2.5, 0.0, 0.0, WALKER)
    assert 0.0 < braking(beside) < NO_FASTER
    assert braking(beside, after_s=0.8) == pytest.approx(3.4)


def test_it_does_not_wait_for_ever_for_a_pedestrian_on_the_sidewalk():
    # The ego stands on the rightmost lane, 0.75 m from the kerb.
    frame = frame_of((CAR, WALKER), x_m=[60.0, 72.0], y_m=[-4.95, -7.0], heading_rad=[0.0, 0.0], speed_mps=[0.0, 0.0])
    path = polyline(np.array([60.0, 200.0]), np.full(2, -4.95))
    assert _after(DefensiveReflex(STREET), frame, path, 3.0) > 0.0
    assert _after(DefensiveReflex(STREET), frame, path, 4.5) == 0.0
    on_red = frame._replace(link=np.array([0, ord("r")], dtype=np.uint8))
    assert _after(DefensiveReflex(STREET), on_red, path, 0.0) == 0.0


@SIDES
def test_it_does_not_start_before_a_vehicle_from_across(side):
    across = (70.0, -12.0, math.pi / 2, 4.0, CAR)
    assert braking(across, ego=0.0, side=side) > 0.0
    assert braking((70.0, -24.0, math.pi / 2, 4.0, CAR), ego=0.0, side=side) == 0.0
    assert braking((70.0, LANE_M, math.pi, 12.0, CAR), ego=0.0, side=side) == 0.0  # oncoming on its lane


def test_it_brakes_gently_where_that_suffices_and_else_as_r157():
    far, near = (60.0 + 2.3 + 40.0 + 0.25, 0.0, 0.0, 0.0, WALKER), (60.0 + 2.3 + 14.0 + 0.25, 0.0, 0.0, 0.0, WALKER)
    assert braking(far, ego=10.0, after_s=1.5) == pytest.approx(3.4)
    assert braking(near, ego=12.0, after_s=2.0) == pytest.approx(7.59, abs=0.01)


# In the ego's place.


def prevents(evidence: Evidence, name: str = "defensive") -> bool:
    return reference_outcomes(evidence, 1, find_conflict(evidence, 1))[name].avoids


def from_behind_a_standing_car(walks: float = 1.6, crossing: bool = True) -> Evidence:
    """A pedestrian comes from behind a car standing before the crossing."""
    reach_s = (100.0 - 2.3) / 14.0
    ego = straight(-1.5 * 14.0, 0.0, 0.0, 14.0)
    walker = straight(100.0, -walks * reach_s, math.pi / 2, walks, start_s=0.0)
    parked = straight(95.0, -LANE_M, 0.0, 0.0)
    ground = STREET if crossing else replace(STREET, crossings=())
    kinds = (CAR, WALKER, CAR)
    return stage(ego, walker, parked, kinds=kinds, seen_from_s=reach_s - 1.0, ground=ground)


def speeds_up_past_a_pedestrian(side: int = 1) -> Evidence:
    """A pedestrian beside the corridor steps on 0.9 s before the ego."""
    ego = straight(-1.5 * 7.0, 0.0, 0.0, 7.0, (0.0, 1.5))
    walker = waiting(40.0, -side * 2.15, side * math.pi / 2, 2.0, until_s=3.0)
    return stage(ego, walker, kinds=(CAR, WALKER))


def test_it_alone_prevents_who_comes_from_behind_a_standing_car():
    for evidence in (from_behind_a_standing_car(), mirrored(from_behind_a_standing_car())):
        assert prevents(evidence)
        assert not any(prevents(evidence, name) for name in ("r157", "fsm", "rss"))


def test_it_does_not_prevent_who_comes_from_behind_a_body_that_hides_nothing():
    behind = from_behind_a_standing_car()
    for evidence in (behind, mirrored(behind)):
        bodies = np.array([CODES[name] for name in ("car", "pedestrian", "motorcycle")], dtype=np.int8)
        assert not prevents(replace(evidence, body=bodies))


@SIDES
def test_it_alone_prevents_that_the_ego_speeds_up_past_a_pedestrian(side):
    evidence = speeds_up_past_a_pedestrian(side)
    assert prevents(evidence)
    assert not any(prevents(evidence, name) for name in ("r157", "fsm", "rss"))


def test_it_prevents_nothing_where_it_had_no_reason_to_slow_down():
    assert not prevents(from_behind_a_standing_car(crossing=False))
    assert not prevents(cut_in(gap=1.0, ego=14.0, other=9.0, rate=3.0))
    assert not prevents(pedestrian_crosses(seen_from_s=7.6))


def test_it_prevents_what_r157_would_have():
    for evidence in (pedestrian_crosses(), cut_in(), leader_brakes(gap=40.0)):
        assert prevents(evidence) == prevents(evidence, "r157") is True


def test_what_else_slows_it_down_does_not_prevent():
    # It would have slowed down for a pedestrian 2 s before a car cuts in, so late that no driver prevents it.
    ego, beside = straight(0.0, 0.0, 0.0, 14.0), straight(14.0 * 5.5 + CAR_M[0] - 2.0 - 9.0 * 5.5, LANE_M, 0.0, 9.0)
    evidence = stage(ego, sideways(beside, 4.0, -3.0, LANE_M), straight(75.0, -2.5, 0.0, 0.0), kinds=(CAR, CAR, WALKER))
    assert not prevents(evidence)
