"""What the archive search adds to the promises in test_scene_optimizer.py."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.config import SceneOptimizerConfig
from risk_sac.records import Collision, Grade, ReferenceOutcome, Severity
from risk_sac.search.encounter import Encounter
from risk_sac.search.scene_optimizer import ArchiveOptimizer, DiscountedBandit
from risk_sac.search.scene_optimizer.archive import CREDIT, INITIAL, Elites, mutated
from risk_sac.verdicts.distinct import CANDIDATE, NEW_KIND, NEW_VARIANT
from tests.builders import collision, judgement, violation

HERE, THERE = np.full(3, 0.25), np.full(3, 0.75)


def failure(
    grade: Grade, kind: str = "cut-in", impact_mps: float = 5.0, striker: str = "left", **judged: Any
) -> Collision:
    careful = ReferenceOutcome(avoids=grade is Grade.PREVENTABLE, impact_speed_mps=impact_mps)
    return collision(other_id=striker, judgement=judgement(grade, kind=kind, drivers={"r157": careful}, **judged))


def test_a_niche_keeps_what_the_careful_driver_came_nearest_to_preventing():
    elites = Elites()
    for point, grade, impact_mps in (
        (HERE, Grade.UNAVOIDABLE, 9.0),
        (THERE, Grade.FULL_BRAKING, 2.0),
        (HERE, Grade.FULL_BRAKING, 4.0),
    ):
        elites.add_failure(point, failure(grade, impact_mps=impact_mps), None)
    (almost,) = elites.pool()
    np.testing.assert_array_equal(almost.point, THERE)
    elites.add_failure(HERE, failure(Grade.PREVENTABLE), None)
    (preventable,) = elites.pool()
    np.testing.assert_array_equal(preventable.point, HERE)
    assert preventable.worth > almost.worth


def test_a_minor_contact_ranks_below_what_the_headline_counts():
    elites = Elites()
    elites.add_failure(HERE, failure(Grade.PREVENTABLE, severity=Severity.MINOR), None)
    (minor,) = elites.pool()
    elites.add_failure(THERE, failure(Grade.PREVENTABLE), minor)
    (severe,) = elites.pool()
    assert severe.worth > minor.worth
    assert minor.credit == CREDIT * CANDIDATE * NEW_KIND
    elites.add_failure(HERE, failure(Grade.PREVENTABLE, severity=Severity.MINOR), severe)
    np.testing.assert_array_equal(elites.pool()[0].point, THERE)
    assert severe.credit == 0.0


def test_a_new_kind_earns_its_parent_four_times_what_a_new_variant_earns():
    elites = Elites()
    elites.add_failure(HERE, failure(Grade.UNAVOIDABLE), None)
    (parent,) = elites.pool()
    elites.add_failure(HERE, failure(Grade.UNAVOIDABLE, variant="alongside"), parent)
    assert parent.credit == CREDIT * NEW_VARIANT
    elites.add_failure(HERE, failure(Grade.UNAVOIDABLE, kind="leader"), parent)
    assert parent.credit == CREDIT * (NEW_VARIANT + NEW_KIND)
    assert NEW_KIND == 4 * NEW_VARIANT


def test_near_misses_stand_in_for_who_has_struck_nobody():
    elites = Elites()
    elites.add_misses(HERE, Encounter(encounters_s={"left": 3.0, "right": 2.0}))
    elites.add_misses(THERE, Encounter(encounters_s={"left": 1.0, "right": 5.0}))
    assert {e.target: e.point[0] for e in elites.pool()} == {"left": 0.75, "right": 0.25}
    elites.add_failure(HERE, failure(Grade.FULL_BRAKING, striker="left"), None)
    assert [e.kind for e in elites.pool()] == ["cut-in", "near miss of right"]


def test_a_requirement_is_aimed_at_once_it_is_nearly_violated_and_until_it_is():
    elites = Elites()
    elites.add_misses(HERE, Encounter(margins={"no_contact": 0.0, "on_carriageway": 0.9, "no_red_light_entry": 0.2}))
    elites.add_misses(THERE, Encounter(margins={"no_red_light_entry": 0.1}))
    assert {e.target: e.point[0] for e in elites.pool()} == {"no_red_light_entry": 0.75}
    elites.add_failure(HERE, violation(requirement="no_red_light_entry"), None)
    elites.add_failure(THERE, violation(requirement="on_carriageway", kind="off", robustness=-1.0), None)
    assert [e.kind for e in elites.pool()] == ["never_fast violated; straight", "off"]
    assert elites.pool()[0].worth < elites.pool()[1].worth


def found(seed: int, episodes: int, *, told: bool) -> int:
    """Kinds of failure found, all side by side in a cube's corner."""
    optimizer, kinds = ArchiveOptimizer(6, SceneOptimizerConfig(), seed), set()
    for _ in range(episodes):
        u = optimizer.ask()
        in_corner = (u[:2] < 0.3).all() and u[2] > 0.4
        kind = f"{int(10 * u[3])} {int(4 * u[4])}"
        hit = failure(Grade.PREVENTABLE, kind) if in_corner else None
        kinds |= {kind} if in_corner else set()
        optimizer.tell(u, 0.0, Encounter(collision=hit if told else None))
    return len(kinds)


