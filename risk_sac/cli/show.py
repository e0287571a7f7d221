"""`risk-sac show`: the contacts of a run, and pictures of them."""

import argparse
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.table import Table

from risk_sac.cli.console import OK, Commands, console
from risk_sac.results import Results, read_results


def add_show(commands: Commands) -> None:
    """Adds the command."""
    show = commands.add_parser("show", help="list a run's contacts, or draw one")
    show.set_defaults(command=_show)
    show.add_argument("results", type=Path, metavar="RESULTS", help="folder of a run, or its results.json")
    show.add_argument("failure", nargs="?", metavar="FAILURE", help="id of a contact; without it they are listed")
    show.add_argument("--out", type=Path, metavar="FILE.png", help="(default: failures/FAILURE.png beside RESULTS)")


def _show(options: argparse.Namespace) -> int:
    results = read_results(options.results)
    if options.failure is None:
        console.print(_contacts(results))
        return OK
    contact = results.contact(options.failure)
    folder = options.results if options.results.is_dir() else options.results.parent
    from risk_sac.show import draw  # here, because loading matplotlib takes a second

    picture = options.out or (folder / contact.series).with_suffix(".png")
    draw(results.spec.family, contact, folder, picture)
    console.print(f"Drawn: {picture}")
    return OK


def _contacts(results: Results) -> Table:
    """Fits 80 columns; only the failed rules wrap."""
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in ("id", "outcome", "other", "ego\nm/s", "other\nm/s", "ego's zone\non other's", "TTC\ns", "seen\ns"):
        table.add_column(name, no_wrap=True)
    table.add_column("failed rules")
    for contact in results.contacts:
        collision = contact.episode.collision
        if collision is None:
            continue
        table.add_row(
            contact.id,
            contact.episode.outcome,
            collision.other_id,
            f"{collision.ego_speed_mps:.1f}",
            f"{collision.other_speed_mps:.1f}",
            f"{collision.ego_zone} {collision.other_zone}",
            f"{collision.min_ttc_s:.2f}",
            f"{collision.visible_for_s:.1f}",
            contact.episode.reason,
        )
    return table
