"""`risk-sac campaigns`: campaigns of a running service, from a terminal or a CI job."""

import argparse
import itertools
import time
from pathlib import Path

from risk_sac.cli.campaigns import failures, watch
from risk_sac.cli.campaigns.output import (
    add_campaign_command,
    add_newest_command,
    campaigns_table,
    chosen_id,
    line,
)
from risk_sac.cli.campaigns.watch import shown
from risk_sac.cli.console import ABOVE, COULD_NOT_RUN, EGO, OK, print_answer, write_out
from risk_sac.cli.flags import add_limit, named_ego
from risk_sac.cli.parser import Commands, add_command, add_group, add_json_flag
from risk_sac.cli.regress import cases_table, junit
from risk_sac.cli.report import OUT, format_of
from risk_sac.client import Client
from risk_sac.failures.cases import Regression
from risk_sac.host.terminal import complain, notes
from risk_sac.records import State

POLL_S = 0.5
FILTERS = ("state", "family", "method", "label", "tag")


def add_management(commands: Commands) -> None:
    """Adds the commands."""
    parser = add_command(
        commands, "list", _list, "list campaigns, newest first", example="campaigns list --state running"
    )
    for name in FILTERS:
        shown = name.replace("family", "scenario")
        parser.group("choice of campaigns").add_argument(
            f"--{shown}", dest=name, metavar=shown.upper(), help=f"only this {shown}"
        )
    add_limit(parser)

    parser = add_campaign_command(
        commands, "cancel", _cancel, "stop a campaign and keep what it found", example="campaigns cancel ID --wait"
    )
    parser.group("waiting").add_argument("--wait", action="store_true", help="return once it has ended")

    add_campaign_command(
        commands,
        "delete",
        _delete,
        "delete a campaign that has ended, with all it found",
        example="campaigns delete ID",
    )

    parser = add_newest_command(
        commands,
        "report",
        _report,
        "write one file on what a campaign found, with bounds, coverage and limits",
        example="campaigns report --out report.html",
    )
    output = parser.group("output")
    output.add_argument("--regression", metavar="ID", help="add the outcome of this regression")
    output.add_argument("--out", type=Path, required=True, metavar="FILE", help=OUT)

    parser = add_campaign_command(
        commands,
        "regress",
        _regress,
        "play the distinct failures of an ended campaign against another ego",
        example="campaigns regress ID --ego careful --junit regress.xml",
    )
    parser.group("cases").add_argument("--ego", required=True, metavar="EGO", help=EGO)
    junit_help = "report for CI: a case per failure"
    parser.group("output").add_argument("--junit", type=Path, metavar="FILE.xml", help=junit_help)


def _list(options: argparse.Namespace) -> int:
    filters = {name: getattr(options, name) for name in FILTERS}
    with Client.from_environment(options.url) as client:
        found = list(itertools.islice(client.campaigns(**filters), options.limit))
    print_answer(options, found, campaigns_table(found))
    return OK


def _cancel(options: argparse.Namespace) -> int:
    with Client.from_environment(options.url) as client:
        campaign = client.cancel(options.id)
        if options.wait:
            with shown() as show:
                campaign = client.wait(options.id, show)
    print_answer(options, campaign, line(campaign))
    return OK


def _delete(options: argparse.Namespace) -> int:
    with Client.from_environment(options.url) as client:
        client.delete(options.id)
    print_answer(options, {"id": options.id, "deleted": True}, f"{options.id} deleted")
    return OK


def _report(options: argparse.Namespace) -> int:
    format_ = format_of(options.out)
    with Client.from_environment(options.url) as client:
        content = client.report(chosen_id(client, options), format_, options.regression)
    write_out(options.out, content.encode(), "Report", notes)
    return OK


def _regress(options: argparse.Namespace) -> int:
    ego = named_ego(options.ego)
    with Client.from_environment(options.url) as client:
        regression = client.regress(options.id, ego)
        while not regression.state.final:
            time.sleep(POLL_S)
            regression = client.regression(regression.id)
    if regression.state is not State.SUCCEEDED:
        complain(f"{regression.id} {regression.state}: {regression.reason}")
        return COULD_NOT_RUN
    record = Regression(ego=regression.ego, cases=regression.cases)
    if options.junit is not None:
        write_out(options.junit, junit(record))
    print_answer(options, regression, cases_table(record))
    return OK if record.passed else ABOVE


EPILOG = """exit status:
  0    fine
  1    a bound is broken: the upper end of the 95 % interval of a rate is above
       --max-ecr, --max-pcr or --max-rate (with --judge-by rate: the rate), or
       there are more distinct preventable failures than --max-preventable, or a
       kind that --no-new-failures does not know; controls such as no-adversary
       count like any other method
  2    it could not run: the campaign failed, was cancelled or (with a bound)
       has not ended; the service refuses or does not answer; the time is up; an
       argument is wrong
  130  interrupted; the campaign goes on

environment:
  RISK_SAC_URL           address of the service, where no --url is given
                         (default: http://127.0.0.1:8000)
  RISK_SAC_API_KEY       the key, if the service asks for one
  RISK_SAC_API_KEY_FILE  a file that holds it

Results go to standard output; progress and errors go to standard error."""


def add(commands: Commands) -> None:
    """Adds the group of commands."""
    group = add_group(
        commands,
        "campaigns",
        "submit, follow and read campaigns of a running service",
        example="campaigns submit --scenario low --watch --max-pcr 0.1",
        epilog=EPILOG,
    )
    campaigns = group.add_subparsers(required=True, metavar="COMMAND")
    watch.add(campaigns)
    add_management(campaigns)
    leaves = list(campaigns.choices.values())
    of_failures = add_group(
        campaigns, "failures", "list, draw and fetch the failures of a campaign", example="campaigns failures list"
    )
    each = of_failures.add_subparsers(required=True, metavar="COMMAND")
    failures.add(each)
    for parser in (*leaves, *each.choices.values()):
        parser.set_defaults(on_error=COULD_NOT_RUN)
        parser.group("service").add_argument("--url", metavar="URL", help="address of the service")
        add_json_flag(parser)
