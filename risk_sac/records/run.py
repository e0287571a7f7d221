"""One run: its state, what it has counted, and what it found."""

from collections.abc import Mapping
from datetime import datetime
from enum import StrEnum
from typing import Annotated

from pydantic import TypeAdapter, WithJsonSchema

from risk_sac.config import FamilyName, MethodName, RunMethod
from risk_sac.records.base import Real, Record


class DrivenBy(StrEnum):
    """Driver of the adversaries of an episode."""

    POLICY = "policy"  # the learner's own
    MODEL = "model"  # a script that the script model proposed
    SCRIPT = "script"  # one that was bred, is from the library, or is a fixed rule
    RANDOM = "random"  # random actions, or a script drawn at random


class Counts(Record):
    """Counts of the episodes of one run; several runs have their sums."""

    episodes: int = 0
    """Finished, rejected scenes included."""
    rejected: int = 0
    """Infeasible scenes."""
    raw_collisions: int = 0
    """Episodes with a contact."""
    collisions: int = 0
    """Valid contacts."""
    failures: int = 0
    """Episodes with a valid violation that counts."""
    distinct_failures: int = 0
    """Kinds of valid violations in their run."""
    variants: int = 0
    """The same by variant: kinds are divided into them."""
    preventable: int = 0
    """Failures that a reference driver prevents."""
    preventable_collisions: int = 0
    """Valid contacts that it prevents."""
    avoidable: int = 0
    """Valid contacts that it, or full braking at once, prevents."""
    distinct_preventable: int = 0
    """Kinds of violations that it prevents."""
    distinct_published: int = 0
    """Of these kinds, those that R157, FSM or RSS prevents."""
    headline_candidates: int = 0  # kinds of preventable violations that are plausible and not minor
    implausible: int = 0  # kinds of preventable violations that are not minor, but implausible
    artefacts: int = 0
    """Contacts made by simulator or control."""
    unresponsive: int = 0
    """Valid contacts after 1.5 s of visible collision course without braking."""
    invalid: int = 0
    """Those in which the ego failed to drive; in no rate."""
    environment_steps: int = 0

    @property
    def rated(self) -> int:
        """Episodes in rates: all but those where the ego failed to drive."""
        return self.episodes - self.invalid


class RequirementCounts(Record):
    """A requirement's funnel: violated → valid episodes → distinct → preventable kinds."""

    counts: str
    """failure | report"""
    violated: int = 0
    """Episodes that violated it after the adversaries' release."""
    valid: int = 0
    """Of these, the valid ones of a requirement that counts."""
    distinct: int = 0
    preventable: int = 0
    """Kinds of violations that a reference driver prevents."""
    published: int = 0
    """Of these kinds, those that R157, FSM or RSS prevents."""
    rate: Real = 0.0
    """`valid` / episodes; `violated` / episodes where it is reported only."""
    rate_low: Real = 0.0
    """95 % interval of Wilson."""
    rate_high: Real = 1.0

    @property
    def in_rate(self) -> int:
        """The episodes that `rate` counts."""
        return self.valid if self.counts == "failure" else self.violated


class DriverPcr(Record):
    """Valid contacts that a reference driver prevents, and share of all episodes."""

    prevented: int
    pcr: Real
    pcr_low: Real
    """95 % interval of Wilson."""
    pcr_high: Real


