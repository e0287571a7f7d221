"""Records for an assessor: a campaign's test cases, report inputs and coverage."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Literal

from risk_sac.config import FamilyName, Requirement, RunMethod
from risk_sac.records.base import Real, Record
from risk_sac.records.episode import Phase, TriageState


class CaseInput(Record):
    """A parameter of a scenario, as episodes draw it."""

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    words: tuple[str, ...]
    """Alternatives that parts of the range stand for; empty for a number."""
    distribution: str
    """In words: that of the document, or uniform."""
    declared: bool
    """Whether the document declares the distribution; if not, uniform is an assumption."""


class CaseRun(Record):
    """A run that played a test case, and where it is recorded."""

    id: str
    method: RunMethod
    seed: int
    phases: tuple[Phase, ...]
    episodes: int
    """Refused scenes included."""
    cpu_s: float
    digest: str
    """SHA-256 of the results: the same whenever the run is repeated."""
    spec_digest: str
    replayed: int | None
    """Failures that were replayed; null where none was yet."""
    verified: int | None
    """Of these, the same to the bit each time."""


class CaseResult(Record):
    """Result of the searches of a test case: counts, no rates."""

    verdict: Literal["failed", "no_failure_found", "not_played"]
    episodes: int
    refused: int
    """Infeasible scenes."""
    unended: int
    """Episodes in which the ego failed to drive, or the simulator died."""
    played: int
    """All others."""
    contacts: int
    failures: int
    """Episodes with a valid violation of a requirement that counts."""
    kinds: int
    """Of failures, over all runs."""
    preventable: int
    """Of these kinds, those that a reference driver prevents."""
    published: int
    """Of these kinds, those that R157, FSM or RSS prevents."""
    headline: int | None
    """Kinds that are preventable, plausible, not minor and verified; null before a replay."""
    violated: Mapping[str, int]
    """Requirement → episodes; of one that counts only those that are valid."""


class CaseEstimate(Record):
    """A number that stands for more than was played."""

    figure: str
    value: float
    low: float
    high: float
    level: str
    """Of the bounds."""
    shows: str
    does_not_show: str


class CaseJudges(Record):
    """Rules, drivers and people that judged a test case."""

    definitions: tuple[int, ...]
    """Versions of the written definitions of a failure that were applied."""
    drivers: tuple[str, ...]
    """Reference drivers, each of which makes a failure preventable."""
    people: Mapping[TriageState, int] | None
    """Failures of the whole campaign by what people made of them. Null: not known, as folders of runs do not tell."""


class ReportedCase(Record):
    """A scenario of a campaign as a test case."""

    identifier: str
    """Scenario and the first digits of the campaign's digest."""
    scenario: FamilyName
    summary: str
    sources: Mapping[str, str]
    """File of the document or a net → SHA-256."""
    tags: tuple[str, ...]
    functional_scenarios: tuple[str, ...]
    objective: str
    preconditions: tuple[str, ...]
    odd: Mapping[str, str]
    """Field → what scenario and campaign allow together."""
    inputs: tuple[CaseInput, ...]
    constraints: tuple[str, ...]
    """That every scene keeps."""
    steps: tuple[str, ...]
    platform: Mapping[str, str]
    """Software → version of the runs."""
    pass_criteria: tuple[Requirement, ...]
    """The case fails with a valid violation of one that counts as a failure; others are reported."""
    result: CaseResult
    estimates: tuple[CaseEstimate, ...]
    recording: tuple[CaseRun, ...]
    judged_by: CaseJudges


class FigureNote(Record):
    """A kind of figure, and its limits."""

    figure: str
    kind: Literal["count", "estimate", "model", "measurement"]
    rests_on: str
    does_not_show: str


class ClauseRow(Record):
    """Field of a test case, and a standard's clause for it."""

    field: str
    standard: str
    clause: str
    """Number and title; `by title` where the standard's public scope alone names the field; or not confirmed."""


class InputDigest(Record):
    """An input of a report."""

    name: str
    """Run and file, file of a scenario, or `campaign`, `code`, `benchmark`, `regression`."""
    sha256: str


class SignedInputs(Record):
    """All inputs of a report."""

    digest: str
    """SHA-256 over the lines `sha256  name` in the order of the names."""
    inputs: tuple[InputDigest, ...]


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
