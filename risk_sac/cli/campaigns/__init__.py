"""`risk-sac campaigns`: campaigns of a running service, from a terminal or a CI job."""

import argparse

from risk_sac.cli.campaigns import failures, manage, watch
from risk_sac.cli.console import COULD_NOT_RUN, Commands

EPILOG = """exit status:
  0    fine
  1    the ECR of a family and method is not shown to be within --max-ecr, its PCR within --max-pcr, or the rate of a
       requirement within --max-rate: the upper end of its 95 % interval lies above the bound; --judge-by rate compares
       the rate itself. Or it has found more distinct preventable failures than --max-preventable, or a kind that
       --no-new-failures does not know. Controls such as no-adversary count like any other method
  2    it could not run: the campaign failed, was cancelled or (with a bound) has not ended; the service refuses or
       does not answer; the time is up; an argument is wrong
  130  interrupted; the campaign goes on

environment:
  RISK_SAC_URL           of the service, where no --url is given (default: http://127.0.0.1:8000)
  RISK_SAC_API_KEY       the key, if the service asks for one
  RISK_SAC_API_KEY_FILE  a file that holds it

Results go to standard output, with --json as one JSON document; progress and errors go to standard error."""


def add(commands: Commands) -> None:
    """Adds the group of commands."""
    group = commands.add_parser("campaigns", help="campaigns of a running service")
    campaigns = group.add_subparsers(required=True, metavar="COMMAND")
    watch.add(campaigns)
    manage.add(campaigns)
    leaves = list(campaigns.choices.values())
    of_failures = campaigns.add_parser("failures", help="what a campaign found, one by one")
    each = of_failures.add_subparsers(required=True, metavar="COMMAND")
    failures.add(each)
    leaves += each.choices.values()
    for parser in (group, of_failures, *leaves):
        parser.epilog, parser.formatter_class = EPILOG, argparse.RawDescriptionHelpFormatter
    for parser in leaves:
        parser.set_defaults(on_error=COULD_NOT_RUN)
        parser.add_argument("--url", metavar="URL", help="of the service")
        parser.add_argument("--json", action="store_true", help="one JSON document instead of text and tables")
