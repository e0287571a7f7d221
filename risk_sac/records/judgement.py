"""Judgement of a contact: origin, ego's part, verdict; plausibility of failures."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Literal

from risk_sac.records.base import Real, Record


class PlausibilityClass(StrEnum):
    """Class of what the adversaries did, by its probability among road users."""

    ORDINARY = "ordinary"  # 1 in 100 or more
    RARE = "rare"  # 1 in 10,000 or more
    IMPLAUSIBLE = "implausible"


class BehaviourFact(Record):
    """The least likely value of one feature of one adversary."""

    actor: str
    """Its id."""
    feature: str
    """Such as lane_change_gap; see `risk_sac.risk.driving`."""
    value: Real
    """In the feature's unit."""
    time_s: Real
    """From the release."""
    times: int
    """How often the adversary did such a thing."""
    probability: float
    """Share of such events among road users with a value at least as unlikely."""
    published: bool
    """Whether the distribution is published; one of SUMO's drivers makes a failure rare at most."""


class Plausibility(Record):
    """Probability that road users do what the adversaries did."""

    verdict: PlausibilityClass
    """ordinary | rare | implausible: the worse of the two that follow."""
    least_probability: float
    """Least probability of a feature, corrected for the number of features (Holm)."""
    joint_probability: float
    """Probability that all features together are at least as unlikely."""
    facts: tuple[BehaviourFact, ...]
    """All features of all adversaries that acted, the least likely first."""
    sentence: str
    """The least likely feature in words; empty if no adversary acted."""

    @property
    def in_words(self) -> str:
        """Such as "rare: left brakes by 7.0 m/s²: 1 of 970 stops"."""
        return f"{self.verdict}: {self.sentence}" if self.sentence else f"{self.verdict}"

    @property
    def plausible(self) -> bool:
        """Whether it is ordinary or rare."""
        return self.verdict is not PlausibilityClass.IMPLAUSIBLE


class ConflictType(StrEnum):
    """Way in which striker and ego came into conflict."""

    CUT_IN = "cut_in"
    MERGE = "merge"  # the ego came over to a vehicle beside it, which kept its lane
    LEADER = "leader"
    PEDESTRIAN = "pedestrian"
    CROSSING = "crossing_vehicle"


class Grade(StrEnum):
    """Whether a reference driver prevents a valid failure; PCR counts `PREVENTABLE`."""

    PREVENTABLE = "preventable"  # by at least one of the drivers that `judge.drivers` of the spec names
    FULL_BRAKING = "full_braking"  # only by full braking at once
    UNAVOIDABLE = "unavoidable"

    @classmethod
    def _missing_(cls, value: object) -> "Grade | None":
        """Reads what definitions 6 and older called them."""
        return {"careful": cls.PREVENTABLE, "ideal": cls.FULL_BRAKING}.get(str(value))


class Fault(StrEnum):
    """Party that caused a valid failure; see `risk_sac.verdicts`, README.md."""

    EGO = "ego"
    SHARED = "shared"
    OTHER = "other"


class Severity(StrEnum):
    """Severity of a contact, by impact speed and risk of injury.

    See `risk_sac.verdicts.labels`.
    """

    MINOR = "minor"  # an impact speed below 2 m/s
    MODERATE = "moderate"
    SEVERE = "severe"  # a risk of 1 % or more that a pedestrian dies, or an occupant is seriously injured


GAINS_MPS = 1.0  # more than SUMO's drivers dawdle
TOO_FAST = 1.1  # times the speed that the sight allows


class ReferenceOutcome(Record):
    """Outcome of a reference driver in the ego's place."""

    avoids: bool
    """No contact, or it stands when it is struck, or is struck from behind; false if it passed the striker before."""
    impact_speed_mps: Real
    """The reference driver's speed at its contact, or where it has passed the ego; 0 if it avoids."""


