"""Episodes and contacts."""

from collections.abc import Mapping

from risk_sac.types import Outcome
from service.schemas.base import Body, Real


class Collision(Body):
    """The ego's first contact, with what is needed to judge it."""

    time_s: Real
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
    simulator_agrees: bool
    verdicts: Mapping[str, bool]
    """Validity rule → passed."""


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


class EpisodePage(Body):
    """Episodes in the order of their arrival."""

    items: list[Episode]
    next: str | None
    """Pass as `cursor` to continue; null at the end."""
