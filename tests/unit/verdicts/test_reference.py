"""Reference drivers against stopping distances worked out by hand."""

import math
from collections.abc import Mapping
from dataclasses import replace

import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from risk_sac.records import ReferenceOutcome
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.reference import reference_outcomes
from tests.unit.verdicts.staged import (
    CAR_M,
    STREET,
    WALKING,
    crossing_car,
    cut_in,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    stage,
    straight,
    waiting,
)


def outcomes(evidence: Evidence) -> Mapping[str, ReferenceOutcome]:
    return reference_outcomes(evidence, 1, find_conflict(evidence, 1))


def standing_in_the_way(distance_m: float, speed: float = 15.0, friction: float = 1.0) -> Evidence:
    """A pedestrian standing `distance_m` ahead comes into sight at time 0."""
    ego = straight(-1.5 * speed, 0.0, 0.0, speed)
    walker = straight(CAR_M[0] / 2 + distance_m + 0.25, 0.0, 0.0, 0.0)
    return stage(
        ego,
        walker,
        kinds=WALKING,
        seen_from_s=0.0,
        until_s=distance_m / speed + 1.0,
        ground=replace(STREET, friction=friction),
    )


# careful from 15 m/s: 6 m perceiving, 0.75 s at 0.4 m/s²: 11.1375; 0.5686 s of jerk: 7.906, then 12.428²/(2·7.593) =
# 10.170; together 35.21 m. On friction 0.5 (4.905 m/s²): 0.3561 s of jerk: 5.114, then 13.756²/9.81 = 19.29; 41.54 m.
# The bound: 225/16 = 14.06 m, and 225/9.81 = 22.94 m on friction 0.5.
# fsm: PFS and CFS of something that stands 0.75 s of 15 m/s away are 1 long before: 11.25 m, then 6 m/s² with its jerk.
@pytest.mark.parametrize(
    ("driver", "friction", "needs_m"),
    [("r157", 1.0, 35.21), ("r157", 0.5, 41.54), ("full_braking", 1.0, 14.06), ("full_braking", 0.5, 22.94)],
)
def test_a_driver_needs_its_stopping_distance(driver, friction, needs_m):
    assert outcomes(standing_in_the_way(needs_m + 0.1, friction=friction))[driver].avoids
    assert not outcomes(standing_in_the_way(needs_m - 0.1, friction=friction))[driver].avoids


def test_a_driver_counts_on_its_own_where_the_ego_braked_harder():
    # The ego brakes with 9 m/s² from 0.2 s after the conflict began: careful takes over 0.2 s later, at 13.2 m/s.
    ego = straight(-1.5 * 15.0, 0.0, 0.0, 15.0, (0.2, -9.0))
    walker = straight(CAR_M[0] / 2 + 14.0 + 0.25, 0.0, 0.0, 0.0)
    found = outcomes(stage(ego, walker, kinds=WALKING, seen_from_s=0.0))["r157"]
    assert found.impact_speed_mps == pytest.approx(13.2, abs=0.6)


def test_who_stands_when_it_is_struck_has_avoided():
    # A head-on driver: everybody is struck in the end, the bound after it has come to a stand.
    evidence = stage(straight(0.0, 0.0, 0.0, 8.0), straight(60.0, 0.0, math.pi, 8.0))
    assert outcomes(evidence)["full_braking"].avoids
    slow_ego = stage(straight(0.0, 0.0, 0.0, 0.0, (1.0, 1.0)), straight(60.0, 0.0, math.pi, 10.0))
    assert outcomes(slow_ego)["r157"].avoids


def test_who_has_passed_by_then_has_not_avoided():
    # The ego brakes with 6 m/s² from 0.3 s on for a pedestrian that comes into sight at 0, and is struck on its flank
    # at 1.4 s. The careful driver brakes 0.75 s after 0.5 s, and would have been gone.
    ego = straight(-1.5 * 12.0, 0.0, 0.0, 12.0, (0.3, -6.0))
    walker = waiting(CAR_M[0] / 2 + 10.0, -1.425 - 2.5, math.pi / 2, 2.0, until_s=0.0)
    evidence = stage(ego, walker, kinds=WALKING, seen_from_s=0.0)
    assert evidence.time_s[-1] == pytest.approx(1.4)
    for seen in (evidence, mirrored(evidence)):
        found = outcomes(seen)["r157"]
        assert not found.avoids
        assert found.impact_speed_mps == pytest.approx(10.6, abs=0.1)  # as it passes


