"""Severity, overlaps and recorded contacts, which an ADS engineer has judged."""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from risk_sac.records import Fault, Grade, Judgement, Severity
from risk_sac.verdicts.evidence import PER_ACTOR, Evidence
from risk_sac.verdicts.judge import judge
from risk_sac.verdicts.labels import fatality_risk, severity
from risk_sac.verdicts.validity import Overlap, overlaps_before_contact
from risk_sac.world.types import Kind
from tests.unit.verdicts.recorded import recorded
from tests.unit.verdicts.staged import (
    LANE_M,
    STREET,
    WALKING,
    crossing_car,
    cut_in,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    sideways,
    stage,
    straight,
)


def test_a_pedestrian_dies_as_often_as_was_published():
    at = {kmh: fatality_risk(kmh / 3.6) for kmh in (0, 30, 40, 50, 76.7, 100)}
    assert at[50] > 2 * at[40]
    assert at[50] > 5 * at[30]
    assert at[50] == pytest.approx(0.083, abs=0.001)
    assert at[76.7] == pytest.approx(0.5, abs=0.001)
    assert at[0] < 0.0011


@pytest.mark.parametrize(
    ("impact_mps", "risk", "expected"),
    [
        (1.99, 0.001, Severity.MINOR),
        (2.0, 0.001, Severity.MODERATE),
        (12.0, 0.0099, Severity.MODERATE),
        (12.0, 0.01, Severity.SEVERE),
    ],
)
def test_classes_at_their_edges(impact_mps, risk, expected):
    assert severity(impact_mps, risk) is expected


def follows(closing_mps: float) -> Evidence:
    return stage(straight(0.0, 0.0, 0.0, 10.0 + closing_mps), straight(10.0, 0.0, 0.0, 10.0))


def stands_in_the_way(speed: float) -> Evidence:
    """A pedestrian that stands in the ego's way."""
    walker = straight(8.0, 0.2, math.pi / 2, 0.0)
    return stage(straight(0.0, 0.0, 0.0, speed), walker, kinds=WALKING)


def runs_into_a_rolling_car() -> Evidence:
    """A pedestrian at 4 m/s runs into a car at 0.6 m/s."""
    return stage(straight(0.0, 0.0, 0.0, 0.6), straight(20.0, 0.2, math.pi, 4.0), kinds=WALKING)


def slides_along() -> Evidence:
    """A car 8 m/s slower comes over into the ego's flank."""
    return stage(straight(0.0, 0.0, 0.0, 14.0), sideways(straight(36.0, LANE_M, 0.0, 6.0), 1.5, -1.0, LANE_M))


@pytest.mark.parametrize(
    ("evidence", "expected"),
    [
        (follows(1.5), Severity.MINOR),
        (follows(3.0), Severity.MODERATE),
        (leader_brakes(), Severity.SEVERE),
        (crossing_car(), Severity.MODERATE),  # closing at 17 m/s, 12 m/s of it along the normal
        (crossing_car(ego=13.5, other=6.0), Severity.SEVERE),
        (pedestrian_crosses(), Severity.SEVERE),
        (stands_in_the_way(6.0), Severity.MODERATE),
        (stands_in_the_way(1.0), Severity.MINOR),
        (runs_into_a_rolling_car(), Severity.MINOR),
        (slides_along(), Severity.MINOR),
    ],
)
def test_a_contact_says_how_bad_it_is(evidence, expected):
    found, again = (judge(each, "actor_1", valid=True) for each in (evidence, mirrored(evidence)))
    assert (found.severity, found.injury_risk) == (again.severity, again.injury_risk)
    assert found.severity is expected


def test_a_striker_that_has_left_cannot_have_struck():
    evidence = cut_in()
    evidence.x_m[-1, 1] = np.nan
    with pytest.raises(ValueError, match="'actor_1' has left"):
        evidence.column("actor_1")
    with pytest.raises(ValueError, match="'actor_0' is not among"):
        evidence.column("actor_0")


@pytest.mark.parametrize("evidence", [cut_in(), leader_brakes()], ids=["cut-in", "leader"])
def test_what_is_stored_is_judged_alike(evidence):
    names = (*PER_ACTOR, "link", "kind", "body", "role", "length_m", "width_m")
    stored = {name: getattr(evidence, name) for name in names} | {"ids": np.array(evidence.ids)}
    stored |= {"time_s": evidence.time_s + 1.5, "visible": np.where(evidence.known, 1.0, np.nan)}
    first = judge(evidence, "actor_1", valid=True)
    again = judge(Evidence.from_series(stored, STREET, 1.5), "actor_1", valid=True)
    assert (again.conflict_s, again.noticed_s) == pytest.approx((first.conflict_s, first.noticed_s))
    assert again.model_copy(update={"conflict_s": first.conflict_s, "noticed_s": first.noticed_s}) == first


