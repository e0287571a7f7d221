import pytest

from risk_sac.failures.variants import alike
from risk_sac.records import Collision, ConflictType, Violation
from tests.builders import collision, judgement, violation

HIT = collision(other_id="lead", judgement=judgement())
BY_LEAD = violation(other_id="lead", other_role="adversary")


@pytest.mark.parametrize(
    ("wanted", "found"), [(HIT, HIT), (BY_LEAD, BY_LEAD), (BY_LEAD, violation()), (violation(), BY_LEAD)]
)
def test_these_are_alike(wanted: Collision | Violation, found: Collision | Violation) -> None:
    assert alike([violation(requirement="gentle"), found], wanted) is found


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        (HIT, BY_LEAD),
        (HIT, collision(other_id="left", judgement=judgement())),
        (HIT, collision(other_id="lead", judgement=judgement(conflict_type=ConflictType.LEADER))),
        (HIT, collision(other_id="lead", judgement=None)),
        (BY_LEAD, HIT),
        (BY_LEAD, violation(requirement="gentle", other_id="lead")),
        (BY_LEAD, BY_LEAD.model_copy(update={"verdicts": {"no_teleport": False}})),
    ],
)
def test_these_are_not(wanted: Collision | Violation, found: Collision | Violation) -> None:
    assert alike([found], wanted) is None
