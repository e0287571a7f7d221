"""`risk-sac campaigns report`: the report of a campaign of a running service, as one file."""

import argparse
from pathlib import Path

from risk_sac.cli.console import OK, Commands, notes
from risk_sac.cli.report import format_of
from risk_sac.client import Client
from risk_sac.run_folder.durable import replace_file


def add_report_campaign(campaigns: Commands) -> None:
    """Adds the command."""
    parser = campaigns.add_parser("report", help="one file on what a campaign found, with bounds, coverage and limits")
    parser.set_defaults(command=_report)
    parser.add_argument("id", metavar="ID", help="of the campaign")
    parser.add_argument("--regression", metavar="ID", help="of a regression of it, to be told of in the report")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="report.html, report.md, or its data as report.json"
    )


def _report(options: argparse.Namespace) -> int:
    format_ = format_of(options.out)
    with Client.from_environment(options.url) as client:
        content = client.report(options.id, format_, options.regression)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    replace_file(options.out, content.encode())
    notes.print(f"Report: {options.out}", markup=False, soft_wrap=True)
    return OK
