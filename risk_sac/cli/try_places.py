"""`risk-sac places MAP --try N`: plays at some of the places, and says how many can be played at."""

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.markup import escape
from rich.table import Table

from risk_sac.cli.console import FAILED, OK, console
from risk_sac.scenario.maps.found import Survey
from risk_sac.scenario.maps.keep import Map

if TYPE_CHECKING:
    from risk_sac.tryout import Tried


def try_places(chosen: Map, found: Survey, options: argparse.Namespace) -> int:
    """Plays, and prints a row for each pattern; fails if a place does not run, or the ego is touched unattacked."""
    from risk_sac.tryout import sample, try_out  # here, because loading the simulator takes a second

    tried = []
    for fit in sample(found.fits, options.tries, options.seed):
        tried.append(try_out(fit, chosen.keep(fit), options.episodes, options.seed))
        for why in _wrong(tried[-1]):
            console.print(f"{fit.spot.pattern} at {fit.spot.id}: {why}", markup=False, soft_wrap=True)
    console.print(_table(found, tried))
    return FAILED if any(not each.runs or each.touched_by_nobody for each in tried) else OK


def _wrong(tried: "Tried") -> list[str]:
    whys = list(dict.fromkeys(tried.invalid))
    if not tried.played and not tried.invalid:
        whys.append(f"all scenes are refused: {dict(tried.rejected)}")
    if tried.touched_by_nobody:
        whys.append(f"{tried.touched_by_nobody} contacts although nobody attacks")
    if tried.unlike is not None:
        whys.append(tried.unlike)
    return whys


def _table(found: Survey, tried: Sequence["Tried"]) -> Table:
    names = ("pattern", "places", "tried", "run", "played", "refused", "invalid", "touched, unattacked", "mirrored")
    table = Table(*names, box=SIMPLE_HEAD)
    for pattern in dict.fromkeys(each.fit.spot.pattern for each in tried):
        own = [each for each in tried if each.fit.spot.pattern == pattern]
        row = (
            found.counts[pattern],
            len(own),
            sum(each.runs for each in own),
            sum(each.played for each in own),
            sum(each.rejected.total() for each in own),
            sum(len(each.invalid) for each in own),
            sum(each.touched_by_nobody for each in own),
            sum(each.unlike is None for each in own),
        )
        table.add_row(escape(pattern), *map(str, row))
    return table
