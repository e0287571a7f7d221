"""The rules by which a contact that is no artefact is degenerate: the ego had no part in it, or no chance.

Source: the grades in risk_sac/verdicts/README.md.
"""

from collections.abc import Mapping

from risk_sac.sim.collision import Contact
from risk_sac.types import Kind
from risk_sac.verdicts.evidence import Evidence

FLANK_FROM_FRONT_M = 1.5  # a flank contact nearer to the front bumper than this is a front corner
STANDING_MPS = 0.5
CROSSING_HEADING_SIN = 0.5  # headings at least 30 degrees apart: a crossing conflict, not a sideswipe
CROSSING_VISIBLE_S = 1.0


def validity_verdicts(
    evidence: Evidence, striker: int, contact: Contact, *, visible_for_s: float, ever_visible: bool
) -> Mapping[str, bool]:
    """The rules, each with whether the contact in the last frame passes it.

    `visible_for_s` is how long the ego has known of the striker without a break, `ever_visible` whether it ever did.
    """
    adversary_hit_flank = (
        contact.ego_zone in ("left", "right")
        and evidence.length_m[0] / 2 - contact.x_m > FLANK_FROM_FRONT_M
        and contact.closing_lateral_other_mps > contact.closing_lateral_ego_mps
    )
    vehicle = evidence.kind[striker] == Kind.VEHICLE
    crossing_conflict = bool(
        vehicle and abs(contact.heading_sin) >= CROSSING_HEADING_SIN and visible_for_s >= CROSSING_VISIBLE_S
    )
    return {
        "not_from_behind": contact.ego_zone != "rear",
        "ego_moving": bool(evidence.speed_mps[-1, 0] >= STANDING_MPS),
        "no_sideswipe": bool(not adversary_hit_flank or crossing_conflict),
        "seen_before": ever_visible,
    }
