"""Promises, what was measured of them, and whether they were kept."""

import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table


@dataclass(frozen=True)
class Promise:
    """One line of the table; `kept` is None where nothing is promised."""

    what: str
    promised: str
    measured: str
    kept: bool | None = None
    value: float | None = None


def at_most(what: str, limit: float, measured: float, unit: str, note: str = "") -> Promise:
    """A figure that has a limit."""
    return Promise(what, f"≤ {limit:g} {unit}", f"{measured:,.1f} {unit}{note}", measured <= limit, measured)


def percentile(values: Sequence[float], percent: int) -> float:
    """The value that so many percent do not exceed, interpolated."""
    return statistics.quantiles(values, n=100, method="inclusive")[percent - 1]


def show(title: str, promises: Iterable[Promise], console: Console) -> None:
    """Print the table."""
    table = Table("what", "promise", "measured", "", title=title, box=SIMPLE_HEAD, title_justify="left")
    for each in promises:
        mark = {True: "[green]ok[/]", False: "[bold red]BROKEN[/]", None: ""}[each.kept]
        table.add_row(each.what, each.promised, each.measured, mark)
    console.print(table)
