"""`risk-sac report`, `coverage`, `grid` and `trend`, of finished runs."""

import argparse
import json
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Column, Table

from risk_sac.cli.console import FAILED, OK, counted, or_dash, print_answer, write_out
from risk_sac.cli.flags import assignment
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.cli.regress import read_baseline
from risk_sac.config.base import read_text
from risk_sac.errors import ConfigError
from risk_sac.host.terminal import complain, console, notes
from risk_sac.records.assessment import CellState
from risk_sac.report.grid import STANDARDS, PlayedGrid, StandardVerdict, grid_csv, grid_junit, played_grids, varied_axes
from risk_sac.report.trend import EndedCampaign, EndedRun, LeftOut, Trend, TrendRate, TrendRow, check_scenarios, trend
from risk_sac.run_folder.results import read_boundary_map, read_rates, read_verified, with_headline

if TYPE_CHECKING:
    from risk_sac.report.document import CampaignFacts
    from risk_sac.report.files import Inputs
    from risk_sac.report.runs import FinishedRun


Format = Literal["html", "md", "json"]
OUT = "report.html, report.md, or its data as report.json"
REPORT_FORMATS: dict[str, Format] = {".html": "html", ".md": "md", ".json": "json"}
SCHEMA = ".schema.json"
VERIFY = "verify"
NAMED_CHANGES = 3


def add_report(commands: Commands) -> None:
    """Adds the command."""
    parser = add_command(
        commands,
        "report",
        _report,
        "write one file on what runs found, with test cases, bounds, coverage and limits",
        more="`report verify FILE RUNS` forms the digest of a report's inputs again and names what changed; without "
        "RUNS they lie beside the file.",
        example="report runs/compared --out report.html",
    )
    parser.add_argument(
        "runs", type=Path, nargs="+", metavar="RUNS", help="folder of `risk-sac evaluate`, or folders of runs"
    )
    regression = "failures against another ego, by `risk-sac regress --out`"
    output = parser.group("output")
    output.add_argument("--regression", type=Path, metavar="FILE.json", help=regression)
    schema = f"; the data's JSON schema if the name ends in {SCHEMA}"
    output.add_argument("--out", type=Path, metavar="FILE", help=OUT + schema)
    coverage = add_command(
        commands,
        "coverage",
        _coverage,
        "count what one campaign, or several together, have covered",
        more="A cell is a value of the ODD, a functional scenario, a requirement, a rule, a bin of a parameter or a "
        "body; --out has the campaigns behind each.",
        example="coverage runs/before runs/after --out coverage.json",
    )
    coverage.add_argument("campaigns", type=Path, nargs="+", metavar="FOLDER", help="folder of `risk-sac evaluate`")
    coverage.group("output").add_argument("--out", type=Path, metavar="FILE.json", help="write the whole matrix there")


def _report(options: argparse.Namespace) -> int:
    # Here, because loading numpy takes a while.
    from risk_sac.report.document import CARD_TIMES, CampaignEvidence, Origin, gathered, report_page, show_command
    from risk_sac.report.files import read_folders

    if options.runs[0].name == VERIFY and options.out is None:  # paths are absolute
        return _verify(options.runs[1:], options.regression)
    if options.out is None:
        raise ConfigError("--out", "nothing", OUT)
    if options.out.name.endswith(SCHEMA):
        schema = json.dumps(CampaignEvidence.model_json_schema(mode="serialization"), indent=2)
        write_out(options.out, f"{schema}\n".encode(), "Schema")
        return OK
    format_ = format_of(options.out)
    inputs = read_folders(options.runs)
    facts = _facts(inputs, options.runs, options.regression)
    evidence = gathered(inputs.comparison, facts)
    if format_ == "json":
        content = evidence.model_dump_json(indent=2) + "\n"
    else:
        runs = list(map(str, options.runs))

        def episodes(run: "FinishedRun") -> str:
            return shlex.quote(str(inputs.folders[run.spec.digest] / "episodes.jsonl"))

        origin = Origin(
            report=options.typed,
            data=shlex.join(["risk-sac", "report", *runs, "--out", "report.json"]),
            show=lambda run, failure: show_command(inputs.folders[run.spec.digest], failure),
            regress=_regress_command(inputs),
            verify=shlex.join(["risk-sac", "report", VERIFY, str(options.out), *runs]),
            recount=lambda run: f"jq -r .outcome {episodes(run)} | sort | uniq -c",
            record=lambda run, record: f"jq 'select(.index == {record.index}) | ., ({CARD_TIMES})' {episodes(run)}",
            folders=inputs.folders,
            regression=facts.regression,
        )
        layout: Literal["html", "markdown"] = "html" if format_ == "html" else "markdown"
        content = report_page(inputs.comparison, evidence, origin, evidence.power, layout)
    write_out(options.out, content.encode(), "Report")
    return OK


