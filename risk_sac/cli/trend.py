"""`risk-sac trend`: an ego over its versions, from folders of campaigns."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import OK, counted, or_dash, print_answer
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.report.trend import EndedCampaign, EndedRun, LeftOut, Trend, TrendRate, TrendRow, check_scenarios, trend
from risk_sac.run_folder.results import read_boundary_map, read_rates, read_verified, with_headline


def add(commands: Commands) -> None:
    """Adds the command."""
    parser = add_command(
        commands,
        "trend",
        _trend,
        "compare the versions of an ego over campaigns of the same scenarios",
        more="Campaigns with another budget, other methods or another behaviour are in a table of their own.",
        example="trend runs/v1.3 runs/v1.4 runs/v1.5",
    )
    folders = "folders of `risk-sac evaluate`, or of single runs, oldest version first"
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUNS", help=folders)
    add_json_flag(parser)


def _trend(options: argparse.Namespace) -> int:
    found = trend_of_folders(options.runs)
    print_answer(options, found, *_texts(found))
    return OK


def trend_of_folders(folders: Sequence[Path]) -> Trend:
    """Compares the versions of each ego by the campaigns in folders, oldest first.

    Raises:
      ConfigError: a folder has no run, or the campaigns are of different scenarios.
    """
    from risk_sac.report.files import campaign_in  # here, because loading numpy takes a while

    ended, left_out = [], []
    for folder in folders:
        spec, results = campaign_in([folder])
        runs = []
        for path, result in results.items():
            verified = read_verified(path, result.digest) if result.digest else None
            told = with_headline(result, verified) if verified else result
            runs.append(
                EndedRun(
                    family=told.spec.family,
                    method=told.spec.method,
                    iid=told.spec.iid,
                    phases=tuple(phase for phase in (told.metrics, told.evaluation) if phase is not None),
                    versions=told.versions or {},
                    boundary=read_boundary_map(path),
                    rates=read_rates(path),
                )
            )
        done = {result.spec.digest for result in results.values() if result.finished}
        if missing := [run.id for run in spec.runs() if run.digest not in done]:
            left_out.append(LeftOut(campaign_id=str(folder), reason=f"{missing[0]} is not finished"))
        else:
            ended.append(EndedCampaign(id=str(folder), spec=spec, runs=tuple(runs)))
    check_scenarios(ended)
    return trend(ended, left_out)


def _texts(found: Trend) -> Iterator[str | Table]:
    for row in found.rows:
        yield _heading(row)
        yield _table(row)
    for left in found.left_out:
        yield f"Left out: {left.campaign_id}: {left.reason}"


def _heading(row: TrendRow) -> str:
    parts = [
        f"{row.ego}: {', '.join(row.families)}",
        ", ".join(row.methods),
        counted(row.seeds, "seed"),
        counted(row.budget.episodes, "episode"),
        *([] if row.iid_episodes is None else [counted(row.iid_episodes, "fresh scene")]),
        row.behaviour,
    ]
    return "; ".join(parts) + (f"; differs in {', '.join(row.differs)}" if row.differs else "")


def _table(row: TrendRow) -> Table:
    table = Table(box=SIMPLE_HEAD, padding=0)
    table.add_column("version", overflow="fold")
    for name in ("head-\nline", "new", "gone", "re-\nturned"):
        table.add_column(name, no_wrap=True, justify="right")
    table.add_column("rate of failures, 95 %", overflow="fold")
    for before, point in zip((None, *row.points), row.points, strict=False):
        if before is not None and point.changed:
            changes = (f"{name} {before.software[name]} → {point.software[name]}" for name in point.changed)
            table.add_row(*[""] * 5, f"not comparable: {', '.join(changes)}")
        counts = ("-" if kinds is None else str(len(kinds)) for kinds in (point.new, point.gone, point.returned))
        rates = "\n".join(_rate(rate) for rate in point.rates if rate.requirement is None) or "-"
        named = escape(" ".join([point.version, *(f"({setting})" for setting in point.settings)]))
        table.add_row(named, "-" if point.headline is None else str(point.headline), *counts, rates)
    return table


def _rate(rate: TrendRate) -> str:
    value, low, high = (or_dash(figure, ".3f") for figure in (rate.rate, rate.low, rate.high))
    return f"{value} [{low}, {high}] {rate.family}, {rate.method.removeprefix('iid-')}"
