"""`python -m service.store`: copies the database."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.host.terminal import complain, console, run_command
from service.errors import StorageError
from service.host import create_private
from service.settings import MISUSED, ServiceSettings, read_settings
from service.store.database import connected, sqlite_file


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command; returns the exit status."""
    options = _parser().parse_args(arguments)
    try:
        said = options.command(read_settings(), options)
    except RiskSacError as error:
        complain(str(error))
        return MISUSED if isinstance(error, ConfigError) else 1
    console.print(said, markup=False, soft_wrap=True)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m service.store", description="The database of the service.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    copy = commands.add_parser("copy", help="write a whole copy of a SQLite database, also while the service runs")
    copy.set_defaults(command=_copy)
    copy.add_argument("file", type=Path, help="that there is not yet")
    return parser


def _copy(settings: ServiceSettings, options: argparse.Namespace) -> str:
    _existing(settings)
    if sqlite_file(settings.url) is None:
        raise StorageError("database is PostgreSQL; wanted SQLite: `pg_dump` copies PostgreSQL")
    if options.file.exists():
        raise StorageError(f"{str(options.file)!r} exists; wanted a file that there is not yet")
    create_private(options.file)
    doing = "copying the database"
    with connected(settings.url, doing) as engine, closing(engine.raw_connection()) as connection:
        connection.cursor().execute("VACUUM INTO ?", [str(options.file)])  # which refuses within a transaction
    return f"The database is copied to {options.file}."


def _existing(settings: ServiceSettings) -> None:
    file = sqlite_file(settings.url)
    if file is not None and not file.exists():
        raise StorageError(f"database {str(file)!r} is missing; wanted one, where RISK_SAC_DATA_DIR says")


if __name__ == "__main__":
    sys.exit(run_command(main))
