"""A regression as JUnit XML: a case for each old failure, named. Pure."""

from junitparser import Error, Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite

from risk_sac.cli.text import printable
from risk_sac.failures.cases import Case, Regression, Verdict

FAILS = (Verdict.STILL_FAILING, Verdict.NEW_KIND)


def junit(regression: Regression) -> bytes:
    """The report: fixed passes, known is skipped; what is flaky or cannot be compared is an error."""
    suite = TestSuite("regression")
    suite.add_property("ego", regression.ego.model_dump_json())
    suite.add_testcases([_case(case) for case in regression.cases])
    report = JUnitXml("risk-sac regress")
    report.add_testsuite(suite)
    report.update_statistics()
    text: bytes = report.tostring()
    return text


def _case(case: Case) -> TestCase:
    found = TestCase(printable(case.id), printable(case.name))
    if case.grade is not None:
        found.add_property("grade", case.grade)
    said = printable(f"{case.verdict.replace('_', ' ')}: {case.reason}")
    if case.verdict is Verdict.FIXED:
        found.system_out = said
    elif case.known:
        found.append(Skipped(f"known; {said}"))
    else:
        found.append((Failure if case.verdict in FAILS else Error)(said, case.verdict))
    return found
