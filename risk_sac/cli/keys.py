"""`risk-sac keys`: who may call the service."""

import argparse
import os
import sys

from risk_sac.cli.console import Commands


def add_keys(commands: Commands) -> None:
    """Adds the command; what follows it, flags too, is for the service's own parser."""
    keys = commands.add_parser(
        "keys", help="create, list and revoke the service's API keys", add_help=False, prefix_chars="\0"
    )
    keys.set_defaults(command=_keys)
    keys.add_argument("rest", nargs="*")


def _keys(options: argparse.Namespace) -> int:
    """Replaces this process: the method's code never imports the service."""
    os.execv(sys.executable, [sys.executable, "-m", "service.keys", *options.rest])
