"""`risk-sac grid`: the standard's verdict on each scene of runs that play a scenario as it is written."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from junitparser import Failure, Skipped
from junitparser.xunit2 import JUnitXml, TestCase, TestSuite
from rich.box import SIMPLE_HEAD
from rich.table import Table

from risk_sac.cli.console import OK, print_answer, write_out
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import notes, printable
from risk_sac.report.grid import STANDARDS, PlayedGrid, PlayedPoint, StandardVerdict, grid_csv, played_grids

SAID = {
    StandardVerdict.OUT_OF_SCOPE: "out of scope: the competent driver does not avoid the contact either",
    StandardVerdict.REFUSED: "refused",
    StandardVerdict.UNJUDGED: "unjudged",
}


def add(commands: Commands) -> None:
    """Adds the command."""
    grid = add_command(
        commands,
        "grid",
        _grid,
        "judge each scene of a story-sweep by UN R157's competent driver",
        more="Takes runs of story-sweep, story-random and story-bo, also while they go on.",
        example="grid runs/sweep --csv points.csv --picture points.png --over speed gap",
    )
    grid.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="folder of a run or campaign")
    standard = "whose avoidance makes a contact the ego's failure: UN R157's driver, the FSM, or either (default: r157)"
    grid.add_argument("--standard", choices=STANDARDS, default="r157", help=standard)
    output = grid.group("output")
    output.add_argument("--csv", type=Path, metavar="FILE.csv", help="write a row for each scene")
    output.add_argument("--junit", type=Path, metavar="FILE.xml", help="report for CI: a case for each scene")
    output.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the scenes over two parameters")
    output.add_argument("--over", nargs=2, metavar=("A", "B"), help="the two parameters (default: the first two)")
    at = "draw only scenes with this value of another parameter"
    output.add_argument("--at", nargs="+", default=[], metavar="NAME=VALUE", help=at)
    add_json_flag(grid)


def _grid(options: argparse.Namespace) -> int:
    grids = played_grids(options.runs, options.standard)
    if options.csv is not None:
        write_out(options.csv, grid_csv(grids).encode(), "Table", notes)
    if options.junit is not None:
        write_out(options.junit, grid_junit(grids), "JUnit report", notes)
    if options.picture is not None:
        from risk_sac.report.grid_picture import grid_png  # here, because loading matplotlib takes a second

        content = grid_png(grids, _over(options.over, grids), dict(map(_fixed, options.at)))
        write_out(options.picture, content, "Picture", notes)
    print_answer(options, list(grids), _table(grids))
    return OK


def _over(named: Sequence[str] | None, grids: Sequence[PlayedGrid]) -> tuple[str, str]:
    """The parameters of the picture's axes: those named, or the first two of which scenes have several values."""
    if named is not None:
        return named[0], named[1]
    varied = _varied([point for grid in grids for point in grid.points])
    if len(varied) < 2:
        raise ConfigError("--over", f"{len(varied)} parameters that vary", "two, for a picture")
    return varied[0], varied[1]


def _varied(points: Sequence[PlayedPoint]) -> list[str]:
    """Parameters of which the scenes have several values."""
    names = points[0].values if points else ()
    return [name for name in names if len({point.values.get(name) for point in points}) > 1]


def _fixed(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ConfigError("--at", repr(text), "NAME=VALUE")
    return name, value


def _table(grids: Sequence[PlayedGrid]) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=0)
    table.add_column("run", overflow="fold")
    for name in ("ego", "scenes", *(verdict.value.replace("_", "\n") for verdict in StandardVerdict)):
        table.add_column(name, no_wrap=True)
    for grid in grids:
        counts = (str(count) for count in grid.counts.values())
        table.add_row(grid.spec.id, grid.ego, str(len(grid.points)), *counts)
    return table


def grid_junit(grids: Sequence[PlayedGrid]) -> bytes:
    """Writes a suite for each run and a case for each scene.

    Cases are grouped by the value of the first parameter that varies.
    """
    report = JUnitXml("risk-sac grid")
    for grid in grids:
        suite = TestSuite(printable(f"{grid.spec.family}.{grid.ego}"))
        for name, value in (("run", grid.spec.id), ("ego", grid.ego), ("standard", grid.standard)):
            suite.add_property(name, printable(value))
        varied = [
            n for n in (grid.points[0].values if grid.points else ()) if len({p.values[n] for p in grid.points}) > 1
        ]
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
