"""Violations of requirements, with and without contact, and how they were judged."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any

from pydantic import AliasChoices, BeforeValidator, Field

from risk_sac.records.base import Least, Real, Record

REPEATS = "repeats"  # rule that a violation fails if its replay goes another way; asked of nothing else
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


NO_CONTACT = "no_contact"  # the requirement that a contact violates


class ConflictType(StrEnum):
    """How the striker came into the ego's way, or the ego into the striker's."""

    CUT_IN = "cut_in"
    MERGE = "merge"  # the ego came over to a vehicle beside it, which kept its lane
    LEADER = "leader"
    PEDESTRIAN = "pedestrian"
    CROSSING = "crossing_vehicle"


class Grade(StrEnum):
    """Whether a reference driver would have prevented a valid failure; PCR counts `PREVENTABLE`."""

    PREVENTABLE = "preventable"  # by at least one of `risk_sac.verdicts.reference.PREVENTING`
    FULL_BRAKING = "full_braking"  # only by full braking at once
    UNAVOIDABLE = "unavoidable"

    @classmethod
    def _missing_(cls, value: object) -> "Grade | None":
        """Reads what definitions 6 and older called them."""
        return {"careful": cls.PREVENTABLE, "ideal": cls.FULL_BRAKING}.get(str(value))


class Fault(StrEnum):
    """Which party caused a valid failure; see `risk_sac.verdicts`, README.md."""

    EGO = "ego"
    SHARED = "shared"
    OTHER = "other"


class Severity(StrEnum):
    """How bad a contact is, by closing speed and risk of injury; see `risk_sac.verdicts.severity`."""

    MINOR = "minor"  # between vehicles that close at less than 2 m/s
    MODERATE = "moderate"
    SEVERE = "severe"  # a risk of 1 % or more that a pedestrian dies, or an occupant is seriously injured


def _early(name: str) -> Any:
    """A minimum that ends 1 s before the contact is called so; under its plain name in what was stored before."""
    return Field(validation_alias=AliasChoices(f"early_{name}", name), serialization_alias=f"early_{name}")


def _renamed(drivers: Any) -> Any:
    """Reads what definitions 6 and older called the reference drivers."""
    names = {"careful": "r157", "ideal": "full_braking"}
    return {names.get(name, name): each for name, each in drivers.items()} if isinstance(drivers, Mapping) else drivers


class ReferenceOutcome(Record):
    """How a reference driver fares in the ego's place."""

    avoids: bool
    """No contact, or it stands when it is struck, or is struck from behind; false if it passed the striker before."""
    impact_speed_mps: Real
    """The reference driver's speed at its contact, or where it has passed the ego; 0 if it avoids."""


class EgoPart(Record):
    """What the ego did about the striker: facts, from the frames up to the contact."""

    seen_s: Real
    """How long it had seen the striker without a break."""
    braked_after_s: float | None
    """From the beginning of the conflict to its first braking of 1.5 m/s² or more; null if it never braked so."""
    braking_mps2: Real
    """Its hardest braking in the conflict."""
    possible_mps2: Real
    """The hardest that car and road allow."""
    gained_mps: Real
    """Speed that it gained during the conflict while it saw the striker; 0 if none."""
    started: bool
    """Whether it stood, and started while it saw the striker."""
    sight_mps: float | None
    """The speed from which it could have stopped within its sight when the striker came into view; null where the
    striker was in view before."""
    left_first: str | None
    """ego | striker: which first left RSS's proper response; null if neither did."""


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
    """In the last second before the contact: none | late_braking | braking | standing | starting | accelerating"""
    ground: str
    """lane | junction | crossing | beside_crossing: where the striker was struck."""
    broke: tuple[str, ...]
    """What the striker broke: red_light, priority, wrong_direction, speeding, pedestrian_on_red, unsafe_lane_change,
    brake_check, turned_into_path."""
    ego_broke: tuple[str, ...] = ()
    """What the ego broke: red_light, priority, wrong_direction, speeding, off_road. Empty in older records."""
    severity: Severity | None = None
    """minor | moderate | severe. Null in older records."""
    injury_risk: float | None = None
    """Risk that the pedestrian dies, or an occupant is seriously injured (MAIS 3 or more). Null in older records."""
    unresponsive: bool
    """A visible collision course of 1.5 s or more during which the ego never braked."""
    grade: Grade | None
    """preventable | full_braking (by that only) | unavoidable; null where it is not valid."""
    drivers: Annotated[Mapping[str, ReferenceOutcome], BeforeValidator(_renamed)]
    """Reference driver → how it fares; empty where the contact is not valid."""
    ego_part: EgoPart | None = None
    """What the ego did about the striker. Null where the contact is not valid, and in older records."""
    fault: Fault | None = None
    """ego | shared | other. Null where the contact is not valid, and in older records."""
    signature: str
    """The class of failures it belongs to, in words; what differs in it is distinct."""


