"""Violations of requirements, with and without contact."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from risk_sac.records.base import Least, Real, Record
from risk_sac.records.judgement import Fault, Grade, Judgement, Plausibility, Severity

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
# Reference drivers by a regulation or a publication, which react to the conflict. `defensive` is our own, and slows
# before it, which the ego owes only where it could not see.
PUBLISHED = ("r157", "fsm", "rss")
FULL_BRAKING, TTC_RULE = "full_braking", "r157_ttc"
# The sentences below stand in the page's `ui/verdicts.ts` as well.
DRIVERS_IN_WORDS = {
    "r157": "R157's driver",
    "fsm": "the fuzzy safety model",
    "rss": "the RSS driver",
    "defensive": "the defensive driver",
    FULL_BRAKING: "full braking at once",
    TTC_RULE: "R157's time-to-collision rule",
}
# Choice: a class of severity weighs as much as a factor of ten in probability; no contact is as a moderate one.
SEVERITY_WEIGHTS: Mapping[Severity | None, float] = {
    Severity.MINOR: 0.01,
    Severity.MODERATE: 0.1,
    None: 0.1,
    Severity.SEVERE: 1.0,
}


def ranking_weight(severity: Severity | None, probability: float, density: float = 1.0) -> float:
    """Weight by which failures are ranked, the most likely and severe first.

    w = s(severity) · P(behaviour) · p(scene)

    Args:
      severity: of the contact; None: the ego touched nothing.
      probability: that road users do all that the adversaries did, in [0, 1].
      density: declared density of the scene, as a multiple of the uniform one; 1 where nothing is declared.

    Returns:
      At least 0; s is 1 for severe, 0.1 for moderate and for no contact, 0.01 for minor.
    """
    return SEVERITY_WEIGHTS[severity] * probability * density


class Violated(Record, ABC):
    """Base of violations with and without contact: validity rules and verdict."""

    verdicts: Mapping[str, bool]
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
    @abstractmethod
    def judged(self) -> "Violation | Judgement":
        """Holder of the grade, the fault, the plausibility and the drivers."""

    @property
    def graded(self) -> Grade | None:
        """Its grade; None where it is not valid."""
        return self.judged.grade

    @property
    def prevention_in_words(self) -> str | None:
        """Names the drivers that prevent it; None if none was asked."""
        if not self.prevention:
            return None
        names = [name for name, prevents in self.prevention.items() if prevents and name != TTC_RULE]
        by_rule = f"; by {DRIVERS_IN_WORDS[TTC_RULE]} it is preventable" if self.prevention.get(TTC_RULE) else ""
        if names == [FULL_BRAKING]:
            only = DRIVERS_IN_WORDS[FULL_BRAKING]
            return f"of the reference drivers, only {only} would have prevented it{by_rule}"
        told = [DRIVERS_IN_WORDS.get(name, f"the {name.replace('_', ' ')} driver") for name in names]
        *first, last = told or ["none of the reference drivers"]
        told_of = f"{', '.join(first)} and {last}" if first else last
        return f"{told_of} would have prevented it{by_rule}"

    @property
    def blamed(self) -> Fault | None:
        """Party that caused it; None where it is not valid."""
        return self.judged.fault

    @property
    def behaviour(self) -> Plausibility | None:
        """Plausibility of its adversaries' behaviour; None where it is not valid."""
        return self.judged.plausibility

    @property
    def prevention(self) -> Mapping[str, bool]:
        """Reference driver → whether it prevents it; empty if none was asked."""
        drivers = self.judged.drivers
        return {name: each if isinstance(each, bool) else each.avoids for name, each in drivers.items()}

    @property
    def preventable(self) -> bool:
        """Whether it is valid and a reference driver would have prevented it."""
        return self.valid and self.graded is Grade.PREVENTABLE

    @property
    def serious(self) -> bool:
        """Whether it is preventable and not minor.

        One that others caused has to be preventable by one of `PUBLISHED`, not by a defensive driver alone.
        """
        return self.preventable and (self.published_preventable or self.blamed is not Fault.OTHER)

    @property
    def plausible(self) -> bool:
        """Whether it is valid and road users do what its adversaries did."""
        return self.behaviour is not None and self.behaviour.plausible

    @property
    @abstractmethod
    def severity(self) -> Severity | None:
        """Severity of the contact; None without one, or if invalid."""

    def weight(self, density: float = 1.0) -> float:
        """See `ranking_weight`; 0 where it is not valid.

        Args:
          density: declared density of the scene.
        """
        if self.behaviour is None:
            return 0.0
        return ranking_weight(self.severity, self.behaviour.joint_probability, density)

    @property
    def published_preventable(self) -> bool:
        """Whether it is preventable, and one of `PUBLISHED` would have prevented it."""
        return self.preventable and any(self.prevention.get(name, False) for name in PUBLISHED)

    @property
    def headline_candidate(self) -> bool:
        """Whether it is serious and plausible: headline if its replay repeats."""
        return self.serious and self.plausible

    @property
    def avoidable(self) -> bool:
        """Whether it is valid and preventable, at least by full braking."""
        return self.valid and self.graded in (Grade.PREVENTABLE, Grade.FULL_BRAKING)


