"""Distinct failures by kind, and worth of finds by kind and variant."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.records import Collision, Grade, Severity
from risk_sac.records.violation import ranking_weight
from risk_sac.verdicts.distinct import CANDIDATE, NEW_KIND, NEW_VARIANT, DistinctFailures, Finds, distinct_failures
from tests.builders import collision, judgement, plausibility, violation


def failure(kind: str = "leader", variant: str = "ahead", grade: Grade | None = None) -> Collision:
    return collision(judgement=judgement(grade, kind=kind, variant=variant))


any_failure = st.builds(failure, st.sampled_from(["leader", "cut-in"]), st.sampled_from(["ahead", "alongside"]))


@pytest.mark.parametrize(
    ("second", "distinct"),
    [
        (failure(), False),
        (failure(variant="alongside"), False),
        (failure("cut-in"), True),
        (violation(), True),
    ],
)
def test_failures_of_one_kind_are_not_distinct(second, distinct):
    assert distinct_failures([failure(), second]) == ((0, 1) if distinct else (0,))


@given(st.lists(any_failure, max_size=30), st.randoms(use_true_random=False))
def test_the_count_is_the_same_in_any_order_and_after_a_resume(hits, order):
    found, again = DistinctFailures(), DistinctFailures()
    for hit in hits:
        found.add(hit)
    shuffled = list(hits)
    order.shuffle(shuffled)
    for hit in shuffled + hits[:3]:
        again.add(hit)
    assert found.count == again.count == len(distinct_failures(hits))


def test_a_new_kind_is_worth_four_times_a_new_variant():
    finds = Finds()
    assert finds.add([failure()]) == NEW_KIND == 4 * NEW_VARIANT
    assert finds.add([failure(variant="alongside")]) == NEW_VARIANT
    assert finds.add([failure(variant="alongside")]) == 0.0


def test_the_first_candidate_of_a_known_kind_is_worth_what_it_adds():
    finds = Finds()
    finds.add([failure()])
    assert finds.add([failure(grade=Grade.PREVENTABLE)]) == CANDIDATE * NEW_KIND
    assert finds.add([failure(variant="alongside", grade=Grade.PREVENTABLE)]) == NEW_VARIANT + CANDIDATE * NEW_VARIANT


def test_finds_continue_from_their_state():
    first, second = Finds(), Finds()
    first.add([failure(grade=Grade.PREVENTABLE), violation()])
    second.load(first.state())
    assert second.state() == first.state()
    assert second.add([failure(grade=Grade.PREVENTABLE), violation()]) == 0.0


def test_failures_weigh_by_severity_times_plausibility():
    unlikely = judgement(severity=Severity.SEVERE, plausibility=plausibility(joint_probability=0.004))
    likely = judgement(plausibility=plausibility(joint_probability=0.3))
    assert collision(judgement=unlikely).weight() == pytest.approx(0.004)
    assert collision(judgement=likely).weight() == pytest.approx(0.03)
    assert violation(grade=Grade.PREVENTABLE).weight() == pytest.approx(0.03)  # without contact as a moderate one
    assert collision().weight() == 0.0  # not valid
    assert collision(judgement=likely).weight(density=4.0) == pytest.approx(0.12)
    assert ranking_weight(Severity.SEVERE, 0.5, 3.0) == 1.5
    assert ranking_weight(Severity.MINOR, 0.5) == 0.005
