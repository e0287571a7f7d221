"""`risk-sac places`: where the patterns fit on a map, why elsewhere they do not, and a picture of it."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import OK, Commands, console
from risk_sac.cli.on_map import MAP_HELP
from risk_sac.cli.text import counted
from risk_sac.cli.try_places import try_places
from risk_sac.scenario.maps.convert import present_net
from risk_sac.scenario.maps.finder import FINDERS, survey
from risk_sac.scenario.maps.found import TITLES, Fit, Misfit, Pattern, Survey
from risk_sac.scenario.maps.keep import Map
from risk_sac.scenario.maps.net import read_net

SHOWN = 20


def add_places(commands: Commands) -> None:
    """Adds the command."""
    places = commands.add_parser("places", help="where the patterns fit on a map of yours")
    places.set_defaults(command=_places)
    places.add_argument("network", type=Path, metavar="MAP", help=MAP_HELP)
    places.add_argument("--pattern", choices=list(FINDERS), help="only this one (default: all)")
    places.add_argument("--why", action="store_true", help="say where they do not fit, and why")
    places.add_argument("--all", action="store_true", help=f"list all (default: {SHOWN} of each pattern)")
    places.add_argument("--json", action="store_true", help="one document, with everything")
    places.add_argument("--try", dest="tries", type=int, metavar="N", help="play at N random places of each pattern")
    places.add_argument("--episodes", type=int, default=20, metavar="N", help="of each place (default: %(default)s)")
    places.add_argument("--seed", type=int, default=0, metavar="N", help="of what is tried (default: %(default)s)")
    places.add_argument("--out", type=Path, metavar="FILE.png", help="draw the map with its places")


def _places(options: argparse.Namespace) -> int:
    patterns: tuple[Pattern, ...] = (options.pattern,) if options.pattern else tuple(FINDERS)
    with TemporaryDirectory() as folder:
        converted = present_net(options.network, Path(folder))
        net = read_net(converted.file)
        found = survey(net, patterns)
        if options.out is not None:
            from risk_sac.failures.map_picture import map_png  # here, because loading matplotlib takes a second

            options.out.write_bytes(map_png(converted.file, found))
        if options.tries is not None:
            return try_places(Map(converted.file), found, options)
    if options.json:
        sys.stdout.write(json.dumps(_document(found, converted.warnings)) + "\n")
        return OK
    for warning in converted.warnings:
        console.print(f"warning: {warning}", soft_wrap=True, markup=False)
    for pattern in patterns:
        _tell(pattern, found, most=len(found.fits) if options.all else SHOWN, why=options.why)
    if options.out is not None:
        console.print(f"Drawn: {options.out}", soft_wrap=True)
    return OK


def _tell(pattern: Pattern, found: Survey, most: int, *, why: bool) -> None:
    fits = [fit for fit in found.fits if fit.spot.pattern == pattern]
    misfits = [misfit for misfit in found.misfits if misfit.spot.pattern == pattern]
    counts = f"{counted(len(fits), 'place')}; does not fit at {len(misfits)}"
    console.print(f"{TITLES[pattern]} ({pattern}): {counts}", highlight=False)
    if fits:
        console.print(_table("what", [(fit.spot.id, fit.place.summary) for fit in fits], most))
    if why and misfits:
        console.print(_table("why not", [(misfit.spot.id, misfit.why) for misfit in misfits], most))


def _table(heading: str, rows: Sequence[tuple[str, str]], most: int) -> Table:
    table = Table("place", heading, box=SIMPLE_HEAD)
    for row in rows[:most]:
        table.add_row(*map(escape, row))
    if len(rows) > most:
        table.add_row("…", f"and {len(rows) - most} more: --all")
    return table


def _document(found: Survey, warnings: Sequence[str]) -> dict[str, object]:
    return {
        "places": [_spot(fit) | {"summary": fit.place.summary} for fit in found.fits],
        "elsewhere": [_spot(misfit) | {"why": misfit.why} for misfit in found.misfits],
        "warnings": list(warnings),
    }


def _spot(found: Fit | Misfit) -> dict[str, object]:
    spot = found.spot
    return {"pattern": spot.pattern, "place": spot.id, "x_m": spot.x_m, "y_m": spot.y_m}
