"""`python -m service.keys`: create, list and revoke API keys; applies at once."""

import argparse
import re
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.host.terminal import Output, complain, errors, run_command
from service.keys import PROJECT, KeyFile, Scope
from service.settings import MISUSED, read_settings

console = Output(highlight=False, soft_wrap=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        settings = read_settings()
        if options.data_dir is not None:
            settings = settings.model_copy(update={"data_dir": options.data_dir})
        options.command(KeyFile(settings.keys_file), options)
    except RiskSacError as error:
        complain(str(error))
        return MISUSED if isinstance(error, ConfigError) else 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="risk-sac keys",
        description="Create, list and revoke API keys of the service.\nA running service applies changes at once.",
        epilog="example:\n  risk-sac keys create --project maps --scope run",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    folder = argparse.ArgumentParser(add_help=False)
    folder.add_argument(
        "--data-dir", type=Path, metavar="DIR", help="folder of the service (default: RISK_SAC_DATA_DIR or data)"
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    create = commands.add_parser("create", help="make a key and print it once", parents=[folder])
    create.set_defaults(command=_create)
    create.add_argument("--project", type=_project, required=True, help="owner of what is posted with it")
    create.add_argument("--name", type=_name, default="", help="a note, such as the holder's name")
    create.add_argument(
        "--scope",
        type=Scope,
        default=Scope.RUN,
        metavar="read|run|admin",
        help="read; also post, cancel and delete; also all of that in every project, and the metrics (default: run)",
    )
    list_ = commands.add_parser("list", help="list all keys, without their secrets", parents=[folder])
    list_.set_defaults(command=_list)
    revoke = commands.add_parser("revoke", help="make a key invalid", parents=[folder])
    revoke.set_defaults(command=_revoke)
    revoke.add_argument("id", help="as `list` shows it")
    return parser


def _create(file: KeyFile, options: argparse.Namespace) -> None:
    key, token = file.create(options.project, options.name, options.scope)
    console.print(token, markup=False)  # alone on standard output, for scripts
    errors.print(f"Key {key.id} may {key.scope} in project {key.project}. It is not stored: keep it now.", markup=False)


def _list(file: KeyFile, options: argparse.Namespace) -> None:
    table = Table(box=SIMPLE_HEAD)
    for name in ("id", "project", "scope", "created", "revoked", "name"):
        table.add_column(name, no_wrap=True)
    for key in file.read() or ():
        table.add_row(key.id, key.project, key.scope, _date(key.created_at), _date(key.revoked_at), escape(key.name))
    console.print(table)


def _revoke(file: KeyFile, options: argparse.Namespace) -> None:
    key = file.revoke(options.id)
    console.print(f"Key {key.id} of project {key.project} is revoked.", markup=False)


def _project(text: str) -> str:
    if not re.fullmatch(PROJECT, text):
        raise argparse.ArgumentTypeError(f"got {text!r}; wanted 1 to 40 of a-z, 0-9 and -, and no - first")
    return text


def _name(text: str) -> str:
    if len(text) > 100:
        raise argparse.ArgumentTypeError(f"got {len(text)} characters; wanted at most 100")
    return text


def _date(time_s: float | None) -> str:
    return "" if time_s is None else datetime.fromtimestamp(time_s, UTC).strftime("%Y-%m-%d %H:%M")


if __name__ == "__main__":
    sys.exit(run_command(main))
