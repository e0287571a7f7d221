"""Fault for a contact: the rule by line, and an engineer's judgement."""

import math
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.records import ConflictType, Fault, Grade, Severity
from risk_sac.scenario.layout import Area
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.fault import Parts, fault, has_to_yield, parts_of_violation
from risk_sac.verdicts.offences import endangered_ego
from risk_sac.verdicts.reference import AVOIDED
from risk_sac.world.types import Kind
from tests.builders import collision, judgement, violation
from tests.unit.verdicts.staged import (
    CAR_M,
    LANE_M,
    STREET,
    WALKING,
    Motion,
    crossing_car,
    cut_in,
    judged,
    leader_brakes,
    merge,
    mirrored,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
)

JUNCTION = (Area.box(50.0, 70.0, -10.0, 10.0),)


@pytest.mark.parametrize(
    ("parts", "expected"),
    [
        (Parts(other_broke=True, drove_into=True, ego_erred=True), Fault.SHARED),
        (Parts(drove_into=True, other_yields=True), Fault.EGO),
        (Parts(other_yields=True, ego_erred=True), Fault.SHARED),
        (Parts(other_broke=True), Fault.OTHER),
        (Parts(other_broke=True, ego_yields=True, left_rss=True), Fault.OTHER),
        (Parts(ego_erred=True), Fault.EGO),
        (Parts(ego_yields=True), Fault.EGO),
        (Parts(left_rss=True), Fault.EGO),
        (Parts(), Fault.OTHER),
    ],
)
def test_the_first_line_of_the_rule_that_holds_decides(parts, expected):
    assert fault(parts) is expected


@pytest.mark.parametrize(
    ("conflict", "ground", "broke", "ego_broke", "expected"),
    [
        (ConflictType.PEDESTRIAN, "crossing", (), (), "ego"),
        (ConflictType.PEDESTRIAN, "crossing", ("pedestrian_on_red",), (), "striker"),
        (ConflictType.PEDESTRIAN, "lane", (), (), "striker"),
        (ConflictType.CROSSING, "junction", ("red_light",), (), "striker"),
        (ConflictType.CROSSING, "junction", (), ("priority",), "ego"),
        (ConflictType.CROSSING, "junction", (), (), None),
        (ConflictType.LEADER, "lane", ("brake_check",), (), "ego"),
        (ConflictType.CUT_IN, "lane", ("unsafe_lane_change",), (), None),
    ],
)
def test_who_has_to_yield(conflict, ground, broke, ego_broke, expected):
    assert has_to_yield(conflict, ground, broke, ego_broke) == expected


@pytest.mark.parametrize(
    ("own", "other_broke", "grade", "expected"),
    [
        (True, ("red_light",), Grade.PREVENTABLE, Fault.EGO),
        (True, (), Grade.FULL_BRAKING, Fault.OTHER),
        (True, (), Grade.UNAVOIDABLE, Fault.OTHER),
        (False, (), Grade.PREVENTABLE, Fault.EGO),
        (False, ("unsafe_lane_change",), Grade.PREVENTABLE, Fault.SHARED),
        (False, ("unsafe_lane_change",), Grade.FULL_BRAKING, Fault.OTHER),
        (False, (), Grade.UNAVOIDABLE, Fault.OTHER),
    ],
)
def test_a_violation_without_contact(own, other_broke, grade, expected):
    parts = parts_of_violation(own=own, yields=None, other_broke=other_broke, broke=(), grade=grade)
    assert fault(parts) is expected


@pytest.mark.parametrize(
    ("fault", "by", "severity", "counts"),
    [
        (Fault.OTHER, "defensive", Severity.MODERATE, False),
        (Fault.OTHER, "rss", Severity.MODERATE, True),
        (Fault.OTHER, "rss", Severity.MINOR, False),
        (Fault.SHARED, "defensive", Severity.MODERATE, True),
    ],
)
def test_what_others_caused_is_a_headline_only_where_a_driver_that_reacts_prevents_it(fault, by, severity, counts):
    found = collision(judgement=judgement(fault=fault, drivers={by: AVOIDED}, severity=severity))
    assert found.headline_candidate is counts
    if severity is not Severity.MINOR:
        found = violation(grade=Grade.PREVENTABLE, fault=fault, drivers={by: True})
        assert found.headline_candidate is counts


def past_a_pedestrian(accel: float) -> Evidence:
    """Pedestrian 0.3 m aside steps on 0.7 s before the speeding-up ego."""
    ego = straight(0.0, 0.0, 0.0, 8.0, (1.0, accel), start_s=0.0)
    meets_s = next(t / 100 for t in range(1000) if ego(t / 100)[0] + CAR_M[0] / 2 >= 40.0)
    beside = straight(40.0, CAR_M[1] / 2 + 0.25 + 0.3, -math.pi / 2, 1.5, start_s=meets_s - 0.7)
    stands: Motion = lambda t: beside(max(t, meets_s - 0.7))  # noqa: E731
    return stage(ego, stands, kinds=WALKING, from_s=0.0, ground=replace(STREET, crossings=()))


