"""Decides which party caused a contact or a violation; rules.md has the rule."""

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

from risk_sac.records import ConflictType, EgoPart, Fault, Grade
from risk_sac.verdicts.ego_part import RESPONDS_S

# They react to the conflict. A defensive one slows before, which the ego owes only where it could not see.
REACTING = frozenset({"r157", "fsm", "rss"})
YIELDS = frozenset({"red_light", "priority", "pedestrian_on_red", "wrong_direction"})  # its breaker has to yield
LATE_S = 0.5  # after which an answer comes later than R157's driver gives it
HARD = 0.8  # of the braking that car and road allow
CROSSINGS = ("crossing", "beside_crossing")


class Parts(NamedTuple):
    """Behaviour of both parties that the fault depends on."""

    drove_into: bool = False  # the ego drove on into a road user that it saw in its way
    ego_erred: bool = False
    other_erred: bool = False
    ego_yields: bool = False  # the ego had to yield, or to keep its distance
    left_rss: bool = False  # the ego left RSS's proper response first, and did not brake at once either


def fault(parts: Parts) -> Fault:
    """Applies the rule; its first line that holds decides."""
    if parts.drove_into:
        return Fault.EGO
    if parts.other_erred:
        return Fault.SHARED if parts.ego_erred else Fault.OTHER
    return Fault.EGO if parts.ego_erred or parts.ego_yields or parts.left_rss else Fault.OTHER


def has_to_yield(
    conflict_type: ConflictType, ground: str, broke: Collection[str], ego_broke: Collection[str]
) -> str | None:
    """Names which had to yield to the other: ego or striker; None where the record does not tell.

    A follower has to, and one that comes over; at a crossing the ego, unless the pedestrian came on red, and beside it
    the pedestrian. Between vehicles whose ways cross their offences tell.
    """
    if not YIELDS.isdisjoint(broke):
        return "striker"
    if not YIELDS.isdisjoint(ego_broke) or conflict_type in (ConflictType.LEADER, ConflictType.MERGE):
        return "ego"
    if conflict_type is ConflictType.PEDESTRIAN:
        return "ego" if ground in CROSSINGS else "striker"
    return None


def parts_of_contact(
    part: EgoPart,
    conflict_type: ConflictType,
    *,
    yields: str | None,
    broke: Collection[str],
    ego_broke: Collection[str],
    avoids: Mapping[str, bool],
    grade: Grade,
    lasted_s: float,
) -> Parts:
    """Sums up a contact.

    Args:
      part: what the ego did about the striker.
      conflict_type: how it came into the ego's way.
      yields: which had to yield, see `has_to_yield`.
      broke: what the striker broke.
      ego_broke: what the ego broke.
      avoids: reference driver → whether it avoids the contact.
      grade: of the contact.
      lasted_s: from the beginning of the conflict to the contact.
    """
    walks, crosses = (conflict_type is each for each in (ConflictType.PEDESTRIAN, ConflictType.CROSSING))
    braked_after_s = math.inf if part.braked_after_s is None else part.braked_after_s
    return Parts(
        drove_into=(walks and part.sped_up) or ((walks or crosses) and part.started),
        ego_erred=bool(ego_broke)
        or conflict_type is ConflictType.MERGE
        or part.sped_up
        or part.started
        or min(braked_after_s, lasted_s) >= RESPONDS_S + LATE_S
        or any(avoids.get(name, False) for name in REACTING)
        or (part.too_fast and grade is Grade.PREVENTABLE and YIELDS.isdisjoint(broke)),
        other_erred=bool(broke) or yields == "striker",
        ego_yields=yields == "ego",
        left_rss=part.left_first == "ego"
        and not (braked_after_s <= RESPONDS_S and part.braking_mps2 >= HARD * part.possible_mps2),
    )


def parts_of_violation(
    *, own: bool, yields: str | None, other_broke: Collection[str], broke: Collection[str], grade: Grade
) -> Parts:
    """Sums up a violation without contact.

    Args:
      own: whether the requirement speaks of the ego's own driving only, or nothing was in its way.
      yields: which of ego and striker had to yield, see `has_to_yield`.
      other_broke: what the actor that mattered most broke.
      broke: what the ego broke.
      grade: of the violation.
    """
    if own:
        return Parts(ego_erred=grade is Grade.PREVENTABLE)
    return Parts(
        ego_erred=bool(broke) or grade is Grade.PREVENTABLE,
        other_erred=bool(other_broke),
        ego_yields=yields == "ego",
    )