class Violation(Violated):
    """Violation without contact of a requirement that counts; times from the release."""

    requirement: str
    time_s: Real
    """When it was first violated; what the ego inherited at the release does not count if another violation follows."""
    robustness: Real
    """The least since the release, in scales."""
    other_id: str | None
    """The actor that the ego would have met soonest at that time. Null without one, and where the requirement concerns
    the ego's own driving only."""
    other_kind: str | None
    """vehicle | pedestrian: whether it moves in lanes or anywhere"""
    other_body: str | None
    """car | van | truck | bus | motorcycle | bicycle | pedestrian | child | obstacle"""
    other_role: str | None
    """adversary | background | static"""
    ego_speed_mps: Real
    """At that time."""
    ego_manoeuvre: str
    """straight | left_turn | right_turn | lane_change"""
    hidden: bool
    """Whether the ego knew nothing of the actor at that time."""
    broke: tuple[str, ...]
    """The ego's own offences up to that time."""
    grade: Grade | None
    """preventable | full_braking | unavoidable; null where it is not valid."""
    drivers: Mapping[str, bool]
    """Reference driver → whether it keeps the requirement in the same encounter; empty where it is not valid."""
    fault: Fault | None
    """ego | shared | other. Null where it is not valid."""
    plausibility: Plausibility | None
    """How likely road users do what the adversaries did up to then. Null where it is not valid."""
    kind: str
    """What a person tells apart, in words: the requirement and the ego's manoeuvre."""
    variant: str
    """All else that tells violations of one kind apart, in words."""
    definitions: int
    """Version of the definitions it was judged by."""

    @property
    def judged(self) -> "Violation":
        """See `Violated.judged`."""
        return self

    @property
    def severity(self) -> Severity | None:
        """See `Violated.severity`."""
        return None

    @property
    def event(self) -> str:
        """Describes the ego's violation: "violates never_fast after 3.4 s, at 13.2 m/s"."""
        return f"violates {self.requirement} after {self.time_s:.1f} s, at {self.ego_speed_mps:.1f} m/s"


class RequirementResult(Record):
    """Result of one requirement after the adversaries' release."""

    counts: str
    """failure | report"""
    robustness: Least
    """The least, in scales; below 0 it was violated."""
    violated_s: float | None
    """When it was first violated, from the release; null if it was kept. Of `no_contact`: when the bodies touched."""


