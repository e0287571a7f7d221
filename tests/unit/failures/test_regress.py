from xml.etree import ElementTree as ET

import pytest

from risk_sac.cli.regress import junit
from risk_sac.config import EgoConfig
from risk_sac.failures.cases import Case, Regression, Verdict
from risk_sac.records import Grade


def case(verdict: Verdict, name: str = "a", *, found: str = "", known: bool = False) -> Case:
    return Case(
        id="same",
        digest=name,
        name=f"cut-in {name}",
        grade=Grade.CAREFUL,
        verdict=verdict,
        reason="why \x01",
        found=found,
        known=known,
    )


def regression(*cases: Case) -> Regression:
    return Regression(ego=EgoConfig(), cases=cases)


@pytest.mark.parametrize("verdict", Verdict)
def test_only_what_is_fixed_or_known_passes(verdict: Verdict) -> None:
    assert regression(case(Verdict.FIXED), case(verdict)).passed == (verdict is Verdict.FIXED)
    assert regression(case(Verdict.FIXED), case(verdict, known=True)).passed


def test_a_baseline_makes_the_same_verdict_of_the_same_failure_known_and_no_other() -> None:
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
    assert not now.beside(before).passed
    assert now.beside(now).passed


def test_junit_has_a_case_for_each_failure() -> None:
    cases = [case(verdict, verdict) for verdict in Verdict]
    report = ET.fromstring(junit(regression(*cases, case(Verdict.FLAKY, "old", known=True))))
    results = {str(each.get("classname")).removeprefix("cut-in "): each for each in report.iter("testcase")}
    assert all(each.get("name") == "same" for each in results.values())
    failed = {name for name, each in results.items() if each.find("failure") is not None}
    wrong = {name for name, each in results.items() if each.find("error") is not None}
    skipped = {name for name, each in results.items() if each.find("skipped") is not None}
    assert failed == {"still_failing", "new_kind"}
    assert wrong == {"flaky", "not_comparable"}
    assert skipped == {"old"}
    assert report.find("testsuite").get("tests") == "6"