def test_an_ego_that_speeds_up_past_a_pedestrian_it_sees_at_its_way():
    found = judged(past_a_pedestrian(1.5))
    assert found.ego_part.sped_up
    assert (found.fault, found.ego_response) == (Fault.EGO, "accelerating")


def starts_into(entered_s: float) -> Evidence:
    """A car that entered on red waits before the ego; both start."""
    ego = straight(45.0, 0.0, 0.0, 0.0, (3.0, 2.3))
    car = straight(60.0, -20.5, math.pi / 2, 6.0, (0.0, -3.0), (4.0, 2.5))
    evidence = stage(ego, car, ground=replace(STREET, junctions=JUNCTION))
    link = np.zeros_like(evidence.link)
    link[evidence.time_s < entered_s, 1] = ord("r")
    return replace(evidence, link=link)


@pytest.mark.parametrize(("red", "expected"), [(True, Fault.SHARED), (False, Fault.EGO)])
def test_an_ego_that_stands_and_starts_into_a_crossing_car_it_sees(red, expected):
    evidence = starts_into(entered_s=1.0)
    found = judged(evidence if red else replace(evidence, link=np.zeros_like(evidence.link)))
    assert (found.ego_part.started, found.fault, found.ego_response) == (True, expected, "starting")


@pytest.mark.parametrize(("letter", "expected"), [("", Fault.OTHER), ("g", Fault.EGO)], ids=["none", "had to yield"])
def test_a_crossing_car_that_runs_into_the_egos_rear_half(letter, expected):
    """The ego's middle is 1.7 m beyond the other's at the touch."""
    evidence = crossing_car(other=9.0, ahead=-6.0)
    link = np.zeros_like(evidence.link)
    link[evidence.time_s < 3.0, 0], link[evidence.time_s < 3.0, 1] = ord(letter) if letter else 0, ord("G")
    evidence = replace(evidence, link=link, ground=replace(STREET, junctions=JUNCTION))
    assert judged(evidence).fault is expected


@pytest.mark.parametrize(
    ("green_s", "enters_s", "red", "expected"),
    [(2.5, 1.5, False, Fault.EGO), (1.0, 2.0, False, Fault.OTHER), (2.5, 1.5, True, Fault.OTHER)],
    ids=["it was there before the green", "it came later", "it came on red"],
)
def test_a_car_that_clears_the_junction_when_the_egos_signal_turns_green(green_s, enters_s, red, expected):
    """It hits the ego's rear half: late reaction alone does not count."""
    evidence = crossing_car(other=9.0, ahead=-6.0)
    link, time_s = np.zeros_like(evidence.link), evidence.time_s
    link[time_s < 3.5, 0] = ord("G")
    link[time_s < green_s, 0] = ord("r")
    link[time_s < enters_s, 1] = ord("r" if red else "G")
    y_m = float(evidence.y_m[np.searchsorted(time_s, enters_s), 1])
    junction = (Area.box(45.0, 75.0, *sorted((y_m + CAR_M[0] / 2, -y_m))),)
    evidence = replace(evidence, link=link, ground=replace(STREET, junctions=junction))
    assert judged(evidence).fault is expected


def test_a_car_that_runs_a_red_light_into_an_ego_that_has_just_started():
    ego = straight(45.0, 0.0, 0.0, 0.0, (3.0, 2.3))
    car = straight(60.0, -12.0 * 6.4, math.pi / 2, 12.0, start_s=0.0)
    evidence = stage(ego, car, from_s=0.0, ground=replace(STREET, junctions=JUNCTION))
    link = np.zeros_like(evidence.link)
    link[evidence.y_m[:, 1] < -12.0, 1] = ord("r")
    found = judged(replace(evidence, link=link))
    assert "red_light" in found.broke
    assert (found.ego_part.started, found.fault) == (False, Fault.SHARED)  # it speeds up until the contact


def test_an_ego_that_passes_a_vehicle_at_a_crossing_from_behind_which_a_pedestrian_comes():
    found = judged(pedestrian_crosses(speed=13.9, seen_from_s=6.3))
    assert found.ego_part.too_fast
    assert (found.fault, found.grade) == (Fault.EGO, Grade.UNAVOIDABLE)


def test_an_unsafe_cut_in_before_an_ego_that_brakes_at_once():
    ego = straight(0.0, 0.0, 0.0, 14.0, (2.6, -7.5))
    beside = straight(14.0 * 3.5 + CAR_M[0] - 1.0 - 9.0 * 3.5, LANE_M, 0.0, 9.0)
    found = judged(stage(ego, sideways(beside, 2.0, -1.2, LANE_M)))
    assert found.broke == ("unsafe_lane_change",)
    assert found.fault is Fault.OTHER