CAR = Kind.VEHICLE


@pytest.mark.parametrize("evidence", [cut_in(), pedestrian_crosses()], ids=["vehicle", "pedestrian"])
def test_the_two_that_touch_at_the_end_are_no_overlap(evidence):
    assert overlaps_before_contact(evidence) == []


def test_every_frame_in_which_two_others_overlap_is_found_and_named():
    # The third passes through the fourth, 4.6 m long, at 10 m/s: it is inside it for 0.92 s.
    passing, standing = straight(-10.0, 6.0, 0.0, 10.0, start_s=0.0), straight(0.0, 6.0, 0.0, 0.0)
    ego, struck = straight(0.0, 0.0, 0.0, 10.0, start_s=0.0), straight(50.0, 0.0, 0.0, 0.0)
    evidence = stage(ego, struck, passing, standing, kinds=(CAR,) * 4, from_s=0.0)
    found = overlaps_before_contact(evidence)
    assert {each[1:] for each in found} == {("actor_2", "actor_3")}
    assert [each.time_s for each in found] == pytest.approx([t / 10 for t in range(6, 15)])
    assert overlaps_before_contact(mirrored(evidence)) == found


def test_a_pedestrian_inside_a_vehicle_is_an_overlap():
    walker, truck = straight(30.0, 4.0, 0.0, 0.0), straight(29.0, 4.0, 0.0, 0.0)
    ego, struck = straight(0.0, 0.0, 0.0, 10.0, start_s=0.0), straight(6.0, 0.0, 0.0, 0.0)
    evidence = stage(ego, struck, walker, truck, kinds=(CAR, CAR, Kind.PEDESTRIAN, CAR), from_s=0.0)
    assert overlaps_before_contact(evidence)[0] == Overlap(0.0, "actor_2", "actor_3")


class Expected(NamedTuple):
    """What an engineer says of a contact."""

    fault: Fault
    grade: Grade
    response: str
    severity: Severity


NAMED = {
    # It passes a pedestrian on red that stands 0.5 m beside its way and speeds up, then brakes for 0.4 s. The
    # pedestrian walks into its flank.
    "dense_267": Expected(Fault.SHARED, Grade.PREVENTABLE, "accelerating", Severity.MINOR),
    # It stops in its turn, sees the crossing car, which came on red, for 7.7 s, and starts into it.
    "dense_263": Expected(Fault.SHARED, Grade.PREVENTABLE, "starting", Severity.MODERATE),
    # It passes a vehicle that stops at an unsignalled crossing, at 14 m/s; a pedestrian comes from behind that
    # vehicle, and walks into its flank.
    "mixed_71": Expected(Fault.EGO, Grade.PREVENTABLE, "braking", Severity.MINOR),
    # Two vehicles side by side creep at 2 m/s, and their flanks touch.
    "mixed_294": Expected(Fault.OTHER, Grade.UNAVOIDABLE, "braking", Severity.MINOR),
    # A vehicle that overtakes comes over from alongside, twice; the ego rolls on, or brakes late. Their flanks touch.
    "low_267": Expected(Fault.SHARED, Grade.PREVENTABLE, "none", Severity.MINOR),
    "low_198": Expected(Fault.SHARED, Grade.PREVENTABLE, "late_braking", Severity.MINOR),
}


def verdict(name: str) -> Judgement:
    evidence, striker = recorded(name)
    return judge(evidence, striker, valid=True)


@pytest.mark.parametrize("name", NAMED)
def test_what_an_engineer_says(name):
    found, expected = verdict(name), NAMED[name]
    assert (found.fault, found.grade, found.ego_response, found.severity) == expected


@pytest.mark.parametrize("name", NAMED)
def test_the_mirrored_contact_has_the_same_verdict(name):
    evidence, striker = recorded(name)
    evidence = replace(evidence, ground=replace(evidence.ground, net=""))  # there is no mirrored net
    first, second = (judge(each, striker, valid=True) for each in (evidence, mirrored(evidence)))
    assert second.ego_part == first.ego_part
    for name in ("fault", "grade", "ego_response", "severity"):
        assert getattr(second, name) == getattr(first, name)


def test_a_speed_that_did_not_fit_its_sight_is_stated():
    part = verdict("mixed_71").ego_part
    assert part.sighted_mps == pytest.approx(13.4, abs=0.1)
    assert part.sight_mps == pytest.approx(7.6, abs=0.1)