class EgoPart(Record):
    """The ego's reaction to the striker: facts from frames up to contact."""

    seen_s: Real
    """How long it had seen the striker without a break."""
    braked_after_s: float | None
    """From the beginning of the conflict to its first braking of 1.5 m/s² or more; null if it never braked so."""
    braking_mps2: Real
    """Its hardest braking in the conflict."""
    possible_mps2: Real
    """The hardest that car and road allow."""
    gained_mps: Real
    """Speed that it gained from 1.15 s after it could see the striker in its way, or on the carriageway beside it."""
    started: bool
    """Whether it stood or braked, and then drove on while it saw the striker in its way or beside it."""
    sight_mps: float | None
    """The speed from which it could have stopped within its sight when the striker came into view; null where the
    striker was in view all along, or not ahead."""
    sighted_mps: float | None
    """Its own speed then; null where `sight_mps` is."""
    left_first: str | None
    """ego | striker: which first left RSS's proper response; null if neither did, or both at once."""

    @property
    def sped_up(self) -> bool:
        """Whether it gained 1 m/s or more though it saw the striker."""
        return self.gained_mps >= GAINS_MPS

    @property
    def too_fast(self) -> bool:
        """Whether it was over 10 % faster than its sight allowed."""
        return self.sight_mps is not None and (self.sighted_mps or 0.0) > TOO_FAST * self.sight_mps

    @property
    def in_words(self) -> str:
        """Describes the reaction, after "the ego": "braked 1.1 s after …"."""
        told = [self._braked]
        gained = f"gained {self.gained_mps:.1f} m/s" if self.sped_up else ""
        if self.started or self.sped_up:
            told.append(" and ".join(filter(None, ("drove on" * self.started, gained))) + " though it saw the striker")
        if self.too_fast:
            told.append(f"drove at {self.sighted_mps:.1f} m/s where its sight allowed {self.sight_mps:.1f} m/s")
        if self.left_first == "ego":
            told.append("was the first to leave RSS's proper response")
        return "; it ".join(told)

    @property
    def _braked(self) -> str:
        if self.braked_after_s is None:
            return "did not brake in the conflict"
        if self.braked_after_s == 0.0:
            when = "was braking when the conflict began"
        else:
            when = f"braked {self.braked_after_s:.1f} s after the conflict began"
        return f"{when}, by {self.braking_mps2:.1f} of {self.possible_mps2:.1f} m/s²"


Harm = Literal["death", "serious injury"]


class Judgement(Record):
    """Origin of a contact, and reference drivers that would have prevented it.

    Times count from the release.
    """

    definitions: int
    """Version of the definitions it was judged by."""
    conflict_type: ConflictType
    """How the striker came into the ego's way."""
    conflict_s: Real
    """When the conflict began; negative before the release."""
    noticed_s: Real
    """The same for a wary driver, for which an actor that hangs over its line or could not stop gently is in conflict;
    `conflict_after_release` goes by it."""
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
    ego_broke: tuple[str, ...]
    """What the ego broke: red_light, priority, wrong_direction, speeding, off_road."""
    severity: Severity
    """minor | moderate | severe."""
    impact_mps: Real
    """Speed that the severity follows: across the surface where the bodies touch, that at which two bodies close, or
    the ego's own towards a pedestrian."""
    injury_risk: float
    """Risk of that harm to the road user who is worse off."""
    harm: Harm
    """death, of a pedestrian or cyclist | serious injury, MAIS 3 or more, of a motorcyclist or an occupant."""
    unresponsive: bool
    """A visible collision course of 1.5 s or more during which the ego never braked."""
    grade: Grade | None
    """preventable | full_braking (by that only) | unavoidable; null where it is not valid."""
    drivers: Mapping[str, ReferenceOutcome]
    """Reference driver → how it fares; empty where the contact is not valid."""
    ego_part: EgoPart | None
    """What the ego did about the striker. Null where the contact is not valid."""
    fault: Fault | None
    """ego | shared | other. Null where the contact is not valid."""
    plausibility: Plausibility | None
    """How likely road users do what the adversaries did. Null where the contact is not valid."""
    kind: str
    """What a person tells apart, in words: the striker and its direction, whether it was hidden, the ego's
    manoeuvre."""
    variant: str
    """All else that tells failures of one kind apart, in words."""