class Collision(Violated):
    """The ego's first contact with another actor, with facts to judge it."""

    time_s: Real
    """Since the adversaries' release."""
    other_id: str
    other_kind: str
    """vehicle | pedestrian: whether it moves in lanes or anywhere"""
    other_body: str
    """car | van | truck | bus | motorcycle | bicycle | pedestrian | child | obstacle"""
    other_role: str
    """adversary | background | static"""
    contact_x_m: Real
    """Contact point ahead of the ego's centre."""
    contact_y_m: Real
    """Contact point to the ego's left."""
    ego_zone: str
    """front | left | right | rear: where the contact lies on the ego."""
    other_zone: str
    """The same on the other body."""
    ego_speed_mps: Real
    """The ego's own speed at the contact."""
    other_speed_mps: Real
    relative_speed_mps: Real
    """The closing speed: of either body as seen from the other."""
    lateral_offset_m: Real
    """The other's centre across the ego's axis at contact."""
    early_min_ttc_s: Least
    """Until 1 s before the contact, at which it is 0 for every collision alike, as the episode's own minimum is."""
    min_rss_margin_m: Least
    visible_for_s: Real
    """How long the ego had known of the other without a break before contact, its memory included; 0 if unseen."""
    ego_peak_braking_mps2: Real
    early_min_robustness: Least
    """Soft minimum of the requirements, until 1 s before the contact too."""
    simulator_agrees: bool | None
    """Whether SUMO lists it within 0.3 s; null for pedestrians, bodies that part within the step, and an ego that SUMO
    does not drive."""
    judgement: Judgement

    @property
    def requirement(self) -> str:
        """The requirement that a contact violates."""
        return NO_CONTACT

    @property
    def judged(self) -> Judgement:
        """See `Violated.judged`."""
        return self.judgement

    @property
    def severity(self) -> Severity:
        """Its severity."""
        return self.judgement.severity

    @property
    def serious(self) -> bool:
        """See `Violated.serious`."""
        return super().serious and self.severity is not Severity.MINOR

    @property
    def severity_in_words(self) -> str:
        """Describes severity: "severe: closing speed 11.0 m/s, impact speed 10.8 m/s, …"."""
        return (
            f"{self.judgement.severity}: closing speed {self.relative_speed_mps:.1f} m/s, "
            f"impact speed {self.judgement.impact_mps:.1f} m/s, "
            f"risk of {self.judgement.harm} {100 * self.judgement.injury_risk:.1f} %"
        )

    @property
    def view_in_words(self) -> str:
        """Clause about the striker: "which came into its view only …".

        What a defect keeps from the ego counts too.
        """
        if self.judgement.hidden:
            if self.visible_for_s > 0.0:
                before_s = min(self.visible_for_s, self.time_s - self.judgement.conflict_s)
                return f"which came into its view only {before_s:.1f} s before"
            return "which was not in its view when the conflict began, nor then"
        if self.visible_for_s > 0.0:
            return f"which had been in its view for {self.visible_for_s:.1f} s"
        return "which was not in its view then, but when the conflict began"

    @property
    def conflict_in_words(self) -> str:
        """Start of the conflict before the contact, as a clause.

        One that began hidden counts from when the ego could know of it.
        """
        before_s = self.time_s - self.judgement.conflict_s
        if not self.judgement.hidden:
            return f"the conflict began {before_s:.1f} s before the contact"
        if self.visible_for_s <= 0.0:
            return "the conflict was hidden until the contact"
        return f"the conflict began in hiding and came into sight {before_s:.1f} s before the contact"

    @property
    def event(self) -> str:
        """Describes the contact: "touches lead at a closing speed of 9.0 m/s"."""
        return f"touches {self.other_id} at a closing speed of {self.relative_speed_mps:.1f} m/s"

    @property
    def kind(self) -> str:
        """Its kind, in words."""
        return self.judgement.kind

    @property
    def variant(self) -> str:
        """Its variant within the kind, in words."""
        return self.judgement.variant


def valid_violations(collision: Collision | None, violations: Sequence[Violation]) -> tuple[Collision | Violation, ...]:
    """Lists the violations that make an episode a failure, a contact first."""
    contact = () if collision is None else (collision,)
    return tuple(violation for violation in (*contact, *violations) if violation.valid)


def worst_of(violations: Sequence[Collision | Violation]) -> Collision | Violation | None:
    """Returns the valid violation that counts most.

    One for the headline comes first, then a serious one, then a preventable one, then the first.
    """

    def rank(violation: Collision | Violation) -> tuple[bool, bool, bool]:
        return violation.headline_candidate, violation.serious, violation.preventable

    return max(violations, key=rank, default=None)
