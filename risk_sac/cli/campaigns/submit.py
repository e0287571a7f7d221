"""`risk-sac campaigns submit`: queue a campaign."""

import argparse

from risk_sac.cli.campaign_flags import add_campaign_flags, add_ego_flag, campaign_flags, ego_flag
from risk_sac.cli.campaigns.output import line, print_answer
from risk_sac.cli.campaigns.watch import add_watch_flags, prepare, watch
from risk_sac.cli.console import OK, Commands, notes
from risk_sac.client import Client
from risk_sac.config.spec_file import read_campaign
from risk_sac.errors import ConfigError

SEEDS = 1  # where none are named


def add_submit(campaigns: Commands) -> None:
    """Adds the command."""
    parser = campaigns.add_parser("submit", help="queue a campaign")
    parser.set_defaults(command=_submit)
    add_campaign_flags(parser, families="the file's", methods="risk-sac", seeds=SEEDS)
    add_ego_flag(parser)
    parser.add_argument("--label", metavar="TEXT", help="to find it by")
    parser.add_argument(
        "--idempotency-key", metavar="KEY", help="the same key gives the same campaign, however often it is submitted"
    )
    parser.add_argument("--watch", action="store_true", help="go on as `watch` does, with its flags:")
    add_watch_flags(parser)


def _submit(options: argparse.Namespace) -> int:
    for name in ("max_ecr", "max_pcr", "max_preventable", "no_new_failures", "junit", "timeout"):
        if getattr(options, name) is not None and not options.watch:
            raise ConfigError("got it without --watch; wanted both", field=f"--{name.replace('_', '-')}")
    prepare(options)
    flags = campaign_flags(options, SEEDS) | ego_flag(options) | {"label": options.label}
    spec = read_campaign(options.spec, flags, {})
    with Client.from_environment(options.url) as client:
        campaign = client.submit(spec, options.idempotency_key)
        if options.watch:
            notes.print(client.url_of(campaign.id), markup=False, soft_wrap=True)
            return watch(client, campaign.id, options)
    print_answer(options, campaign, line(campaign))
    return OK
