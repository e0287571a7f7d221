"""What is stored and told of episodes and runs, all frozen. The public bodies derive from these records."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import AliasChoices, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema

from risk_sac.rules import ARTEFACT_RULES


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
    """Who would have prevented a valid failure; PCR counts `CAREFUL`."""

    CAREFUL = "careful"  # the careful driver would not have touched: preventable
    IDEAL = "ideal"  # full braking at once alone would not have
    UNAVOIDABLE = "unavoidable"


class Record(BaseModel):
    """What the records share that are stored and told. A field is declared here and nowhere else.

    As JSON, in the folder of a run and between processes, a number that is not finite is the string "Infinity",
    "-Infinity" or "NaN", so that it reads back. Only the public bodies, which derive from these records, say null.
    """

    model_config = ConfigDict(
        frozen=True, ser_json_inf_nan="strings", serialize_by_alias=True, use_attribute_docstrings=True
    )


def _nothing_was_least(value: Any) -> Any:
    return math.inf if value is None else value


Real = Annotated[float, WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "null"}]})]
Least = Annotated[Real, BeforeValidator(_nothing_was_least)]
"""The least of some values, infinite without any; folders from before infinities were strings have null for it."""


def _early(name: str) -> Any:
    """A minimum that ends 1 s before the contact is called so; under its plain name in what was stored before."""
    return Field(validation_alias=AliasChoices(f"early_{name}", name), serialization_alias=f"early_{name}")


class ReferenceOutcome(Record):
    """How a reference driver fares in the ego's place."""

    avoids: bool
    """Does not touch, or stands when it is struck, or is struck from behind; who has passed by then has not."""
    impact_speed_mps: Real
    """Of the reference driver at its contact, or where it has passed the ego; 0 if it avoids."""


class Judgement(Record):
    """How a contact came about, and who would have prevented it. Times count from the adversaries' release."""

    definitions: int
    """Version of the definitions it was judged by."""
    conflict_type: ConflictType
    """How the striker came into the ego's way."""
    conflict_s: Real
    """When the conflict began; negative before the release."""
    noticed_s: float | None = None
    """The same for a wary driver, to whom whoever hangs over its line beside the ego is in conflict, and whoever could
    not stop by braking gently; `conflict_after_release` goes by it. Null in what is older than the difference."""
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
    """Who would have prevented it: the careful driver, only an ideal one, or nobody; null where it is not valid."""
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
    """Whether SUMO lists the collision within 0.3 s; null for pedestrians, whom it does not know, and for an ego that
    it does not drive."""
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
    """Rule that rejected the scene, sim_crash, the validity rules that the contact failed, or how the ego failed:
    ego_deadline, ego_malformed, ego_crash, ego_off_road; else empty."""
    steps: int
    risk_return: Real
    """Σ R_risk, of the risk reward alone."""
    shaped_return: Real
    """Σ R', of the reward that was trained on."""
    mean_cost: Real
    """Mean C_soft over the executed steps."""
    min_ttc_s: Least
    """Over the whole episode, the contact included, and so 0 if there is one; null in a record without any."""
    min_robustness: Least
    """Soft minimum of the requirements, over the whole episode too."""
    objective: float | None
    """f_e; null until the scene optimiser was told."""
    dual_variable: Real
    """λ after the episode."""
    temperature: Real
    """α after the episode."""
    environment_steps: int
    """Of the run, up to and including this episode."""
    script: tuple[float, ...] | None = None
    """Genes of the scripts that the adversaries followed, see `risk_sac.scripts`; null where a policy drove them."""
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


class RunMetrics(Record):
    """What a run has achieved so far; rates come with their 95 % interval.

    Fields with a default can be read from what was stored before they were counted.
    """

    episodes: int
    """Finished, rejected scenes included."""
    rejected: int
    """Scenes that were physically infeasible and not simulated."""
    raw_collisions: int
    """Episodes in which the ego touched something."""
    failures: int
    """Valid collisions."""
    invalid: int = 0
    """Episodes in which the ego failed to drive; the rates leave them out."""
    environment_steps: int
    ecr: Real
    """Effective collision rate: valid collisions / episodes."""
    ecr_low: Real
    ecr_high: Real
    window_ecr: Real
    """ECR over the newest 100 episodes."""
    pcr: Real = 0.0
    """Preventable collision rate: valid collisions that the careful driver would have prevented / episodes."""
    pcr_low: Real = 0.0
    pcr_high: Real = 1.0
    window_pcr: Real = 0.0
    """PCR over the newest 100 episodes."""
    efficiency: Real
    """Exploration efficiency ES in [0, 1]; 1 means a failure at once."""
    cost_rate: Real
    """Mean realism cost per step, in [0, 1]."""
    dispersion: float | None
    """Outcome feature dispersion of the failures, in [0, 1]; null with fewer than two."""
    dual_variable: Real
    """λ."""
    temperature: Real
    """α."""
    distinct_failures: int = 0
    """Valid collisions that resemble no earlier one: another signature, or other outcome features."""
    steps_per_distinct_failure: float | None = None
    """Environment steps per distinct failure; null without one."""
    preventable: int = 0
    """Valid collisions that the careful driver would have prevented, repetitions included."""
    avoidable: int = 0
    """These, and those that only full braking at once would have prevented."""
    distinct_preventable: int = 0
    """The distinct ones among them: the last step of the funnel contacts → valid → distinct → preventable."""
    covered: int = 0
    """Kinds of failures found: cells of the fixed taxonomy that a valid collision lies in."""
    artefacts: int = 0
    """Contacts that the simulator or the control made."""
    unresponsive: int = 0
    """Valid collisions with a visible collision course of 1.5 s or more during which the ego never braked."""
    signatures: Mapping[str, int] = {}
    """Signature → valid collisions, in the order in which they were first met."""
    conflicts_by_second: tuple[int, ...] = ()
    """Valid collisions by the second after the adversaries' release in which the conflict began."""
    contacts_by_second: tuple[int, ...] = ()
    """The same by the second of the contact."""
