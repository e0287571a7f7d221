"""Turns of two searchers: by yields worked out by hand."""

from collections import Counter

import pytest

from risk_sac.records import Collision, Grade
from risk_sac.turns import EXPECTED, EXPECTED_STEPS, KEPT, LEAST, NEW, NEW_PREVENTABLE, Turns
from tests.builders import collision, judgement

STEPS = 100


def failure(signature: str, grade: Grade = Grade.IDEAL) -> Collision:
    return collision(judgement=judgement(grade, signature=signature))


def test_whoever_was_not_tried_is_expected_to_yield_alike() -> None:
    assert Turns((1.0, 4.0), seed=0).share == 0.5


def test_the_share_follows_what_each_yielded_for_what_it_cost() -> None:
    turns = Turns((1.0, 4.0), seed=0)
    turns.tell(0, STEPS, failure("one"))
    turns.tell(1, STEPS, failure("another", Grade.CAREFUL))
    first = (EXPECTED + NEW) / (EXPECTED_STEPS + STEPS)
    second = (EXPECTED + NEW + NEW_PREVENTABLE) / (EXPECTED_STEPS + 4 * STEPS)
    assert turns.share == pytest.approx(second**2 / (first**2 + second**2))
    turns.tell(1, STEPS, None)
    second = (EXPECTED + KEPT * (NEW + NEW_PREVENTABLE)) / (EXPECTED_STEPS + (1 + KEPT) * 4 * STEPS)
    assert turns.share == pytest.approx(second**2 / (first**2 + second**2))


def test_what_either_has_found_is_new_to_neither() -> None:
    turns = Turns((1.0, 1.0), seed=0)
    turns.tell(0, STEPS, failure("one", Grade.CAREFUL))
    before = turns.share
    turns.tell(1, 0, failure("one", Grade.CAREFUL))
    assert turns.share == before
    turns.tell(1, 0, collision(verdicts={"ego_moving": False}, judgement=judgement(signature="another")))
    assert turns.share == before  # no valid failure


def test_nobody_is_given_up_and_who_costs_more_is_tried_less() -> None:
    turns = Turns((1.0, 4.0), seed=0)
    for number in range(200):
        turns.tell(0, 1, failure(f"number {number}", Grade.CAREFUL))
        turns.tell(1, STEPS, None)
    share = turns.share
    assert 4.0 * share / (4.0 * share + 1.0 - share) == pytest.approx(LEAST)
    drawn = Counter(turns.next() for _ in range(20_000))
    assert 0.5 * share < drawn[1] / 20_000 < 2 * share


def test_a_search_that_is_cheaper_is_left_as_little() -> None:
    turns = Turns((1.0, 4.0), seed=0)
    for number in range(200):
        turns.tell(1, 1, failure(f"number {number}", Grade.CAREFUL))
        turns.tell(0, STEPS, None)
    rest = 1.0 - turns.share
    assert rest / (rest + 4.0 * turns.share) == pytest.approx(LEAST)
