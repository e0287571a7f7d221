"""`risk-sac grid`: the standard's verdict on each scene of runs that play a scenario as it is written."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.table import Table

from risk_sac.cli.console import OK, print_answer, write_out
from risk_sac.cli.flags import assignment
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.host.terminal import notes
from risk_sac.report.grid import STANDARDS, PlayedGrid, StandardVerdict, grid_csv, grid_junit, played_grids, varied_axes


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
        from risk_sac.report.parameter_plots import grid_png  # here, because loading matplotlib takes a second

        over = (options.over[0], options.over[1]) if options.over else varied_axes(grids)
        content = grid_png(grids, over, dict(map(assignment, options.at)))
        write_out(options.picture, content, "Picture", notes)
    print_answer(options, list(grids), _table(grids))
    return OK


def _table(grids: Sequence[PlayedGrid]) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=0)
    table.add_column("run", overflow="fold")
    for name in ("ego", "scenes", *(verdict.value.replace("_", "\n") for verdict in StandardVerdict)):
        table.add_column(name, no_wrap=True)
    for grid in grids:
        counts = (str(count) for count in grid.counts.values())
        table.add_row(grid.spec.id, grid.ego, str(len(grid.points)), *counts)
    return table
