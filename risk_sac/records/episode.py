"""One episode: how it ended, how its contact came about, and what people made of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Any, Literal

from pydantic import AliasChoices, Field

from risk_sac.records.base import Least, Page, Real, Record
from risk_sac.records.run import Funnel
from risk_sac.series import Series

REPEATS = "repeats"  # rule that a contact fails if its replay goes another way; asked of nothing else
# Rules among a collision's verdicts that are about the simulator or the control, not about fault.
ARTEFACT_RULES = frozenset(
    {
        REPEATS,
        "no_teleport",
        "no_spawn_overlap",
        "conflict_after_release",
        "inside_limits",
        "inside_grip",
        "solid_bodies",
        "ego_model_saw",
    }
)


class Outcome(StrEnum):
    """How an episode ended; exactly one holds."""

    REJECTED = "rejected"  # C_hard refused the scene; nothing was simulated
    SAFE = "safe"  # the horizon passed without contact
    DEGENERATE = "degenerate"  # raw contact that a validity rule refused
    FAILURE = "failure"  # valid collision
    INVALID = "invalid"  # the ego failed to drive; no rate counts it


class ConflictType(StrEnum):
    """How the striker came into the ego's way."""

    CUT_IN = "cut_in"
    LEADER = "leader"
    PEDESTRIAN = "pedestrian"
    CROSSING = "crossing_vehicle"


class Grade(StrEnum):
    """Which reference driver would have prevented a valid failure; PCR counts `CAREFUL`."""

    CAREFUL = "careful"  # the careful driver would not have touched: preventable
    IDEAL = "ideal"  # full braking at once alone would not have
    UNAVOIDABLE = "unavoidable"


def _early(name: str) -> Any:
    """A minimum that ends 1 s before the contact is called so; under its plain name in what was stored before."""
    return Field(validation_alias=AliasChoices(f"early_{name}", name), serialization_alias=f"early_{name}")


class ReferenceOutcome(Record):
    """How a reference driver fares in the ego's place."""

    avoids: bool
    """No contact, or it stands when it is struck, or is struck from behind; false if it passed the striker before."""
    impact_speed_mps: Real
    """Of the reference driver at its contact, or where it has passed the ego; 0 if it avoids."""


class Judgement(Record):
    """How a contact came about, and which reference driver would have prevented it. Times count from the release."""

    definitions: int
    """Version of the definitions it was judged by."""
    conflict_type: ConflictType
    """How the striker came into the ego's way."""
    conflict_s: Real
    """When the conflict began; negative before the release."""
    noticed_s: float | None = None
    """The same for a wary driver, for which an actor that hangs over its line or could not stop gently is in conflict;
    `conflict_after_release` goes by it. Null in older records."""
    conflict_x_m: Real
    """Where the striker was then, on the map."""
    conflict_y_m: Real
    position: str
    """ahead | alongside: the striker, seen from the ego, when the conflict began."""
    hidden: bool
    """Whether the ego knew nothing of the striker when the conflict began."""
    ego_manoeuvre: str
    """straight | left_turn | right_turn | lane_change"""
    ego_response: str
    """none | late_braking | braking | standing | starting"""
    ground: str
    """lane | junction | crossing | beside_crossing: where the striker was struck."""
    broke: tuple[str, ...]
    """What the striker broke: red_light, priority, wrong_direction, speeding, pedestrian_on_red."""
    unresponsive: bool
    """A visible collision course of 1.5 s or more during which the ego never braked."""
    grade: Grade | None
    """careful | ideal | unavoidable: the driver that would have prevented it; null where it is not valid."""
    drivers: Mapping[str, ReferenceOutcome]
    """Reference driver → how it fares; empty where the contact is not valid."""
    signature: str
    """The class of failures it belongs to, in words; what differs in it is distinct."""


class Collision(Record):
    """The ego's first contact with another actor, with everything later tiers need to judge it."""

    time_s: Real
    """Since the adversaries' release."""
    other_id: str
    other_kind: str
    """vehicle | pedestrian"""
    other_role: str
    """adversary | background"""
    contact_x_m: Real
    """Contact point ahead of the ego's centre."""
    contact_y_m: Real
    """Contact point to the ego's left."""
    ego_zone: str
    """front | left | right | rear: where the contact lies on the ego."""
    other_zone: str
    """The same on the other body."""
    ego_speed_mps: Real
    other_speed_mps: Real
    relative_speed_mps: Real
    lateral_offset_m: Real
    """The other's centre across the ego's axis at contact."""
    min_ttc_s: Least = _early("min_ttc_s")
    """Until 1 s before the contact, at which it is 0 for every collision alike, as the episode's own minimum is."""
    min_rss_margin_m: Least
    visible_for_s: Real
    """How long the ego had known of the other without a break before contact, its memory included; 0 if unseen."""
    ego_peak_braking_mps2: Real
    min_robustness: Least = _early("min_robustness")
    """Soft minimum of the requirements, until 1 s before the contact too."""
    simulator_agrees: bool | None
    """Whether SUMO lists it within 0.3 s; null for pedestrians, bodies that part within the step, and an ego that SUMO
    does not drive."""
    verdicts: Mapping[str, bool] = {}
    """Validity rule → passed."""
    judgement: Judgement | None = None
    """Null in what was stored before contacts were judged."""

    @property
    def valid(self) -> bool:
        """Tier 2: every validity rule passed."""
        return all(self.verdicts.values())

    @property
    def broken(self) -> tuple[str, ...]:
        """The rules that it failed."""
        return tuple(rule for rule, passed in self.verdicts.items() if not passed)

    @property
    def artefact(self) -> bool:
        """Whether the simulator or the control made the contact, by one of `ARTEFACT_RULES`."""
        return not ARTEFACT_RULES.isdisjoint(self.broken)

    @property
    def preventable(self) -> bool:
        """Whether it is valid and the careful driver would have prevented it."""
        return self.valid and self.judgement is not None and self.judgement.grade is Grade.CAREFUL

    @property
    def avoidable(self) -> bool:
        """Whether it is valid, and the careful driver or full braking at once would have prevented it."""
        return self.valid and self.judgement is not None and self.judgement.grade is not Grade.UNAVOIDABLE


