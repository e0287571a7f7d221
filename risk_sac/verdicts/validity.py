"""The rules by which a contact that is no artefact is degenerate: the ego had no part in it, or no chance.

Source: the grades in risk_sac/verdicts/README.md.
"""

from collections.abc import Mapping
from typing import Protocol

from risk_sac.types import Kind
from risk_sac.verdicts.evidence import Evidence

FLANK_FROM_FRONT_M = 1.5  # a flank contact nearer to the front bumper than this is a front corner
STANDING_MPS = 0.5
CROSSING_HEADING_SIN = 0.5  # headings at least 30 degrees apart: a crossing conflict, not a sideswipe
CROSSING_VISIBLE_S = 1.0


class Touch(Protocol):
    """What the rules ask of a contact, in the ego's frame; `risk_sac.sim.collision.Contact` has it."""

    @property
    def x_m(self) -> float:
        """Contact point, ahead of the ego's centre."""

    @property
    def ego_zone(self) -> str:
        """Where the contact lies on the ego: front, left, right or rear."""

    @property
    def heading_sin(self) -> float:
        """Of the other's heading relative to the ego's."""

    @property
    def closing_lateral_ego_mps(self) -> float:
        """The ego's own speed across its axis towards the other."""

    @property
    def closing_lateral_other_mps(self) -> float:
        """The other's towards the ego."""


def validity_verdicts(
    evidence: Evidence, striker: int, touch: Touch, *, visible_for_s: float, ever_visible: bool
) -> Mapping[str, bool]:
    """The rules, each with whether the contact passes it.

    Args:
      evidence: up to the contact's frame.
      striker: its column.
      touch: the contact.
      visible_for_s: how long the ego has known of the striker without a break.
      ever_visible: whether it ever did.
    """
    adversary_hit_flank = (
        touch.ego_zone in ("left", "right")
        and evidence.length_m[0] / 2 - touch.x_m > FLANK_FROM_FRONT_M
        and touch.closing_lateral_other_mps > touch.closing_lateral_ego_mps
    )
    vehicle = evidence.kind[striker] == Kind.VEHICLE
    crossing_conflict = bool(
        vehicle and abs(touch.heading_sin) >= CROSSING_HEADING_SIN and visible_for_s >= CROSSING_VISIBLE_S
    )
    return {
        "not_from_behind": touch.ego_zone != "rear",
        "ego_moving": bool(evidence.speed_mps[-1, 0] >= STANDING_MPS),
        "no_sideswipe": bool(not adversary_hit_flank or crossing_conflict),
        "seen_before": ever_visible,
    }
