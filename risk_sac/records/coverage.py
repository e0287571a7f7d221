"""Coverage of campaigns: a matrix of cells, each with the campaigns behind it."""

from collections.abc import Mapping
from enum import StrEnum

from risk_sac.records.base import Real, Record


class CellState(StrEnum):
    """State of a cell."""

    FAILED = "failed"  # an episode in it failed
    PLAYED = "played"  # played, no failure
    NEVER = "never"  # no episode was played in it; a requirement never came within a clear margin
    INEXPRESSIBLE = "inexpressible"  # no scenario states it, so nothing is counted


class CellPower(Record):
    """Known faults that the best budget behind a cell finds.

    It is that of the whole budget in the cell's scenarios, not of the cell.
    """

    campaign: str
    method: str
    expected: Real
    """How many of the known faults the campaign's seeds detect on average."""
    faults: int
    """Known faults that the method was measured with in these scenarios."""


class CoverageCell(Record):
    """A value that episodes may have had."""

    name: str
    state: CellState
    played: int = 0
    """Episodes, those of the i.i.d. phase among them."""
    failed: int = 0
    """Of these, those with a valid violation that counts; of a requirement its own violations."""
    reached: int | None = None
    """Of a requirement: episodes in which it had less than one scale of robustness left; null elsewhere."""
    families: tuple[str, ...] = ()
    """Scenarios with an episode in it."""
    campaigns: tuple[str, ...] = ()
    """Those with an episode in it."""
    failing: tuple[str, ...] = ()
    """Of these campaigns, those with a failure in it."""
    power: CellPower | None = None
    """What finding nothing is worth; null where nothing was measured under the present definitions, or none is asked
    for, since the cell failed or was never played."""
    note: str
    """The state in words, such as `played, no failure, power: not measured`."""


class CoverageRow(Record):
    """An attribute with all its values."""

    name: str
    meaning: str
    unit: str = ""
    family: str = ""
    """Of a scene parameter the scenario that has it; empty for what scenarios share."""
    cells: tuple[CoverageCell, ...]


class CoverageGroup(Record):
    """Rows of one kind."""

    name: str
    """odd | functional_scenarios | tags | requirements | traffic_rules | parameters | bodies"""
    title: str
    source: str
    """Standard that the rows follow, by number and title; empty without one."""
    rows: tuple[CoverageRow, ...]


class CoveredPair(Record):
    """Two scene parameters of one scenario together, in 4 x 4 cells."""

    family: str
    parameters: tuple[str, str]
    bins: tuple[tuple[str, ...], tuple[str, ...]]
    played: tuple[tuple[int, ...], ...]
    """Episodes by the bin of the first parameter, then of the second."""
    failed: tuple[tuple[int, ...], ...]
    """Of these, the failures."""
    campaigns: tuple[str, ...]


class CoveredCampaign(Record):
    """A campaign behind the cells."""

    id: str
    """Digest of its spec's first digits on the command line, its id in the service."""
    label: str
    ego: str
    families: tuple[str, ...]
    episodes: int
    """That were played."""
    failures: int
    complete: bool
    """Whether all its runs are counted."""


class CoverageMatrix(Record):
    """Coverage by one campaign, or by several together."""

    definitions: tuple[int, ...]
    """Versions of the definitions that its contacts and violations were judged by."""
    campaigns: tuple[CoveredCampaign, ...]
    groups: tuple[CoverageGroup, ...]
    pairs: tuple[CoveredPair, ...]
    cells: Mapping[CellState, int]
    """State → cells of all groups, pairs apart."""
    limits: tuple[str, ...]
    """What the matrix does not show, a sentence each."""
