"""Episode: how it ended, what it violated, and how people triaged it."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any, Literal, NamedTuple, get_args

from risk_sac.records.base import Least, Page, Real, Record
from risk_sac.records.run import DrivenBy, Funnel
from risk_sac.records.violation import Collision, RequirementResult, Violation, valid_violations, worst_of
from risk_sac.world.types import Series


class Outcome(StrEnum):
    """Outcome of an episode; exactly one holds."""

    REJECTED = "rejected"  # C_hard refused the scene; nothing was simulated
    SAFE = "safe"  # no requirement that counts was violated
    DEGENERATE = "degenerate"  # one was, and a validity rule refused the violation
    FAILURE = "failure"  # one was, and the violation is valid
    INVALID = "invalid"  # the ego failed to answer; no rate counts it


Phase = Literal["search", "evaluation", "iid"]
PHASES: tuple[Phase, ...] = get_args(Phase)  # `iid` alone bounds how often the ego fails; nothing pools it
_ID = re.compile(r"(?:([^\0]*)-)?([a-z]+)-([0-9]{1,9})")


@dataclass(frozen=True, slots=True)
class EpisodeId:
    """The parts of an episode's id."""

    run_id: str  # empty if the text names none
    phase: Phase
    index: int

    def __str__(self) -> str:
        return f"{self.run_id}-{self.phase}-{self.index}"

    @classmethod
    def parse(cls, text: str) -> "EpisodeId | None":
        """Splits an id; None if it is malformed."""
        parts = _ID.fullmatch(text)
        phase = next((phase for phase in PHASES if parts and phase == parts[2]), None)
        return cls(parts[1] or "", phase, int(parts[3])) if parts and phase else None


class StoryDeviation(Record):
    """Largest distance of an actor from the scenario's story."""

    speed_mps: Real
    lateral_mps: Real
    """Of its speed across."""
    along_m: Real
    across_m: Real
    trigger_s: Real = 0.0
    """How much later or earlier a trigger of its story fired."""


class EpisodeRecord(Record):
    """Episode as stored, streamed and counted; plain values, for JSON."""

    index: int
    """0-based within the run, rejected scenes included."""
    phase: Phase
    seed: int
    scene: Mapping[str, Real]
    outcome: Outcome
    reason: str
    """What rejected the scene, rules that refused its violations, sim_crash, ego_deadline, ego_malformed, ego_crash, or
    empty."""
    failed: tuple[str, ...] = ()
    """Requirements that count and were validly violated."""
    steps: int
    risk_return: Real
    """Σ R_risk, of the risk reward alone."""
    shaped_return: Real
    """Σ R', of the reward that was trained on."""
    mean_cost: Real
    """Mean C_soft over the executed steps."""
    min_ttc_s: Least
    """Over the whole episode; 0 with a contact, null without any."""
    min_robustness: Least
    """Soft minimum of the requirements."""
    objective: float | None
    """f_e; null before the scene optimiser has it."""
    dual_variable: Real
    """λ after the episode."""
    temperature: Real
    """α after the episode."""
    environment_steps: int
    """Of the run, up to and including this episode."""
    driven_by: DrivenBy | None = None
    """What drove the adversaries, or would have in a rejected scene; null: nothing did."""
    script: tuple[float, ...] | None = None
    """Genes of the adversaries' scripts; null where a policy drove."""
    requirements: Mapping[str, RequirementResult] = {}
    """Requirement → how far it was kept."""
    violations: tuple[Violation, ...] = ()
    """Violations without contact of requirements that count."""
    collision: Collision | None = None
    start_danger: str | None = None
    """Rule for safe starts that the start of a story breaks, which is played all the same; null: none."""
    defect_reached_s: float | None = None
    """When a planted defect first changed a command, from the release; null if none did."""
    deviations: Mapping[str, StoryDeviation] = {}
    """Actor → how far it was from the scenario's story; without those that never left it."""
    avoided_by: Mapping[str, bool] | None = None
    """r157 | fsm → whether this driver avoids a contact where an ego kept its lane and its first speed. Null but for
    methods that play a scenario as it is written, and where nothing was played."""

    @property
    def valid_violations(self) -> tuple[Collision | Violation, ...]:
        """Lists valid violations of requirements that count, a contact first.

        They make the episode a failure.
        """
        return valid_violations(self.collision, self.violations)

    @property
    def worst_violation(self) -> Collision | Violation | None:
        """Violation that names the episode: `worst_of`, else contact, else first."""
        return worst_of(self.valid_violations) or self.collision or next(iter(self.violations), None)

    def refused_by(self, rule: str) -> tuple[str, ...]:
        """Requirements whose violations fail a rule."""
        found: tuple[Collision | Violation | None, ...] = (self.collision, *self.violations)
        return tuple(each.requirement for each in found if each is not None and rule in each.broken)

    def id_in(self, run_id: str) -> str:
        """Returns the episode's name, unique within a campaign."""
        return str(EpisodeId(run_id, self.phase, self.index))

    @property
    def searching(self) -> bool:
        """Whether it belongs to the search, not to the policy's evaluation."""
        return self.phase == "search"

    @property
    def evaluating(self) -> bool:
        """Whether it belongs to the evaluation of the frozen policy.

        That is the second phase of a run that has one.
        """
        return self.phase == "evaluation"

    def refused(self, rule: str, requirements: Collection[str]) -> "EpisodeRecord":
        """Returns a copy whose valid violations of these requirements fail `rule`."""
        if not any(each.requirement in requirements for each in self.valid_violations):
            return self
        ungraded: dict[str, Any] = {"grade": None, "drivers": {}}  # drivers are asked of what is valid alone
        violations = tuple(
            each.model_copy(update={"verdicts": {**each.verdicts, rule: False}, **ungraded})
            if each.requirement in requirements
            else each
            for each in self.violations
        )
        collision = self.collision
        if collision is not None and collision.requirement in requirements:
            judgement = collision.judgement.model_copy(update=ungraded)
            verdicts = {**collision.verdicts, rule: False}
            collision = collision.model_copy(update={"verdicts": verdicts, "judgement": judgement})
        told = {"collision": collision, "violations": violations}
        return self.model_copy(update=told | Ending.of(collision, violations)._asdict())


