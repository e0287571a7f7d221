"""`risk-sac places`: lists where patterns fit on a map; with --try, plays there."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import FAILED, OK, counted
from risk_sac.cli.flags import MAP_HELP
from risk_sac.cli.parser import Commands, add_command, add_json_flag
from risk_sac.host.terminal import console
from risk_sac.maps.convert import present_net
from risk_sac.maps.finder import FINDERS, Map, survey
from risk_sac.maps.found import TITLES, Pattern, Survey
from risk_sac.run_folder.durable import scratch_folder
from risk_sac.world.net import net_remarks

if TYPE_CHECKING:
    from risk_sac.failures.trials import Tried

SHOWN = 20


def add(commands: Commands) -> None:
    """Adds the command."""
    places = add_command(
        commands,
        "places",
        _places,
        "list the places of a map where a pattern fits",
        more="With --try, also plays there.",
        example="places town.net.xml --pattern crossing --out town.png",
    )
    places.add_argument("network", type=Path, metavar="MAP", help=MAP_HELP)
    choice = places.group("choice")
    choice.add_argument("--pattern", choices=list(FINDERS), help="only this one (default: all)")
    choice.add_argument("--why", action="store_true", help="list also where they do not fit, and why")
    choice.add_argument("--all", action="store_true", help=f"list all (default: {SHOWN} of each pattern)")
    trial = places.group("trial")
    trial.add_argument("--try", dest="tries", type=int, metavar="N", help="play at N random places of each pattern")
    trial.add_argument("--episodes", type=int, default=20, metavar="N", help="of each place (default: %(default)s)")
    trial.add_argument("--seed", type=int, default=0, metavar="N", help="of the choice (default: %(default)s)")
    places.group("output").add_argument("--out", type=Path, metavar="FILE.png", help="draw the map with its places")
    add_json_flag(places)


def _places(options: argparse.Namespace) -> int:
    patterns: tuple[Pattern, ...] = (options.pattern,) if options.pattern else tuple(FINDERS)
    with scratch_folder() as folder:
        converted = present_net(options.network, folder)
        chosen = Map(converted.file)
        map_survey = survey(chosen.net, patterns)
        warnings = [*converted.warnings, *net_remarks(chosen.net)]
        if options.out is not None:
            from risk_sac.failures.from_above import map_png  # here, because loading matplotlib takes a second

            options.out.write_bytes(map_png(chosen.net, map_survey))
        if options.tries is not None:
            return _try_places(chosen, map_survey, options)
    if options.json:
        fits, misfits = [fit.told() for fit in map_survey.fits], [misfit.told() for misfit in map_survey.misfits]
        said = {"places": fits, "elsewhere": misfits, "nowhere": map_survey.nowhere, "warnings": warnings}
        console.out(json.dumps(said), highlight=False)
        return OK
    for warning in warnings:
        console.print(f"warning: {warning}", soft_wrap=True, markup=False)
    for pattern in patterns:
        _tell(pattern, map_survey, most=len(map_survey.fits) if options.all else SHOWN, why=options.why)
    if options.out is not None:
        console.print(f"Drawn: {options.out}", soft_wrap=True)
    return OK


def _tell(pattern: Pattern, map_survey: Survey, most: int, *, why: bool) -> None:
    fits = [fit for fit in map_survey.fits if fit.spot.pattern == pattern]
    misfits = [misfit for misfit in map_survey.misfits if misfit.spot.pattern == pattern]
    rare = sum(fit.rare for fit in fits)
    marked = f", contacts are rare at {rare} of them" if rare else ""
    counts = f"{counted(len(fits), 'place')}{marked}; does not fit at {len(misfits)}"
    nowhere = f": {map_survey.nowhere[pattern]}" if pattern in map_survey.nowhere else ""
    console.print(f"{TITLES[pattern]} ({pattern}): {counts}{nowhere}", highlight=False)
    if fits:
        console.print(_table("what", [(fit.spot.id, fit.summary) for fit in fits], most))
    if why and misfits:
        console.print(_table("why not", [(misfit.spot.id, misfit.why) for misfit in misfits], most))


def _table(heading: str, rows: Sequence[tuple[str, str]], most: int) -> Table:
    table = Table("place", heading, box=SIMPLE_HEAD)
    for row in rows[:most]:
        table.add_row(*map(escape, row))
    if len(rows) > most:
        table.add_row("…", f"and {len(rows) - most} more: --all")
    return table


def _try_places(chosen: Map, map_survey: Survey, options: argparse.Namespace) -> int:
    """Plays at places and prints a row per pattern; fails if one does not run, or the ego is touched unattacked."""
    from risk_sac.failures.trials import sample, try_out  # here, because loading the simulator takes a second

    tried = []
    for fit in sample(map_survey.fits, options.tries, options.seed):
        tried.append(try_out(fit, chosen.keep(fit), options.episodes, options.seed))
        for why in _wrong(tried[-1]):
            console.print(f"{fit.spot.pattern} at {fit.spot.id}: {why}", markup=False, soft_wrap=True)
    console.print(_tried(map_survey, tried))
    return FAILED if any(not each.runs or each.touched_unattacked for each in tried) else OK


def _wrong(tried: "Tried") -> list[str]:
    whys = list(dict.fromkeys(tried.invalid))
    if not tried.played and not tried.invalid:
        whys.append(f"all scenes are refused: {dict(tried.rejected)}")
    if tried.touched_unattacked:
        whys.append(f"{tried.touched_unattacked} contacts without an attack")
    if tried.unlike is not None:
        whys.append(tried.unlike)
    return whys


def _tried(map_survey: Survey, tried: Sequence["Tried"]) -> Table:
    names = ("pattern", "places", "tried", "run", "played", "refused", "invalid", "touched, unattacked", "mirrored")
    table = Table(*names, box=SIMPLE_HEAD)
    for pattern in dict.fromkeys(each.fit.spot.pattern for each in tried):
        own = [each for each in tried if each.fit.spot.pattern == pattern]
        row = (
            map_survey.counts[pattern],
            len(own),
            sum(each.runs for each in own),
            sum(each.played for each in own),
            sum(each.rejected.total() for each in own),
            sum(len(each.invalid) for each in own),
            sum(each.touched_unattacked for each in own),
            sum(each.unlike is None for each in own),
        )
        table.add_row(escape(pattern), *map(str, row))
    return table
