"""Distinct failures by kind, and a search's finds by kind and variant.

`risk_sac.verdicts.labels` names both. Headline, comparisons and distinct failures count kinds; what a search keeps and
replays goes by variants, because two to four kinds would starve it.

Choice: names, not the distance to earlier failures. Counts do not depend on the order, so a resumed run or two pooled
runs count alike.

A fixed taxonomy of contacts (`TaxonomyCell`) tells how wide a search looks. The grid is the same for all families and
methods, so that counts compare, and most of it is empty.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

from risk_sac.records import Collision, ConflictType, Violation

# Choice: seen too late for any driver (0.6 s), too late for R157's driver (2 s), or in time.
VISIBLE_S = (0.6, 2.0)
CLOSING_MPS = (5.0, 10.0)
BRAKED_MPS2 = 3.0  # more than a driver does for comfort
MANOEUVRES, ROLES = 4, 2
# Cut-in, merge, leader, crossing; front, left, right: a contact at the ego's rear is not valid.
VEHICLE_TYPES, ZONES = 4, 3
CELLS = ROLES * MANOEUVRES * (VEHICLE_TYPES * ZONES + 1) * (len(VISIBLE_S) + 1) * 2 * (len(CLOSING_MPS) + 1)
NEW_VARIANT, NEW_KIND = 1.0, 4.0  # worth of the first failure of a variant, and of a kind
CANDIDATE = 4.0  # times as much again for the first candidate for the headline of either


def variant_name(violation: Collision | Violation) -> str:
    """Returns the name of a violation's variant, its kind included."""
    return f"{violation.kind} | {violation.variant}"


class DistinctFailures:
    """Count of distinct failures; those of one kind count once."""

    def __init__(self) -> None:
        self._kinds: set[str] = set()

    @property
    def count(self) -> int:
        """Distinct failures so far; the same whatever their order."""
        return len(self._kinds)

    def add(self, violation: Collision | Violation) -> bool:
        """Counts a violation; returns whether it is the first of its kind."""
        before = len(self._kinds)
        self._kinds.add(violation.kind)
        return len(self._kinds) > before


class Finds:
    """Counts of a search's failures by variant, and the worth of finds.

    Choice: the first of a variant is worth 1, the first of a kind 4. The first candidate for the headline of either is
    worth four times as much again.

    Attributes:
      variants: how often each variant was found, by `variant_name`.
    """

    def __init__(self) -> None:
        self.variants: Counter[str] = Counter()
        self._kinds: set[str] = set()
        self._candidates: set[str] = set()  # kinds and variants with a candidate for the headline

    def add(self, violations: Sequence[Collision | Violation]) -> float:
        """Counts an episode's valid violations; returns the worth of the new."""
        worth = 0.0
        for violation in violations:
            kind, variant = violation.kind, variant_name(violation)
            worth += _newness(kind in self._kinds, variant in self.variants)
            self._kinds.add(kind)
            self.variants[variant] += 1
            if violation.headline_candidate:
                worth += CANDIDATE * _newness(kind in self._candidates, variant in self._candidates)
                self._candidates |= {kind, variant}
        return worth

    def state(self) -> dict[str, Any]:
        """Returns plain values to continue from."""
        return {"variants": dict(self.variants), "kinds": sorted(self._kinds), "candidates": sorted(self._candidates)}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self.variants = Counter(state["variants"])
        self._kinds, self._candidates = set(state["kinds"]), set(state["candidates"])


def _newness(kind_known: bool, variant_known: bool) -> float:
    return 0.0 if variant_known else NEW_VARIANT if kind_known else NEW_KIND


def distinct_failures(violations: Sequence[Collision | Violation]) -> tuple[int, ...]:
    """Returns the position of each kind's first violation, in order of occurrence."""
    found = DistinctFailures()
    return tuple(position for position, violation in enumerate(violations) if found.add(violation))


class TaxonomyCell(NamedTuple):
    """One cell of the taxonomy of contacts."""

    striker: str  # role and kind
    ego_manoeuvre: str
    conflict_type: ConflictType
    ego_zone: str  # empty for a pedestrian: of half a metre, it would make one kind four
    visible: int  # which of the three bins that `VISIBLE_S` parts
    ego_braked: bool
    closing_speed: int  # which of the three bins that `CLOSING_MPS` parts


def taxonomy_cell(collision: Collision) -> TaxonomyCell:
    """Returns the cell of a contact, by its judgement."""
    return TaxonomyCell(
        striker=f"{collision.other_role} {collision.other_kind}",
        ego_manoeuvre=collision.judgement.ego_manoeuvre,
        conflict_type=collision.judgement.conflict_type,
        ego_zone="" if collision.other_kind == "pedestrian" else collision.ego_zone,
        visible=bisect_right(VISIBLE_S, collision.visible_for_s),
        ego_braked=collision.ego_peak_braking_mps2 >= BRAKED_MPS2,
        closing_speed=bisect_right(CLOSING_MPS, collision.relative_speed_mps),
    )
