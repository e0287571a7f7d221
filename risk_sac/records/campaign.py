"""Campaigns and scenarios in the API: state, progress, results and power.

Power comes from benchmark runs, and says what finding nothing is worth.
"""

from collections.abc import Mapping
from datetime import datetime
from typing import Literal

from risk_sac.config import CampaignSpec, Scenario
from risk_sac.records.base import Adjustment, Page, Real, Record
from risk_sac.records.run import Counts, DriverPcr, Family, RequirementCounts, Run, RunResult, SearchMethod, State
from risk_sac.world.types import OptionalReal


class RunBudget(Record):
    """Budget of each run of a method in a family."""

    family: str
    runs: int
    """Seeds."""
    episodes: int
    """Search episodes: as the budget has them; of runs that have ended, what they played on average."""
    steps_per_episode: Real
    """Environment steps, on average."""
    estimated_from: Literal["campaign", "benchmark"]
    """Whose episodes that average is of: the campaign's own once there are some."""
    steps: int
    """Environment steps of the run."""


class DefectPower(Record):
    """Share of benchmark runs that detected a known defect within the budget."""

    defect: str
    family: str
    detected: int
    """Runs."""
    runs: int
    """That were measured, each with a seed of its own."""


class MethodPower(Record):
    """Number of known defects that a method detects with the budget."""

    method: str
    budgets: tuple[RunBudget, ...]
    """Of the campaign's families that were measured."""
    defects: tuple[DefectPower, ...]
    expected: Real
    """How many the seeds of the campaign together detect, on average."""
    at_least: bool
    """Whether the budget is larger than what was measured, so that it may detect more."""
    in_most_seeds: tuple[str, ...]
    """Defects that more than half of the runs detected."""
    at_least_once: tuple[str, ...]
    """Defects that some run detected."""
    never: tuple[str, ...]
    """Defects that no run detected."""
    sentences: tuple[str, ...]
    """The same in words, and in which families nothing was measured."""


class Power(Record):
    """Number of known defects that a budget detects, by stored benchmark runs.

    Nothing is run for it.
    """

    note: str
    """What the figures rest on."""
    comparison: str
    """Methods on the defects and steps that all were measured with; empty unless two or more were measured."""
    methods: tuple[MethodPower, ...]

    @property
    def lines(self) -> list[str]:
        """The comparison if there is one, and a line for each method."""
        lines = [f"{each.method}: {' '.join(each.sentences)}" for each in self.methods]
        return [self.comparison, *lines] if self.comparison else lines


class Progress(Record):
    """Progress of a campaign, and the findings of its searches."""

    episodes_done: int
    """Of the i.i.d. phase too, if there is one; what follows the totals is of the searches alone."""
    episodes_total: int
    headline: int | None = None
    """Kinds of failures, preventable, plausible, not minor, the same when replayed. Null before a replay."""
    headline_published: int | None = None
    """Of these kinds, those that R157, FSM or RSS prevents."""
    failures: int
    """Episodes with a valid violation of a requirement that counts."""
    raw_collisions: int
    """All contacts of the ego."""
    rejected: int
    distinct_failures: int
    """Kinds of failures: sum over the runs."""
    preventable: int
    """Failures that a reference driver would have prevented, repetitions included."""
    distinct_preventable: int
    """Kinds of these; sum over the runs."""
    distinct_published: int = 0
    """Of these kinds, those that R157, FSM or RSS prevents; sum over the runs."""
    headline_candidates: int = 0
    """Those that are plausible and not minor."""
    implausible: int = 0
    """Those that are not minor, but implausible; they are in no headline."""
    headline_waiting: int = 0
    """Candidates in runs that were not replayed yet."""
    window_ecr: OptionalReal
    """ECR over each run's newest 100 episodes: mean over the runs at work, or all once none is, without controls."""
    window_pcr: OptionalReal
    """PCR, averaged the same way."""
    dual_variable: OptionalReal
    """λ, averaged the same way."""
    temperature: OptionalReal
    """α, averaged the same way."""
    eta_s: OptionalReal
    """Seconds until the campaign ends at its present pace; null before there is one, 0 at the end."""


class EgoDriver(Record):
    """The ego's driver; no enums, so that earlier versions' campaigns load."""

    profile: str
    car_following: str
    driver: str | None = None
    """Name of a registered ego; null: SUMO's models drive, as `profile` and `car_following` say."""
    label: str | None = None
    """Its version as its maker calls it."""
    defects: tuple[str, ...] = ()
    """Defects that are planted into it."""


class CampaignHead(Record):
    """A campaign's data without its runs."""

    id: str
    label: str
    tags: tuple[str, ...] = ()
    state: State
    reason: str | None
    """Why it failed, is paused, or waits."""
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None

    @property
    def ended(self) -> bool:
        """Whether the state is final."""
        return self.state.final


class CampaignSummary(CampaignHead):
    """A campaign as it appears in a list."""

    families: list[str]
    methods: list[str]
    ego: EgoDriver
    """The rest of its settings is in the campaign's `spec`."""
    progress: Progress


class CampaignPage(Page[CampaignSummary]):
    """Campaigns, newest first."""


class EndNotice(Record):
    """The message to `on_end` of a campaign's spec."""

    state: Literal["waiting", "delivered", "failed"]
    """waiting: the campaign has not ended, or the next try is later."""
    tries: int
    reason: str | None
    """Why the latest try failed."""