class Violated(Record):
    """What all violations have in common: the rules they are valid by."""

    verdicts: Mapping[str, bool] = {}
    """Validity rule → passed."""

    @property
    def valid(self) -> bool:
        """Whether every validity rule passed."""
        return all(self.verdicts.values())

    @property
    def broken(self) -> tuple[str, ...]:
        """The rules that it failed."""
        return tuple(rule for rule, passed in self.verdicts.items() if not passed)

    @property
    def artefact(self) -> bool:
        """Whether the simulator or the control made it, by one of `ARTEFACT_RULES`."""
        return not ARTEFACT_RULES.isdisjoint(self.broken)

    @property
    def graded(self) -> Grade | None:
        """Which reference driver would have prevented it; None where it is not valid, or was never judged."""
        raise NotImplementedError

    @property
    def blamed(self) -> Fault | None:
        """Which party caused it; None where it is not valid, or was never judged."""
        raise NotImplementedError

    @property
    def prevention(self) -> Mapping[str, bool]:
        """Reference driver → whether it would have prevented it; empty where none was asked."""
        raise NotImplementedError

    @property
    def preventable(self) -> bool:
        """Whether it is valid and a reference driver would have prevented it."""
        return self.valid and self.graded is Grade.PREVENTABLE

    @property
    def avoidable(self) -> bool:
        """Whether it is valid, and a reference driver or full braking at once would have prevented it."""
        return self.valid and self.graded in (Grade.PREVENTABLE, Grade.FULL_BRAKING)


class Violation(Violated):
    """A requirement that counts and was violated without contact. Times count from the release."""

    requirement: str
    time_s: Real
    """When it was first violated."""
    robustness: Real
    """The least since the release, in scales."""
    other_id: str | None
    """The actor that mattered most: the one the ego would have met soonest at that time; null without one."""
    other_kind: str | None
    """vehicle | pedestrian"""
    other_role: str | None
    """adversary | background"""
    ego_speed_mps: Real
    """At that time."""
    ego_manoeuvre: str
    """straight | left_turn | right_turn | lane_change"""
    hidden: bool
    """Whether the ego knew nothing of the actor at that time."""
    broke: tuple[str, ...]
    """The ego's own offences up to that time."""
    grade: Grade | None
    """preventable | full_braking (by that only) | unavoidable; null where it is not valid."""
    drivers: Annotated[Mapping[str, bool], BeforeValidator(_renamed)]
    """Reference driver → whether it keeps the requirement in the same encounter; empty where it is not valid."""
    fault: Fault | None = None
    """ego | shared | other. Null where it is not valid, and in older records."""
    signature: str
    """The class of failures it belongs to, in words; what differs in it is distinct."""
    definitions: int
    """Version of the definitions it was judged by."""

    @property
    def graded(self) -> Grade | None:
        """See `Violated.graded`."""
        return self.grade

    @property
    def blamed(self) -> Fault | None:
        """See `Violated.blamed`."""
        return self.fault

    @property
    def prevention(self) -> Mapping[str, bool]:
        """See `Violated.prevention`."""
        return self.drivers

    @property
    def event(self) -> str:
        """What the ego does, such as "violates never_fast after 3.4 s, at 13.2 m/s"."""
        return f"violates {self.requirement} after {self.time_s:.1f} s, at {self.ego_speed_mps:.1f} m/s"


class RequirementResult(Record):
    """How far an episode kept one requirement after the adversaries' release."""

    counts: str
    """failure | report"""
    robustness: Least
    """The least, in scales; below 0 it was violated."""
    violated_s: float | None
    """When it was first violated, from the release; null if it was kept. Of `no_contact`: when the bodies touched."""


class Collision(Violated):
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
    """The closing speed: of either body as seen from the other."""
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
    judgement: Judgement | None = None
    """Null in what was stored before contacts were judged."""

    @property
    def requirement(self) -> str:
        """The requirement that a contact violates."""
        return NO_CONTACT

    @property
    def graded(self) -> Grade | None:
        """See `Violated.graded`."""
        return None if self.judgement is None else self.judgement.grade

    @property
    def blamed(self) -> Fault | None:
        """See `Violated.blamed`."""
        return None if self.judgement is None else self.judgement.fault

    @property
    def prevention(self) -> Mapping[str, bool]:
        """See `Violated.prevention`."""
        return {name: each.avoids for name, each in self.judgement.drivers.items()} if self.judgement else {}

    @property
    def severity(self) -> Severity | None:
        """How bad it is; None in older records."""
        return None if self.judgement is None else self.judgement.severity

    @property
    def severity_in_words(self) -> str:
        """Such as "severe: closing speed 11.0 m/s, risk of death 3.5 %"; empty in older records."""
        if self.judgement is None or self.judgement.severity is None:
            return ""
        risk = "death" if self.other_kind == "pedestrian" else "serious injury"
        return (
            f"{self.judgement.severity}: closing speed {self.relative_speed_mps:.1f} m/s, "
            f"risk of {risk} {100 * (self.judgement.injury_risk or 0.0):.1f} %"
        )

    @property
    def event(self) -> str:
        """What the ego does, such as "touches lead at 9.0 m/s"."""
        return f"touches {self.other_id} at {self.ego_speed_mps:.1f} m/s"

    @property
    def signature(self) -> str:
        """Its judgement's; of a contact stored before contacts were judged, its striker."""
        if self.judgement is None:
            return f"unjudged {self.other_role} {self.other_kind}"
        return self.judgement.signature
