"""`risk-sac`: one run or a comparison of methods without a server, pictures of failures, the server, its campaigns."""

import argparse
import shlex
import sys
from collections.abc import Sequence

from risk_sac import __version__
from risk_sac.cli.campaigns import add_campaigns
from risk_sac.cli.console import FAILED, INTERRUPTED, MISUSED, complain
from risk_sac.cli.egos import add_egos
from risk_sac.cli.export import add_export
from risk_sac.cli.places import add_places
from risk_sac.cli.regress import add_regress
from risk_sac.cli.replay import add_bundle, add_replay, add_verify
from risk_sac.cli.report import add_report
from risk_sac.cli.run import add_evaluate, add_run
from risk_sac.cli.serve import add_keys, add_serve
from risk_sac.cli.show import add_show
from risk_sac.cli.understand import add_clusters, add_minimise, add_region
from risk_sac.errors import ConfigError, RiskSacError

COMMANDS = (
    add_run,
    add_places,
    add_evaluate,
    add_egos,
    add_show,
    add_verify,
    add_clusters,
    add_bundle,
    add_replay,
    add_export,
    add_minimise,
    add_region,
    add_regress,
    add_report,
    add_serve,
    add_campaigns,
    add_keys,
)
EPILOG = """exit status, but of `campaigns`, which says its own: 0 done; 1 failed; 2 a wrong setting or argument;
130 interrupted, and the same command goes on."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    options = _parser().parse_args(arguments)
    options.typed = shlex.join(["risk-sac", *(sys.argv[1:] if arguments is None else arguments)])
    try:
        status: int = options.command(options)
    except ConfigError as error:
        complain(str(error))
        return MISUSED
    except (RiskSacError, OSError) as error:
        complain(str(error))
        status = options.on_error
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="risk-sac", description="Finds scenes and adversaries that make an ego crash.", epilog=EPILOG
    )
    parser.add_argument("--version", action="version", version=f"risk-sac {__version__}")
    parser.set_defaults(on_error=FAILED)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for add in COMMANDS:
        add(commands)
    return parser
