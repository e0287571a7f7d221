"""JUnit report of played grids."""

from collections.abc import Sequence

from junitparser import Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite

from risk_sac.host.terminal import printable
from risk_sac.report.grid import PlayedGrid, PlayedPoint, StandardVerdict, varied_of

SAID = {
    StandardVerdict.OUT_OF_SCOPE: "out of scope: the competent driver does not avoid the contact either",
    StandardVerdict.REFUSED: "refused",
    StandardVerdict.UNJUDGED: "unjudged",
}


def grid_junit(grids: Sequence[PlayedGrid]) -> bytes:
    """Writes a suite for each run and a case for each scene.

    Cases are grouped by the value of the first parameter that varies.
    """
    report = JUnitXml("risk-sac grid")
    for grid in grids:
        suite = TestSuite(printable(f"{grid.spec.family}.{grid.ego}"))
        for name, value in (("run", grid.spec.id), ("ego", grid.ego), ("standard", grid.standard)):
            suite.add_property(name, printable(value))
        varied = varied_of(grid.points)
        suite.add_testcases([_case(grid, point, varied) for point in grid.points])
        report.add_testsuite(suite)
    report.update_statistics()
    content: bytes = report.tostring()
    return content


def _case(grid: PlayedGrid, point: PlayedPoint, varied: Sequence[str]) -> TestCase:
    told = [f"{name}={_text(point.values[name])}" for name in varied]
    group = ".".join([grid.spec.family, grid.ego, *told[:1]])
    case = TestCase(printable(", ".join(told[1:]) or point.id), printable(group))
    case.add_property("episode", point.id)
    for name in ("r157", "fsm"):
        avoids = getattr(point, name)
        if avoids is not None:
            case.add_property(f"avoided by {name}", "yes" if avoids else "no")
    if point.verdict is StandardVerdict.FAIL:
        case.append(Failure(printable(point.kind), point.grade))
    elif point.verdict is not StandardVerdict.PASS:
        said = SAID[point.verdict] + (f": {point.reason}" if point.reason else "")
        case.append(Skipped(printable(said)))
    return case


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
