"""A fixed taxonomy of failures, coarser than what is distinct: of how many kinds a search has found one.

Distinct failures may be many of one kind; cells say how wide a search looks. The grid is the same for all families and
methods, so that counts compare, and most of it is empty: a pedestrian has no zones, and nobody cuts in from behind.
"""

from bisect import bisect_right
from typing import NamedTuple

from risk_sac.records import Collision, ConflictType, Judgement

# Choice: seen too late for any driver (0.6 s), too late for a careful one (2 s), or in time.
VISIBLE_S = (0.6, 2.0)
CLOSING_MPS = (5.0, 10.0)
BRAKED_MPS2 = 3.0  # more than a driver does for comfort
MANOEUVRES, ROLES = 4, 2
VEHICLE_TYPES, ZONES = 3, 3  # cut-in, leader, crossing; front, left, right: a contact at the ego's rear is not valid
CELLS = ROLES * MANOEUVRES * (VEHICLE_TYPES * ZONES + 1) * (len(VISIBLE_S) + 1) * 2 * (len(CLOSING_MPS) + 1)


class FailureKind(NamedTuple):
    """One cell of the taxonomy."""

    striker: str  # role and kind
    ego_manoeuvre: str
    conflict_type: ConflictType
    ego_zone: str  # empty for a pedestrian: of half a metre, it would make one kind four
    visible: int  # which of the three bins that `VISIBLE_S` parts
    ego_braked: bool
    closing_speed: int  # which of the three bins that `CLOSING_MPS` parts


def kind_of(collision: Collision, judged: Judgement) -> FailureKind:
    """The cell that a contact lies in, by what was judged of it."""
    return FailureKind(
        striker=f"{collision.other_role} {collision.other_kind}",
        ego_manoeuvre=judged.ego_manoeuvre,
        conflict_type=judged.conflict_type,
        ego_zone="" if collision.other_kind == "pedestrian" else collision.ego_zone,
        visible=bisect_right(VISIBLE_S, collision.visible_for_s),
        ego_braked=collision.ego_peak_braking_mps2 >= BRAKED_MPS2,
        closing_speed=bisect_right(CLOSING_MPS, collision.relative_speed_mps),
    )
