"""`risk-sac report`: writes findings, rates and coverage of runs into one file."""

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from risk_sac.cli.console import OK, write_out
from risk_sac.cli.parser import Commands, add_command
from risk_sac.cli.regress import read_baseline
from risk_sac.errors import ConfigError

if TYPE_CHECKING:
    from risk_sac.report.inputs import Inputs

Format = Literal["html", "md", "json"]
OUT = "report.html, report.md, or its data as report.json"
FORMATS: dict[str, Format] = {".html": "html", ".md": "md", ".json": "json"}


def add(commands: Commands) -> None:
    """Adds the command."""
    parser = add_command(
        commands,
        "report",
        _report,
        "write one file on what runs found, with bounds, coverage and limits",
        example="report runs/compared --out report.html",
    )
    parser.add_argument(
        "runs", type=Path, nargs="+", metavar="RUNS", help="folder of `risk-sac evaluate`, or folders of runs"
    )
    regression = "failures against another ego, by `risk-sac regress --out`"
    output = parser.group("output")
    output.add_argument("--regression", type=Path, metavar="FILE.json", help=regression)
    output.add_argument("--out", type=Path, required=True, metavar="FILE", help=OUT)


def _report(options: argparse.Namespace) -> int:
    # Here, because loading numpy takes a while.
    from risk_sac.benchmark.power import played_by, power_of
    from risk_sac.report.document import Origin, report_page, show_command
    from risk_sac.report.evidence import gathered
    from risk_sac.report.inputs import read_folders

    format_ = format_of(options.out)
    regression = read_baseline(options.regression, "--regression") if options.regression else None
    inputs = read_folders(options.runs)
    evidence = gathered(inputs.comparison)
    origin = Origin(
        report=options.typed,
        data=shlex.join(["risk-sac", "report", *map(str, options.runs), "--out", "report.json"]),
        show=lambda run, failure: show_command(inputs.folders[run.spec.digest], failure),
        regress=_regress(inputs),
        folders=inputs.folders,
        regression=regression,
    )
    if format_ == "json":
        content = evidence.model_dump_json(indent=2) + "\n"
    else:
        power = power_of(inputs.comparison.spec, played_by(inputs.comparison.runs))
        content = report_page(inputs.comparison, evidence, origin, power, "html" if format_ == "html" else "markdown")
    write_out(options.out, content.encode(), "Report")
    return OK


def format_of(file: Path) -> Format:
    """Returns the format of a report by the name of its file."""
    if file.suffix not in FORMATS:
        raise ConfigError("--out", f"{file.name!r}", f"a name that ends in {', '.join(FORMATS)}")
    return FORMATS[file.suffix]


def _regress(inputs: "Inputs") -> str:
    """Returns the command that plays the failures of all finished searches."""
    runs = [str(inputs.folders[run.spec.digest]) for run in inputs.comparison.runs]
    return shlex.join(["risk-sac", "regress", "--failures", *runs, "--ego", "EGO", "--out", "cases.json"])
