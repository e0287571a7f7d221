"""`risk-sac campaigns`: campaigns of a running service, from a terminal or a CI job."""

import argparse

from risk_sac.cli.campaigns.failures import add_bundle_failure, add_list_failures, add_show_failure
from risk_sac.cli.campaigns.manage import add_cancel, add_delete, add_list, add_regress_campaign, add_report_campaign
from risk_sac.cli.campaigns.watch import add_results, add_submit, add_watch
from risk_sac.cli.console import COULD_NOT_RUN, Commands

COMMANDS = (
    add_submit,
    add_list,
    add_watch,
    add_results,
    add_report_campaign,
    add_regress_campaign,
    add_cancel,
    add_delete,
)
OF_FAILURES = (add_list_failures, add_show_failure, add_bundle_failure)
EPILOG = """exit status:
  0    fine
  1    the ECR of a family and method is not shown to be within --max-ecr, or its PCR within --max-pcr: the upper end of
       its 95 % interval lies above the bound; --judge-by rate compares the rate itself. Or it has found more distinct
       preventable failures than --max-preventable, or a kind that --no-new-failures does not know. Controls such as
       no-adversary count like any other method
  2    it could not run: the campaign failed, was cancelled or (with a bound) has not ended; the service refuses or
       does not answer; the time is up; an argument is wrong
  130  interrupted; the campaign goes on

environment:
  RISK_SAC_URL           of the service, where no --url is given (default: http://127.0.0.1:8000)
  RISK_SAC_API_KEY       the key, if the service asks for one
  RISK_SAC_API_KEY_FILE  a file that holds it

Results go to standard output, with --json as one JSON document; progress and errors go to standard error."""


def add_campaigns(commands: Commands) -> None:
    """Adds the group of commands."""
    group = commands.add_parser("campaigns", help="campaigns of a running service")
    campaigns = group.add_subparsers(required=True, metavar="COMMAND")
    for add in COMMANDS:
        add(campaigns)
    leaves = list(campaigns.choices.values())
    of_failures = campaigns.add_parser("failures", help="what a campaign found, one by one")
    failures = of_failures.add_subparsers(required=True, metavar="COMMAND")
    for add_one in OF_FAILURES:
        add_one(failures)
    leaves += failures.choices.values()
    for parser in (group, of_failures, *leaves):
        parser.epilog, parser.formatter_class = EPILOG, argparse.RawDescriptionHelpFormatter
    for parser in leaves:
        parser.set_defaults(on_error=COULD_NOT_RUN)
        parser.add_argument("--url", metavar="URL", help="of the service")
        parser.add_argument("--json", action="store_true", help="one JSON document instead of text and tables")
