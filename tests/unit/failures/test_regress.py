import pytest

from risk_sac.config import EgoConfig
from risk_sac.failures.regress import compared
from risk_sac.failures.studied import Case, Regression, Verdict
from risk_sac.records import Grade
from tests.builders import collision, judgement, violation


def case(verdict: Verdict, name: str = "a", *, found: str = "", known: bool = False) -> Case:
    return Case(
        id="same",
        digest=name,
        name=f"cut-in {name}",
        grade=Grade.PREVENTABLE,
        verdict=verdict,
        reason="why \x01",
        found=found,
        known=known,
    )


def regression(*cases: Case) -> Regression:
    return Regression(ego=EgoConfig(), cases=cases)


@pytest.mark.parametrize("verdict", Verdict)
def test_only_what_is_fixed_or_known_passes(verdict):
    assert regression(case(Verdict.FIXED), case(verdict)).passed == (verdict is Verdict.FIXED)
    assert regression(case(Verdict.FIXED), case(verdict, known=True)).passed


def test_a_baseline_makes_the_same_verdict_of_the_same_failure_known_and_no_other():
    now = regression(
        case(Verdict.STILL_FAILING),
        case(Verdict.NEW_KIND, "b", found="leader"),
        case(Verdict.STILL_FAILING, "c"),
        case(Verdict.NEW_KIND, "d", found="pedestrian"),
    )
    before = regression(
        case(Verdict.STILL_FAILING), case(Verdict.STILL_FAILING, "b"), case(Verdict.NEW_KIND, "d", found="leader")
    )
    assert [each.known for each in now.beside(before).cases] == [True, False, False, False]
    assert [each.reason.partition("; ")[2] for each in now.beside(before).cases] == [
        "",
        "in the baseline it is still failing",
        "the baseline does not have it",
        "the baseline has another failure instead",
    ]
    assert not now.beside(before).passed
    assert now.beside(now).passed


HIT = collision(other_id="lead", judgement=judgement(kind="cut-in"))
ARTEFACT = violation(requirement="gentle", verdicts={"no_teleport": False})


@pytest.mark.parametrize(
    ("found", "verdict", "reason"),
    [
        ([], Verdict.FIXED, "never_fast is kept"),
        ([violation(other_id="another")], Verdict.STILL_FAILING, "violates never_fast after 1.5 s, at 9.0 m/s"),
        ([HIT, violation()], Verdict.STILL_FAILING, "violates never_fast after 1.5 s, at 9.0 m/s"),
        ([HIT], Verdict.NEW_KIND, "touches lead at a closing speed of 7.0 m/s: cut-in"),
        ([violation(requirement="gentle")], Verdict.NEW_KIND, "violates gentle after 1.5 s, at 9.0 m/s: "),
        ([ARTEFACT], Verdict.NOT_COMPARABLE, "which is not its failure: no_teleport"),
    ],
)
def test_a_violation_without_contact_is_compared_by_its_requirement(found, verdict, reason):
    ending = compared(found, [violation(other_id="lead")])
    assert ending.verdict is verdict
    assert reason in ending.reason


def test_every_requirement_that_a_failure_violated_has_to_be_kept():
    other = HIT.model_copy(update={"other_id": "left"})
    assert compared([violation()], [HIT, violation()]).verdict is Verdict.STILL_FAILING
    assert compared([HIT], [HIT, violation()]).found == "cut-in"
    assert compared([other], [HIT, violation()]).verdict is Verdict.NEW_KIND
    assert compared([], [HIT, violation()]).reason == "nothing is touched and never_fast is kept"
