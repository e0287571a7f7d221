"""`risk-sac campaigns`: campaigns of a running service, from a terminal or a CI job."""

from risk_sac.cli.campaigns import failures, manage, watch
from risk_sac.cli.console import COULD_NOT_RUN
from risk_sac.cli.parser import Commands, add_group, add_json_flag

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
        example="campaigns submit --families low --watch --max-pcr 0.1",
        epilog=EPILOG,
    )
    campaigns = group.add_subparsers(required=True, metavar="COMMAND")
    watch.add(campaigns)
    manage.add(campaigns)
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
