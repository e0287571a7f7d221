"""`risk-sac campaigns list`, `cancel` and `delete`."""

import argparse
import itertools

from risk_sac.cli.campaigns.output import at_least_one, campaigns_table, line, print_answer
from risk_sac.cli.campaigns.progress import shown
from risk_sac.cli.console import OK, Commands
from risk_sac.client import Client

LISTED = 20
FILTERS = ("state", "family", "method", "label")


def add_list(campaigns: Commands) -> None:
    """Adds the command."""
    parser = campaigns.add_parser("list", help="campaigns, newest first")
    parser.set_defaults(command=_list)
    for name in FILTERS:
        parser.add_argument(f"--{name}", metavar=name.upper(), help=f"only with this {name}")
    parser.add_argument("--limit", type=at_least_one, default=LISTED, metavar="N", help=f"at most (default: {LISTED})")


def add_cancel(campaigns: Commands) -> None:
    """Adds the command."""
    parser = campaigns.add_parser("cancel", help="stop a campaign; what it found stays")
    parser.set_defaults(command=_cancel)
    parser.add_argument("id", metavar="ID", help="of the campaign")
    parser.add_argument("--wait", action="store_true", help="until it has ended")


def add_delete(campaigns: Commands) -> None:
    """Adds the command."""
    parser = campaigns.add_parser("delete", help="delete a campaign that has ended, and all it found")
    parser.set_defaults(command=_delete)
    parser.add_argument("id", metavar="ID", help="of the campaign")


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
