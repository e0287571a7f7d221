"""`risk-sac campaigns regress`: a campaign's failures against another ego, played by the service."""

import argparse
import time
from pathlib import Path

from risk_sac.cli.campaigns.output import print_answer
from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, OK, Commands, complain
from risk_sac.cli.regress import cases_table
from risk_sac.cli.regress_junit import junit
from risk_sac.cli.text import EGO
from risk_sac.client import Client
from risk_sac.config.spec_file import read_ego
from risk_sac.failures.cases import Regression
from risk_sac.run_folder.durable import replace_file

POLL_S = 0.5


def add_regress_campaign(campaigns: Commands) -> None:
    """Adds the command."""
    parser = campaigns.add_parser("regress", help="play a campaign's distinct failures against another ego")
    parser.set_defaults(command=_regress)
    parser.add_argument("id", metavar="ID", help="of the campaign, which has ended")
    parser.add_argument("--ego", required=True, metavar="EGO", help=EGO)
    parser.add_argument("--junit", type=Path, metavar="FILE.xml", help="report for CI: a case per failure, named")


def _regress(options: argparse.Namespace) -> int:
    ego = read_ego(options.ego)
    with Client.from_environment(options.url) as client:
        regression = client.regress(options.id, ego)
        while regression.state in ("queued", "running"):
            time.sleep(POLL_S)
            regression = client.regression(regression.id)
    if regression.state != "succeeded":
        complain(f"{regression.id} {regression.state}: {regression.reason}")
        return COULD_NOT_RUN
    found = Regression(ego=regression.ego, cases=regression.cases)
    if options.junit is not None:
        options.junit.parent.mkdir(parents=True, exist_ok=True)
        replace_file(options.junit, junit(found))
    print_answer(options, regression, cases_table(found))
    return OK if found.passed else ABOVE