def test_who_stands_before_the_ego_comes_past_has_avoided():
    # The ego brakes with 9 m/s² down to 2 m/s and rolls on into what stands 15.5 m ahead. The bound brakes with 8 m/s²
    # and stands after 1.88 s and 14.06 m, where the ego is at 13.1 m, and not yet at 15.5 m.
    ego = straight(-1.5 * 15.0, 0.0, 0.0, 15.0, (0.0, -9.0), (13.0 / 9.0, 0.0))
    walker = straight(CAR_M[0] / 2 + 15.5 + 0.25, 0.0, 0.0, 0.0)
    evidence = stage(ego, walker, kinds=WALKING, seen_from_s=0.0)
    assert evidence.time_s[-1] > 2.5
    assert outcomes(evidence)["full_braking"].avoids


# v_rel 5: 5/12 + 0.35 = 0.767 s, 3.83 m. It intrudes by 0.3 m when its side is 1.35 m from the ego's middle: 1.025 m
# over, 0.854 s after it began, in which the gap shrinks by 4.27 m.
@pytest.mark.parametrize(("gap", "avoids"), [(4.27 + 3.83 + 0.6, True), (4.27 + 3.83 - 0.6, False)])
@pytest.mark.parametrize("side", [1, -1])
def test_r157_measures_a_cut_in_at_the_intrusion(gap, avoids, side):
    assert outcomes(cut_in(gap=gap, side=side))["r157_ttc"].avoids is avoids


STAGED = {
    "pedestrian": pedestrian_crosses(),
    "hidden": pedestrian_crosses(seen_from_s=6.5),
    "cut-in": cut_in(),
    "close cut-in": cut_in(gap=4.0),
    "alongside": cut_in(gap=-3.0, ego=12.0, other=12.0),
    "leader": leader_brakes(),
    "crossing": crossing_car(),
    "crossing later": crossing_car(ahead=2.0),
}


@pytest.mark.parametrize("name", STAGED)
def test_the_mirrored_contact_has_the_same_outcomes(name):
    assert outcomes(mirrored(STAGED[name])) == outcomes(STAGED[name])


speeds = st.floats(3.0, 20.0)


@settings(deadline=None, max_examples=40)
@given(speeds, st.floats(1.0, 60.0), st.sampled_from([0.4, 0.7, 1.0]))
def test_the_bound_avoids_what_careful_avoids(speed, distance, friction):
    found = outcomes(standing_in_the_way(distance, speed, friction))
    assert found["full_braking"].avoids >= found["r157"].avoids
    assert found["full_braking"].impact_speed_mps <= found["r157"].impact_speed_mps + 0.2


@settings(deadline=None, max_examples=30)
@given(speeds, st.floats(1.0, 40.0), st.floats(0.5, 20.0))
def test_more_room_never_makes_it_worse(speed, distance, more):
    near, far = outcomes(standing_in_the_way(distance, speed)), outcomes(standing_in_the_way(distance + more, speed))
    for driver in ("r157", "full_braking", "rss", "fsm"):
        assert far[driver].avoids >= near[driver].avoids


@settings(deadline=None, max_examples=40)
@given(st.floats(4.0, 15.0), st.floats(0.8, 2.5), st.floats(0.0, 9.0), st.floats(0.2, 1.5), st.floats(0.2, 4.0))
def test_the_bound_avoids_what_careful_avoids_before_a_pedestrian(speed, walk, braking, braked_s, seen_s):
    reach_s = 97.7 / speed
    ego = straight(0.0, 0.0, 0.0, speed, (reach_s - braked_s, -braking), start_s=0.0)
    walker = straight(98.0, walk * reach_s, -math.pi / 2, walk, start_s=0.0)
    try:
        evidence = stage(ego, walker, kinds=WALKING, from_s=0.0, seen_from_s=reach_s - seen_s, until_s=reach_s + 5.0)
    except AssertionError:  # the ego braked enough
        reject()
    found = outcomes(evidence)
    assert found["full_braking"].avoids >= found["r157"].avoids


def test_a_moved_and_turned_scene_has_the_same_outcomes():
    evidence = STAGED["cut-in"]
    turn, cos, sin = 2.0, math.cos(2.0), math.sin(2.0)
    moved = replace(
        evidence,
        x_m=100.0 + evidence.x_m * cos - evidence.y_m * sin,
        y_m=-50.0 + evidence.x_m * sin + evidence.y_m * cos,
        heading_rad=(evidence.heading_rad + turn + math.pi) % math.tau - math.pi,
        vx_mps=evidence.vx_mps * cos - evidence.vy_mps * sin,
        vy_mps=evidence.vx_mps * sin + evidence.vy_mps * cos,
    )
    for name, found in outcomes(moved).items():
        assert found.avoids == outcomes(evidence)[name].avoids
        assert found.impact_speed_mps == pytest.approx(outcomes(evidence)[name].impact_speed_mps)