class Campaign(CampaignSummary):
    """Campaign with its runs, in queue order, and what was posted."""

    runs: list[Run]
    requirements: Mapping[str, RequirementCounts] = {}
    """Requirement → its funnel, summed over the searches."""
    spec: CampaignSpec
    notice: EndNotice | None = None
    """Null: the spec has no `on_end`."""


class CampaignCheck(Record):
    """Adjustments of a campaign, and the known defects that it detects."""

    adjustments: tuple[Adjustment, ...]
    """Changes from the requested settings."""
    power: Power
    """Known defects that its budget detects."""


class StateChange(Record):
    """Change of state of a campaign or of one of its runs."""

    run_id: str | None
    """Null: the campaign itself."""
    state: State
    reason: str | None
    """Why, where it did not go as planned."""
    at: datetime

    @property
    def ends_campaign(self) -> bool:
        """Whether this is the campaign's last event."""
        return self.run_id is None and self.state.final


class Total(Counts):
    """Begun runs of one family and method: sums of counts, means otherwise."""

    family: Family
    method: SearchMethod
    runs: int
    headline: int | None = None
    """Each kind once."""
    headline_published: int | None = None
    """Of these kinds, those that R157, FSM or RSS prevents."""
    ecr: OptionalReal
    ecr_low: OptionalReal
    """95 % interval: Wilson over all episodes, widened to the bootstrap over the seeds."""
    ecr_high: OptionalReal
    pcr: OptionalReal
    pcr_low: OptionalReal
    """95 % interval, as that of the ECR."""
    pcr_high: OptionalReal
    efficiency: OptionalReal
    cost_rate: OptionalReal
    dispersion: OptionalReal
    """Over the runs that have one."""
    steps_per_distinct_failure: OptionalReal
    """Of the sums."""
    unresponsive_share: OptionalReal
    """Of the valid contacts; null without one."""
    pcr_by_driver: Mapping[str, DriverPcr] = {}
    """Reference driver → its own PCR; `published` → that of R157, FSM or RSS."""
    episodes_driven_by: Mapping[str, int] = {}
    """What drove the adversaries → episodes."""
    headline_driven_by: Mapping[str, int] = {}
    """What drove the first episode of a kind → headline failures."""
    by_severity: Mapping[str, int] = {}
    """Severity → valid contacts."""
    by_fault: Mapping[str, int] = {}
    """Fault → failures."""
    requirements: Mapping[str, RequirementCounts] = {}
    """Requirement → its funnel."""
    kinds: Mapping[str, int]
    """Kind → valid violations."""
    conflicts_by_second: list[int]
    """Valid contacts by the second in which the conflict began."""
    contacts_by_second: list[int]
    """The same by the second of the contact."""


class Results(Record):
    """Results of a campaign so far."""

    campaign_id: str
    state: State
    complete: bool
    """Whether these are the final results."""
    adjustments: tuple[Adjustment, ...] = ()
    """What its episodes use otherwise than it was asked for, such as an ODD beyond what a family supports."""
    headline: int | None = None  # as in the campaign's progress
    headline_published: int | None = None
    runs: list[RunResult]
    totals: list[Total]


class ScenarioCheck(Record):
    """Result of a check: scenes played without an attack."""

    name: str
    scenes: int
    """Drawn at random."""
    played: int
    refused: Mapping[str, int]
    """Scenes by the rule that refused them: `constraint`, `scenario` or a rule of C_hard."""
    contacts: int
    """Episodes in which the default ego touched something although no adversary attacked."""
    invalid: tuple[str, ...]
    """Why episodes could not be played to their end."""
    out_of_reach: tuple[str, ...]
    """Adversaries that in no scene can come near the ego's way."""
    without_effect: tuple[str, ...]
    """Parameters that change no start, whatever their value."""
    seconds: float
    """Simulated time of all episodes."""
    remarks: tuple[str, ...] = ()
    """What is to be mended, one sentence each."""


class ScenarioParameterRow(Record):
    """A parameter of a scenario."""

    name: str
    unit: str
    meaning: str
    range: tuple[float, float] | None
    words: tuple[str, ...] | None


class ScenarioSummary(Record):
    """A scenario in a list."""

    name: str
    """That campaigns name it by."""
    shipped: bool
    created_at: datetime | None
    """Null of a shipped one."""
    summary: str
    tags: tuple[str, ...]
    parameters: list[ScenarioParameterRow]
    actors: list[str]
    horizon_s: float | str
    """A number, or arithmetic over parameters."""
    like: str | None
    """Shipped family whose prior fits."""
    episode_s: Mapping[str, float] = {}
    """Method → slot seconds of an episode, in lists: median over the newest runs."""


class ScenarioList(Record):
    """All scenarios: those that ship, then the project's own, newest first."""

    items: list[ScenarioSummary]


class ScenarioDetails(ScenarioSummary):
    """A scenario with its document."""

    document: str
    """As YAML."""


def summary_of(name: str, document: Scenario, created_at: datetime | None = None) -> ScenarioSummary:
    """Returns a scenario as lists show it; shipped if without a time."""
    return ScenarioSummary(
        name=name,
        shipped=created_at is None,
        created_at=created_at,
        summary=document.summary,
        tags=document.tags,
        parameters=[
            ScenarioParameterRow(name=key, unit=p.unit, meaning=p.meaning, range=p.range, words=p.words)
            for key, p in document.parameters.items()
        ],
        actors=list(document.actors),
        horizon_s=document.horizon_s,
        like=None if document.like is None else document.like.family,
    )