Phase = Literal["search", "evaluation", "iid"]
# As records and ids name a phase. Of `iid` alone a bound on how often the ego fails may be drawn; nothing pools it.
RECORDED: Mapping[Phase, str] = {"search": "train", "evaluation": "evaluate", "iid": "iid"}


class EpisodeRecord(Record):
    """One episode as stored, streamed and counted. Plain values only, so it is JSON as it stands."""

    index: int
    """0-based within the run, rejected scenes included."""
    phase: str
    """train | evaluate | iid"""
    seed: int
    scene: Mapping[str, Real]
    outcome: Outcome
    reason: str
    """Rule that rejected the scene, validity rules that the contact failed, sim_crash, ego_deadline, ego_malformed,
    ego_crash or ego_off_road; else empty."""
    steps: int
    risk_return: Real
    """Σ R_risk, of the risk reward alone."""
    shaped_return: Real
    """Σ R', of the reward that was trained on."""
    mean_cost: Real
    """Mean C_soft over the executed steps."""
    min_ttc_s: Least
    """Over the whole episode, so 0 if there is a contact; null in a record without any."""
    min_robustness: Least
    """Soft minimum of the requirements, over the whole episode too."""
    objective: float | None
    """f_e; null before the scene optimiser has it."""
    dual_variable: Real
    """λ after the episode."""
    temperature: Real
    """α after the episode."""
    environment_steps: int
    """Of the run, up to and including this episode."""
    script: tuple[float, ...] | None = None
    """Genes of the scripts that the adversaries followed; null where a policy drove them."""
    collision: Collision | None = None

    def id_in(self, run_id: str) -> str:
        """How the episode is called wherever it is spoken of, unique within a campaign."""
        return f"{run_id}-{self.phase}-{self.index}"

    @property
    def searching(self) -> bool:
        """Whether it belongs to the search, and not to the evaluation of the frozen policy."""
        return self.phase == RECORDED["search"]

    @property
    def evaluating(self) -> bool:
        """Whether it belongs to the evaluation of the frozen policy, the second phase of a run that has one."""
        return self.phase == RECORDED["evaluation"]

    def refused(self, rule: str) -> "EpisodeRecord":
        """The same episode, whose contact fails one more rule; without a contact, the episode itself."""
        if self.collision is None:
            return self
        judgement = self.collision.judgement
        if judgement is not None:  # drivers are asked of valid contacts alone
            judgement = judgement.model_copy(update={"grade": None, "drivers": {}})
        verdicts = {**self.collision.verdicts, rule: False}
        collision = self.collision.model_copy(update={"verdicts": verdicts, "judgement": judgement})
        ending = {"outcome": Outcome.DEGENERATE, "reason": ", ".join(collision.broken)}
        return self.model_copy(update={"collision": collision} | ending)


@dataclass(frozen=True, slots=True)
class SeriesFile:
    """The time series of an episode, below `failures/` in the run's folder."""

    name: str
    sha256: str  # as it was written, whatever became of it since


class Repetition(Record):
    """How often an episode was played again, in a fresh process each time, and what came of it."""

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
    """What the run's phase had found up to and including this episode; null in older records."""
    repetition: Repetition | None = None
    """Of the first failure of its kind, once the run has ended."""


class EpisodePage(Page[Episode]):
    """Episodes in the order of their arrival."""


class TriageState(StrEnum):
    """What people make of a failure; any may follow any."""

    NEW = "new"
    CONFIRMED = "confirmed"
    DISMISSED = "dismissed"
    FIXED = "fixed"


class Triage(Record):
    """What people made of a failure."""

    state: TriageState
    comment: str
    changed_at: datetime


class Failure(Episode):
    """A contact of the ego with its full time series."""

    series: Series | None
    """Null when the record is lost; `series_problem` says why."""
    series_problem: str | None
    triage: Triage | None = None
    """What people made of it; null before that."""
