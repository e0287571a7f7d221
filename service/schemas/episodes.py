"""Episodes and contacts."""

from collections.abc import Mapping

from risk_sac.types import ConflictType, Grade, Outcome
from service.schemas.base import Body, Real


class ReferenceOutcome(Body):
    """How a reference driver fares in the ego's place."""

    avoids: bool
    """Does not touch, or stands when it is struck, or is struck from behind."""
    impact_speed_mps: Real
    """Of the reference driver at its contact; 0 if it avoids."""


class Judgement(Body):
    """How a contact came about, and who would have prevented it. Times count from the adversaries' release."""

    definitions: int
    """Version of the definitions it was judged by."""
    conflict_type: ConflictType
    """How the striker came into the ego's way."""
    conflict_s: Real
    """When the conflict began; negative before the release."""
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
    broke: list[str]
    """What the striker broke: red_light, priority, wrong_direction, speeding, pedestrian_on_red."""
    unresponsive: bool
    """A visible collision course of 1.5 s or more during which the ego never braked."""
    grade: Grade | None
    """Who would have prevented it: the careful driver, only an ideal one, or nobody; null where it is not valid."""
    drivers: Mapping[str, ReferenceOutcome]
    """Reference driver → how it fares; empty where the contact is not valid."""
    signature: str
    """The class of failures it belongs to, in words."""


class Funnel(Body):
    """From what the ego touched to what is worth a person's time; each count is part of the one before."""

    contacts: int
    valid: int
    distinct: int
    preventable: int
    """Distinct failures that the careful driver would have prevented."""


class Collision(Body):
    """The ego's first contact, with what is needed to judge it."""

    time_s: Real
    """Since the adversaries' release."""
    other_id: str
    other_kind: str
    other_role: str
    contact_x_m: Real
    """Contact point ahead of the ego's centre."""
    contact_y_m: Real
    """Contact point to the ego's left."""
    ego_zone: str
    other_zone: str
    ego_speed_mps: Real
    other_speed_mps: Real
    relative_speed_mps: Real
    lateral_offset_m: Real
    min_ttc_s: Real
    min_rss_margin_m: Real
    visible_for_s: Real
    """How long the ego had seen the other before contact."""
    ego_peak_braking_mps2: Real
    min_robustness: Real
    simulator_agrees: bool | None
    """Whether SUMO lists the collision within 0.3 s; null for pedestrians, whom it does not know."""
    verdicts: Mapping[str, bool]
    """Validity rule → passed."""
    judgement: Judgement | None
    """Null in what was stored before contacts were judged."""


class Episode(Body):
    """One episode."""

    id: str
    run_id: str
    index: int
    """0-based within the run, rejected scenes included."""
    phase: str
    """train | evaluate"""
    seed: int
    scene: Mapping[str, Real]
    outcome: Outcome
    reason: str
    """Rule that rejected the scene, or validity rules that the contact failed."""
    steps: int
    risk_return: Real
    shaped_return: Real
    mean_cost: Real
    min_ttc_s: Real
    """Null when nothing was ever on a collision course."""
    min_robustness: Real
    objective: Real
    dual_variable: Real
    temperature: Real
    environment_steps: int
    collision: Collision | None
    wall_s: float
    funnel: Funnel | None
    """What the run's phase has found up to and including this episode; null in what is older."""


class EpisodePage(Body):
    """Episodes in the order of their arrival."""

    items: list[Episode]
    next: str | None
    """Pass as `cursor` to continue; null at the end."""