def test_an_unsafe_cut_in_that_the_ego_had_the_time_to_answer():
    ego, start = straight(0.0, 0.0, 0.0, 14.0), (14.0 - 12.0) * 3.5 + CAR_M[0] + 4.5
    found = judged(stage(ego, sideways(straight(start, LANE_M, 0.0, 12.0), 2.0, -0.5, LANE_M)))
    assert found.broke == ("unsafe_lane_change",)
    assert (found.grade, found.fault) == (Grade.PREVENTABLE, Fault.SHARED)


def test_a_follower_that_does_not_brake_shares_the_fault_of_a_brake_check():
    assert judged(leader_brakes()).fault is Fault.SHARED


def named(evidence: Evidence) -> tuple[str, ...]:
    found, again = (endangered_ego(each, 1, find_conflict(each, 1)) for each in (evidence, mirrored(evidence)))
    assert found == again
    return found


@pytest.mark.parametrize(
    ("evidence", "expected"),
    [
        (cut_in(gap=-3.0, ego=12.0, other=12.0), ("unsafe_lane_change",)),  # beside the ego
        (cut_in(gap=6.0, ego=14.0, other=9.0), ("unsafe_lane_change",)),  # ahead, and far too near
        (cut_in(gap=40.0, ego=14.0, other=9.0), ()),  # R157's driver would brake in time
        (merge(), ()),  # the ego came over
        (crossing_car(), ()),
        (pedestrian_crosses(), ()),
    ],
)
def test_a_lane_change_without_room(evidence, expected):
    assert named(evidence) == expected


def led(braking: float, *others: Motion, kinds: tuple[Kind, ...] = ()) -> Evidence:
    """The leader, 10 m ahead, brakes; others are there too."""
    ego, leader = straight(0.0, 0.0, 0.0, 14.0), straight(CAR_M[0] + 10.0, 0.0, 0.0, 14.0, (2.0, -braking))
    return stage(ego, leader, *others, kinds=(Kind.VEHICLE, Kind.VEHICLE, *kinds))


CHECKS = ("brake_check",)


@pytest.mark.parametrize(
    ("ahead_m", "y_m", "kind", "expected"),
    [
        (20.0, 0.0, Kind.VEHICLE, ()),
        (60.0, 0.0, Kind.VEHICLE, CHECKS),
        (20.0, LANE_M, Kind.VEHICLE, CHECKS),  # in the lane beside
        (-30.0, 0.0, Kind.VEHICLE, CHECKS),  # behind the ego
        (20.0, 1.8, Kind.PEDESTRIAN, ()),
        (20.0, 5.0, Kind.PEDESTRIAN, CHECKS),
    ],
)
def test_a_leader_that_brakes_for_nobody(ahead_m, y_m, kind, expected):
    other = straight(CAR_M[0] + 10.0 + ahead_m, y_m, 0.0, 14.0)
    assert named(led(8.0)) == CHECKS
    assert named(led(8.0, other, kinds=(kind,))) == expected


@pytest.mark.parametrize(("braking", "expected"), [(4.0, ()), (4.0 + 1e-6, ()), (4.1, CHECKS)])
def test_a_brake_check_is_harder_than_drivers_of_ordinary_behaviour_brake(braking, expected):
    assert named(led(braking)) == expected


def walks(x_m: float, y_m: float, turn_rad: float, at_s: float) -> Motion:
    """Walks along the kerb towards the ego; turns right at `at_s`."""
    along = straight(x_m, y_m, math.pi, 1.4)
    return lambda t: along(t) if t < at_s else straight(*along(at_s)[:2], math.pi + turn_rad, 1.4, start_s=at_s)(t)


def test_a_pedestrian_that_turns_into_the_way():
    ego, walker = straight(0.0, 0.0, 0.0, 8.0), walks(50.0, 3.2, math.pi / 2, 2.5)
    seen, unseen = stage(ego, walker, kinds=WALKING), stage(ego, walker, kinds=WALKING, seen_from_s=2.7)
    assert named(seen) == ("turned_into_path",)
    assert named(unseen) == ()  # it could not see the ego when it turned


@pytest.mark.parametrize(
    ("ahead_m", "expected"),
    [
        (-1.0, CHECKS),  # it has come over before the ego, and then brakes
        (-7.0, ("unsafe_lane_change",)),  # it touches the ego while it comes over
    ],
)
def test_a_vehicle_that_comes_over_and_brakes(ahead_m, expected):
    beside = sideways(straight(ahead_m, LANE_M, 0.0, 12.0, (2.5, -6.0)), 2.0, -1.2, LANE_M)
    assert named(stage(straight(0.0, 0.0, 0.0, 9.0), beside)) == expected


def test_how_long_a_hidden_striker_was_in_view_agrees_with_its_conflict() -> None:
    late = collision(time_s=4.348, visible_for_s=1.1, judgement=judgement(conflict_s=3.3, hidden=True))
    assert late.view_in_words == "which came into its view only 1.0 s before"
    assert late.conflict_in_words.endswith("came into sight 1.0 s before the contact")
