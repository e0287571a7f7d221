"""Rows of cells: each reference driver's PCR, contacts by severity, failures by fault, episodes by what drove them."""

from collections.abc import Callable, Mapping, Sequence

from risk_sac.records import DrivenBy, Fault, Severity
from risk_sac.report.cells import Cell
from risk_sac.report.page import DASH, interval, percent

Table = tuple[list[str], list[list[str]]]
RowsOf = Callable[[Sequence[Cell]], Table]
CLASSES = [*reversed(Severity), *(f"fault: {each}" for each in Fault)]


def driver_rows(cells: Sequence[Cell]) -> Table:
    """Returns the drivers' names, and per cell the PCR of each.

    It is a dash for a driver that judged no contact.
    """
    names = list(dict.fromkeys(name for cell in cells for name in cell.pcr_by_driver))
    return names, [[_pcr(cell, name) for name in names] for cell in cells if names]


def _pcr(cell: Cell, name: str) -> str:
    found = cell.pcr_by_driver.get(name)
    return f"{found.pcr:.3f}{interval(found.pcr_low, found.pcr_high)}" if found else DASH


def class_rows(cells: Sequence[Cell]) -> Table:
    """Returns the classes, and per cell the number and share of each.

    The share is of those that were judged.
    """
    if not any(cell.by_severity or cell.by_fault for cell in cells):
        return [], []
    return CLASSES, [
        [*_shares(cell.by_severity, list(reversed(Severity))), *_shares(cell.by_fault, list(Fault))] for cell in cells
    ]


def driven_by_rows(cells: Sequence[Cell]) -> Table:
    """Returns what drove, and per cell the episodes that it drove with their share, and its headline failures."""
    names = [each for each in DrivenBy if any(cell.episodes_driven_by.get(each) for cell in cells)]
    columns = [*names, *(f"headline: {name}" for name in names)]
    return columns, [[*_shares(cell.episodes_driven_by, names), *_headline(cell, names)] for cell in cells if names]


def _headline(cell: Cell, names: Sequence[str]) -> list[str]:
    return [DASH if cell.headline is None else str(cell.headline_driven_by.get(name, 0)) for name in names]


def _shares(counts: Mapping[str, int], names: Sequence[str]) -> list[str]:
    judged = sum(counts.values())
    return [f"{counts.get(name, 0)} ({percent(counts.get(name, 0) / judged, 0)})" if judged else DASH for name in names]