class Ending(NamedTuple):
    """Ending of an episode, by its violations of requirements that count."""

    outcome: Outcome
    reason: str
    failed: tuple[str, ...]

    @classmethod
    def of(cls, collision: Collision | None, violations: Sequence[Violation]) -> "Ending":
        """The ending of an episode with these violations."""
        found: list[Collision | Violation] = [] if collision is None else [collision]
        found += violations
        failed = tuple(each.requirement for each in found if each.valid)
        if failed or not found:
            return cls(Outcome.FAILURE if failed else Outcome.SAFE, "", failed)
        return cls(Outcome.DEGENERATE, ", ".join(dict.fromkeys(rule for each in found for rule in each.broken)), ())


@dataclass(frozen=True, slots=True)
class SeriesFile:
    """The time series of an episode, below `failures/` in the run's folder."""

    name: str
    sha256: str  # as it was written, whatever became of it since


class Repetition(Record):
    """Replays of an episode, each in a fresh process, and their result."""

    times: int
    same: int
    """Of these, with every array of its series as it was, to the bit."""

    @property
    def verified(self) -> bool:
        """Whether it was the same each time; if not, it is flaky."""
        return self.same == self.times > 0


class Episode(EpisodeRecord):
    """One episode of a campaign."""

    id: str
    run_id: str
    wall_s: float
    funnel: Funnel | None = None
    """What the run's phase has found so far."""
    repetition: Repetition | None = None
    """Of the first failure of its kind, once the run has ended."""


FailureOrder = Literal["arrival", "weight"]
"""Of a list of failures: `weight` is that of `ranking_weight`, the largest first."""


class EpisodePage(Page[Episode]):
    """Episodes, in order of arrival unless another order was asked for."""


class TriageState(StrEnum):
    """State that people gave a failure; any may follow any."""

    NEW = "new"
    CONFIRMED = "confirmed"
    DISMISSED = "dismissed"
    FIXED = "fixed"


class Triage(Record):
    """Assessment of a failure by people."""

    state: TriageState
    comment: str
    changed_at: datetime


class Failure(Episode):
    """A failure, valid or refused, with its full time series."""

    series: Series | None
    """Null when the record is lost; `series_problem` says why."""
    series_problem: str | None
    triage: Triage | None = None
    """What people made of it; null before that."""