@pytest.mark.parametrize("seed", range(3))
def test_it_finds_more_kinds_of_failure_than_chance(seed):
    assert found(seed, 300, told=True) > 1.5 * found(seed, 300, told=False)


def test_a_failure_that_a_rule_refuses_is_not_built_on():
    optimizer = ArchiveOptimizer(2, SceneOptimizerConfig(), 0)
    refused = failure(Grade.PREVENTABLE).model_copy(update={"verdicts": {"inside_limits": False}})
    for _ in range(INITIAL):
        optimizer.tell(optimizer.ask(), 0.0, Encounter(collision=refused))
    assert optimizer.state()["elites"]["failures"] == {}


DISCOUNT, WORTH, COST, LEAST = 0.9, 0.5, 5.0, 0.05


def bandit(*unit_costs: float) -> DiscountedBandit:
    return DiscountedBandit(
        discount=DISCOUNT, prior_worth=WORTH, prior_cost=COST, least=LEAST, unit_costs=unit_costs or (1.0, 1.0)
    )


def test_the_chance_follows_the_square_of_what_each_yielded_for_its_cost():
    subject = bandit(1.0, 4.0)
    subject.tell(0, 1.0, 10)
    subject.tell(1, 3.0, 10)
    subject.tell(1, 0.0, 10)
    first = (WORTH + 1.0) / (COST + 10)
    second = (WORTH + DISCOUNT * 3.0) / (COST + (DISCOUNT + 1) * 4 * 10)
    assert subject.probability == pytest.approx(second**2 / (first**2 + second**2))


@pytest.mark.parametrize("better", [0, 1])
def test_the_worse_arm_spends_the_least_share_of_all_costs(better):
    subject = bandit(1.0, 4.0)
    for _ in range(200):
        subject.tell(better, 1.0)
        subject.tell(1 - better, 0.0)
    spent = 1.0 - subject.probability, 4.0 * subject.probability
    assert spent[1 - better] / sum(spent) == pytest.approx(LEAST)


def test_it_continues_from_its_state():
    subject, other = bandit(), bandit()
    subject.tell(1, 1.0)
    other.load(subject.state())
    assert other.probability == subject.probability != 0.5
    other.tell(0, 2.0)  # the state is a copy
    assert other.probability != subject.probability


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), min_size=2, max_size=2), st.integers(0, 2**31))
def test_mutants_stay_in_the_unit_cube(corner, seed):
    mutant = mutated(np.full(5, corner[0]), np.full(5, corner[1]), np.random.default_rng(seed))
    assert mutant.min() >= 0
    assert mutant.max() <= 1
