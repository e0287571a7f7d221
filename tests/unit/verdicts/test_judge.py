from dataclasses import replace

import numpy as np
import pytest

from risk_sac.records import ConflictType, Grade, Judgement
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.judge import DEFINITIONS, judge
from risk_sac.verdicts.reference import PREVENTING, grade
from risk_sac.world.types import Role
from tests.unit.verdicts.staged import (
    STREET,
    WALKING,
    crossing_car,
    cut_in,
    leader_brakes,
    mirrored,
    pedestrian_crosses,
    stage,
    straight,
)


def judged(evidence: Evidence) -> Judgement:
    return judge(evidence, "actor_1", valid=True)


@pytest.mark.parametrize(
    ("evidence", "kind", "variant"),
    [
        (
            pedestrian_crosses(),
            "pedestrian; ego goes straight",
            "ahead, on a crossing, slow; ego against priority, does not brake, fast, early conflict",
        ),
        (
            pedestrian_crosses(seen_from_s=7.0),
            "pedestrian, from hiding; ego goes straight",
            "ahead, on a crossing, slow; ego against priority, does not brake, fast, late conflict",
        ),
        (
            cut_in(),
            "cut-in from ahead; ego goes straight",
            "in a lane, fast; ego does not brake, fast, early conflict",
        ),
        (
            cut_in(gap=-3.0, ego=12.0, other=12.0),
            "cut-in from alongside; ego goes straight",
            "without a safe gap, in a lane, fast; ego does not brake, fast, late conflict",
        ),
        (
            leader_brakes(),
            "leader; ego goes straight",
            "brake-checking, ahead, in a lane, slow; ego does not brake, fast, early conflict",
        ),
        (
            crossing_car(side=-1),
            "vehicle from the right; ego goes straight",
            "ahead, in a lane, fast; ego does not brake, fast, early conflict",
        ),
        (
            crossing_car(side=1, other=16.0),
            "vehicle from the left; ego goes straight",
            "speeding, ahead, in a lane, fast; ego does not brake, fast, early conflict",
        ),
    ],
)
def test_kind_and_variant_in_words(evidence, kind, variant):
    found = judged(evidence)
    assert (found.kind, found.variant) == (kind, variant)


def test_who_drives_a_striker_makes_no_other_kind():
    evidence = crossing_car()
    background = judged(
        replace(evidence, role=np.where(evidence.role == Role.ADVERSARY, Role.BACKGROUND, evidence.role))
    )
    assert background.kind == judged(evidence).kind
    assert background.variant != judged(evidence).variant


@pytest.mark.parametrize(
    "evidence", [pedestrian_crosses(), cut_in(), cut_in(gap=4.0), leader_brakes(), pedestrian_crosses(seen_from_s=6.0)]
)
def test_a_mirrored_failure_is_the_same_failure(evidence):
    first, second = judged(evidence), judged(mirrored(evidence))
    assert second.model_copy(update={"conflict_y_m": first.conflict_y_m}) == first


def test_traffic_from_either_side_is_told_apart_in_the_name_only():
    first, second = judged(crossing_car()), judged(mirrored(crossing_car()))
    assert second.kind == first.kind.replace("right", "left")
    own = {"conflict_y_m": first.conflict_y_m, "kind": first.kind}
    assert second.model_copy(update=own) == first


def test_what_is_not_valid_gets_no_grade():
    found = judge(cut_in(), "actor_1", valid=False)
    assert (found.grade, dict(found.drivers)) == (None, {})
    assert found.conflict_type is ConflictType.CUT_IN
    assert found.definitions == DEFINITIONS


def test_only_the_word_of_the_chosen_drivers_makes_a_failure_preventable():
    evidence = pedestrian_crosses(seen_from_s=3.0)
    prevents = {name for name, outcome in judged(evidence).drivers.items() if outcome.avoids}
    for name in PREVENTING:
        found = judge(evidence, "actor_1", valid=True, preventing=(name,))
        assert (found.grade is Grade.PREVENTABLE) == (name in prevents)
        assert found.drivers == judged(evidence).drivers
    assert grade({"r157": False, "defensive": True, "full_braking": False}, ("r157",)) is Grade.UNAVOIDABLE


def test_grades_of_a_pedestrian_that_comes_into_sight():
    assert judged(pedestrian_crosses(seen_from_s=3.0)).grade is Grade.PREVENTABLE
    assert judged(pedestrian_crosses(seen_from_s=7.0)).grade is Grade.FULL_BRAKING
    assert judged(pedestrian_crosses(seen_from_s=8.0)).grade is Grade.UNAVOIDABLE


def test_more_time_in_sight_never_makes_the_grade_worse():
    order = [Grade.PREVENTABLE, Grade.FULL_BRAKING, Grade.UNAVOIDABLE]
    grades = [order.index(judged(pedestrian_crosses(seen_from_s=at / 10)).grade) for at in range(30, 82, 4)]
    assert grades == sorted(grades)


@pytest.mark.parametrize(
    ("accel", "response"),
    [
        ((), "none"),
        (((3.0, -2.0),), "braking"),  # t0 is 2.0 s before the contact, about 2.4
        (((4.1, -2.0),), "late_braking"),
        (((-1.5, -2.0), (0.0, 0.0)), "none"),
        (((2.5, -2.0), (3.0, 0.0)), "none"),  # it let go of the brake long before the last second
        (((2.5, -2.0), (3.0, 2.0)), "accelerating"),
        (((3.0, 2.0),), "accelerating"),
        (((3.5, 2.0), (3.7, -2.0)), "late_braking"),  # the longer counts
        (((2.5, -3.0), (5.0, 2.0)), "braking"),  # it let go of the brake just before
        (((3.5, 1.0),), "none"),
    ],
)
def test_what_the_ego_did_about_it(accel, response):
    evidence = stage(straight(0.0, 0.0, 0.0, 12.0, *accel), straight(75.0, 0.0, 0.0, 0.0))
    assert judged(evidence).ego_response == response


@pytest.mark.parametrize(("turn", "name"), [(1, "left_turn"), (-1, "right_turn")])
@pytest.mark.parametrize("speed_mps", [6.0, 1.2])  # the slower one has turned by 17 degrees in the last 3 s
def test_an_ego_in_a_turn(turn, name, speed_mps):
    def turning(t):
        a = speed_mps * max(t, 0.0) / 12.0
        return 12.0 * np.sin(a) + speed_mps * min(t, 0.0), turn * 12.0 * (1 - np.cos(a)), turn * a

    walker = straight(12.0, turn * 12.0, 0.0, 0.0)
    found = judged(stage(turning, walker, kinds=WALKING, ground=replace(STREET, roadway=()), until_s=20.0))
    assert found.ego_manoeuvre == name
    if speed_mps == 6.0:
        assert found.conflict_s < 1.0  # foreseen round the bend


def test_an_ego_that_sets_off_again_where_it_has_just_stopped_is_starting():
    ego = straight(0.0, 0.0, 0.0, 6.0, (0.5, -6.0), (1.6, 2.0))
    assert judged(stage(ego, straight(23.0, 0.0, 0.0, 0.0))).ego_response == "starting"