class RunMetrics(Counts):
    """Measures of a run so far, rates with their 95 % interval."""

    # Fields with a default can be read from what was stored before they were counted.

    headline: int | None = None
    """Null before a replay."""
    headline_kinds: tuple[str, ...] = ()
    headline_kinds_published: tuple[str, ...] = ()  # of these, those that R157, FSM or RSS prevents
    headline_kinds_driven_by: tuple[DrivenBy | None, ...] = ()  # what drove the first episode of each
    episodes_driven_by: Mapping[str, int] = {}
    """What drove the adversaries → episodes, rejected scenes included."""
    ecr: Real
    """Effective collision rate: valid contacts / episodes."""
    ecr_low: Real
    ecr_high: Real
    window_ecr: Real
    """ECR over the newest 100 episodes."""
    pcr: Real = 0.0
    """Preventable collision rate: valid contacts that a reference driver would have prevented / episodes."""
    pcr_low: Real = 0.0
    pcr_high: Real = 1.0
    window_pcr: Real = 0.0
    """PCR over the newest 100 episodes."""
    efficiency: Real
    """Exploration efficiency ES in [0, 1]; 1 means a failure at once."""
    cost_rate: Real
    """Mean realism cost per step, in [0, 1]."""
    dispersion: float | None
    """Outcome feature dispersion of the valid contacts, in [0, 1]; null with fewer than two."""
    dual_variable: Real
    """λ."""
    temperature: Real
    """α."""
    steps_per_distinct_failure: float | None = None
    """Environment steps per kind of failure; null without one."""
    covered: int = 0
    """Cells of the fixed taxonomy of contacts that a valid one lies in."""
    kinds: Mapping[str, int] = {}
    """Kind → valid violations, in the order in which they were first met."""
    prevented_by: Mapping[str, int] = {}
    """Reference driver → valid contacts that it prevents; `published` → those that R157, FSM or RSS prevents."""
    by_severity: Mapping[str, int] = {}
    """Severity → valid contacts."""
    by_fault: Mapping[str, int] = {}
    """Fault → failures, each by its worst violation."""
    requirements: Mapping[str, RequirementCounts] = {}
    """Requirement → its funnel."""
    conflicts_by_second: tuple[int, ...] = ()
    """Valid contacts by the second in which the conflict began."""
    contacts_by_second: tuple[int, ...] = ()
    """The same by the second of the contact."""


class Funnel(Record):
    """From contacts to what is worth a person's time.

    The steps after `contacts` count violations of every requirement that counts, and those after `valid` kinds.
    """

    contacts: int
    valid: int
    """Failures."""
    distinct: int
    preventable: int
    """Kinds of violations that a reference driver prevents."""
    published: int = 0
    """Of these kinds, those that R157, FSM or RSS prevents."""

    @classmethod
    def of(cls, metrics: RunMetrics) -> "Funnel":
        """The funnel of a run."""
        return cls(
            contacts=metrics.raw_collisions,
            valid=metrics.failures,
            distinct=metrics.distinct_failures,
            preventable=metrics.distinct_preventable,
            published=metrics.distinct_published,
        )


class State(StrEnum):
    """State of a campaign or a run."""

    QUEUED = "queued"
    RUNNING = "running"
    PAUSED = "paused"
    CANCELLING = "cancelling"
    CANCELLED = "cancelled"
    SUCCEEDED = "succeeded"
    FAILED = "failed"

    @property
    def final(self) -> bool:
        """Whether nothing follows this state."""
        return self in FINAL


FINAL = frozenset({State.CANCELLED, State.SUCCEEDED, State.FAILED})

# What another version knew can still be read; the schema names what this one knows.
Family = Annotated[str, WithJsonSchema(TypeAdapter(FamilyName).json_schema())]
SearchMethod = Annotated[str, WithJsonSchema(TypeAdapter(MethodName).json_schema())]
Method = Annotated[str, WithJsonSchema(TypeAdapter(RunMethod).json_schema())]


class RunSummary(Record):
    """Run of a campaign, or of its i.i.d. phase (methods `iid-`)."""

    id: str
    """Unique within the campaign."""
    family: Family
    method: Method
    seed: int
    state: State
    reason: str | None
    """Why it failed, is paused, or waits again."""
    metrics: RunMetrics | None
    """Of the search or the i.i.d. phase; null before an episode."""


class Run(RunSummary):
    """Progress of a run. Counts are sums of search and evaluation."""

    attempts: int
    """Workers that were started for it; more than one where some were lost."""
    processes: int | None = None
    """Processes that play its episodes, as many as slots were free when it started; null before."""
    started_at: datetime | None
    finished_at: datetime | None
    episodes_done: int
    episodes_total: int
    failures: int
    raw_collisions: int
    rejected: int
    distinct_failures: int
    preventable: int
    distinct_preventable: int
    distinct_published: int = 0


class RunResult(RunSummary):
    """Results of one run."""

    evaluation: RunMetrics | None
    """Of the frozen policy; null until, or unless, the budget has evaluation episodes."""
    spec_digest: str
    """Equal for runs that must give equal results."""
    digest: str | None
    """SHA-256 of the results; null until the run succeeded."""
    versions: Mapping[str, str]
    """Software that produced the results."""
    verified: int = 0
    """Distinct failures that were the same each time they were replayed."""
    flaky: int = 0
    """Those that were not."""
    busy_s: float
    """Wall time spent, interrupted attempts included."""