def _coverage(options: argparse.Namespace) -> int:
    from risk_sac.report.files import read_folders
    from risk_sac.report.matrix import coverage_matrix, merged

    matrix = merged([coverage_matrix(read_folders([campaign]).comparison) for campaign in options.campaigns])
    if options.out is not None:
        write_out(options.out, matrix.model_dump_json(indent=2).encode() + b"\n", "Coverage")
        return OK
    table = Table("coverage", *(Column(state, justify="right") for state in CellState))
    for group in matrix.groups:
        states = [cell.state for row in group.rows for cell in row.cells]
        table.add_row(group.title, *(str(states.count(state)) for state in CellState))
    console.print(table)
    return OK


def format_of(file: Path) -> Format:
    """Returns the format of a report by the name of its file."""
    if file.suffix not in REPORT_FORMATS:
        raise ConfigError("--out", f"{file.name!r}", f"a name that ends in {', '.join(REPORT_FORMATS)}")
    return REPORT_FORMATS[file.suffix]


def _facts(inputs: "Inputs", runs: Sequence[Path], regression: Path | None) -> "CampaignFacts":
    from risk_sac.env.problem import requirements_of
    from risk_sac.failures.bundle import code_digest
    from risk_sac.report.document import CampaignFacts
    from risk_sac.report.files import run_folders

    return CampaignFacts(
        folders=run_folders(runs),
        requirements=requirements_of(inputs.comparison.spec),
        code=code_digest(),
        regression=read_baseline(regression, "--regression") if regression else None,
    )


def _verify(words: Sequence[Path], regression: Path | None) -> int:
    from risk_sac.failures.bundle import code_digest
    from risk_sac.report.files import SPEC, campaign_in, changes, input_digests, inputs_in, run_folders, signed

    file = next(iter(words), None)
    if file is None:
        raise ConfigError("REPORT", "nothing", "the file of a report, or its folder")
    if file.is_dir():
        file = next((path for suffix in REPORT_FORMATS if (path := file / f"report{suffix}").is_file()), file)
    runs = list(words[1:]) or [file.parent]
    if len(words) == 1 and not (file.parent / SPEC).is_file():
        raise ConfigError("RUNS", f"no runs beside {file}", "the folders that the report was made from, after it")
    report = inputs_in(read_text(file, "REPORT"))
    campaign, _ = campaign_in(runs)
    played = read_baseline(regression, "--regression").model_dump_json() if regression else ""
    now = signed(input_digests(campaign, run_folders(runs), code=code_digest(), regression=played))
    if changed := changes(report, now):
        more = f", and {len(changed) - NAMED_CHANGES} more" if len(changed) > NAMED_CHANGES else ""
        complain(f"{file}: not as it was made: {', '.join(changed[:NAMED_CHANGES])}{more}")
        return FAILED
    console.print(
        f"{file}: digest {report.digest} of {counted(len(report.inputs), 'input')}, all as they were", soft_wrap=True
    )
    return OK


def _regress_command(inputs: "Inputs") -> str:
    runs = [str(inputs.folders[run.spec.digest]) for run in inputs.comparison.runs]
    return shlex.join(["risk-sac", "regress", "--failures", *runs, "--ego", "EGO", "--out", "cases.json"])


def add_grid(commands: Commands) -> None:
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
        from risk_sac.report.parameter_plots import grid_png

        over = (options.over[0], options.over[1]) if options.over else varied_axes(grids)
        content = grid_png(grids, over, dict(map(assignment, options.at)))
        write_out(options.picture, content, "Picture", notes)
    print_answer(options, list(grids), _grid_table(grids))
    return OK


def _grid_table(grids: Sequence[PlayedGrid]) -> Table:
    names = ("ego", "scenes", *(verdict.value.replace("_", "\n") for verdict in StandardVerdict))
    columns = [Column("run", overflow="fold"), *(Column(name, no_wrap=True) for name in names)]
    table = Table(*columns, box=SIMPLE_HEAD, padding=0)
    for grid in grids:
        table.add_row(grid.spec.id, grid.ego, str(len(grid.points)), *map(str, grid.counts.values()))
    return table


def add_trend(commands: Commands) -> None:
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
    """Compares each ego's versions by campaigns in folders, oldest first.

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
        yield _trend_table(row)
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


def _trend_table(row: TrendRow) -> Table:
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
        rates = "\n".join(_trend_rate(rate) for rate in point.rates if rate.requirement is None) or "-"
        named = escape(" ".join([point.version, *(f"({setting})" for setting in point.settings)]))
        table.add_row(named, "-" if point.headline is None else str(point.headline), *counts, rates)
    return table


def _trend_rate(rate: TrendRate) -> str:
    value, low, high = (or_dash(figure, ".3f") for figure in (rate.rate, rate.low, rate.high))
    return f"{value} [{low}, {high}] {rate.family}, {rate.method.removeprefix('iid-')}"
