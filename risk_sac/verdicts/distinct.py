"""Tells distinct failures apart, by signature and then by cells.

The cells divide what varies within a signature.

Choice: fixed cells, not the distance to failures found before: the number of filled cells does not depend on the
order, so a resumed run or two pooled runs count alike. The edges are where people begin to die (30 km/h) and where a
driver had time to act.

A fixed taxonomy (`FailureKind`) is coarser: its cells say how wide a search looks. The grid is the same for all
families and methods, so that counts compare, and most of it is empty.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

from risk_sac.errors import NotFinite
from risk_sac.records import Collision, ConflictType, Violation

KMH = 1 / 3.6
# The edges between the cells of each feature.
EDGES = {
    "ego_speed_mps": (30 * KMH,),
    "other_speed_mps": (30 * KMH,),
    "from_conflict_s": (2.0,),  # what R157's driver needs to be at full braking
}
Cell = tuple[int, ...]
Niche = tuple[str, str, Cell]  # requirement, signature, cell
# Choice: seen too late for any driver (0.6 s), too late for R157's driver (2 s), or in time.
VISIBLE_S = (0.6, 2.0)
CLOSING_MPS = (5.0, 10.0)
BRAKED_MPS2 = 3.0  # more than a driver does for comfort
NEW, NEW_CANDIDATE = 1.0, 4.0  # worth of a distinct failure, and what a candidate for the headline adds
MANOEUVRES, ROLES = 4, 2
# Cut-in, merge, leader, crossing; front, left, right: a contact at the ego's rear is not valid.
VEHICLE_TYPES, ZONES = 4, 3
CELLS = ROLES * MANOEUVRES * (VEHICLE_TYPES * ZONES + 1) * (len(VISIBLE_S) + 1) * 2 * (len(CLOSING_MPS) + 1)


def cell_of(violation: Collision | Violation) -> Cell:
    """The cell of a violation within its signature; without contact it has the ego's speed alone.

    Raises:
      NotFinite: a feature is NaN; infinite ones lie in the outermost cell.
    """
    values = [violation.ego_speed_mps]
    if isinstance(violation, Collision):
        values += [violation.other_speed_mps, violation.time_s - violation.judgement.conflict_s]
    if any(value != value for value in values):
        named = dict(zip(EDGES, values, strict=False))
        raise NotFinite(f"{violation.requirement} violated at {violation.time_s:g} s has {named}; wanted no NaN")
    return cell(values)


def cell(values: Sequence[float]) -> Cell:
    """The cell of these values of the first features of `EDGES`."""
    return tuple(bisect_right(edges, value) for edges, value in zip(EDGES.values(), values, strict=False))


def niche_of(violation: Collision | Violation) -> Niche:
    """Returns the key that violations share if they are not distinct."""
    return violation.requirement, violation.signature, cell_of(violation)


def kind_name(violation: Collision | Violation) -> str:
    """Name of a violation's niche: equal for violations that are not distinct."""
    requirement, signature, cell = niche_of(violation)
    return f"{requirement}: {signature} [{'-'.join(map(str, cell))}]"


class DistinctFailures:
    """Count of distinct failures; repeating one failure counts once."""

    def __init__(self) -> None:
        self._found: set[Niche] = set()

    @property
    def count(self) -> int:
        """Distinct failures so far; the same whatever their order."""
        return len(self._found)

    def add(self, violation: Collision | Violation) -> bool:
        """Whether a violation is distinct from all before it; it then counts among them.

        Raises:
          NotFinite: one of its features is NaN.
        """
        niche = niche_of(violation)
        if niche in self._found:
            return False
        self._found.add(niche)
        return True


class Finds:
    """Counts the kinds of failures that a search has found, and what each find is worth.

    Choice: a distinct failure is worth 1, and 4 more if it is the first of its kind that counts for the headline.

    Attributes:
      kinds: how often each kind was found, by `kind_name`.
    """

    def __init__(self) -> None:
        self.kinds: Counter[str] = Counter()
        self._candidates: set[str] = set()  # kinds with a candidate for the headline

    def add(self, violations: Sequence[Collision | Violation]) -> float:
        """Counts the valid violations of an episode; returns what is new among them, by worth."""
        worth = 0.0
        for violation in violations:
            kind = kind_name(violation)
            worth += NEW * (kind not in self.kinds)
            self.kinds[kind] += 1
            if violation.headline_candidate and kind not in self._candidates:
                self._candidates.add(kind)
                worth += NEW_CANDIDATE
        return worth

    def state(self) -> dict[str, Any]:
        """Returns plain values to continue from."""
        return {"kinds": dict(self.kinds), "candidates": sorted(self._candidates)}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self.kinds, self._candidates = Counter(state["kinds"]), set(state["candidates"])


def distinct_failures(violations: Sequence[Collision | Violation]) -> tuple[int, ...]:
    """Positions of the first of each kind among violations in order of occurrence; see `DistinctFailures`."""
    found = DistinctFailures()
    return tuple(position for position, violation in enumerate(violations) if found.add(violation))


class FailureKind(NamedTuple):
    """One cell of the taxonomy."""

    striker: str  # role and kind
    ego_manoeuvre: str
    conflict_type: ConflictType
    ego_zone: str  # empty for a pedestrian: of half a metre, it would make one kind four
    visible: int  # which of the three bins that `VISIBLE_S` parts
    ego_braked: bool
    closing_speed: int  # which of the three bins that `CLOSING_MPS` parts


def kind_of(collision: Collision) -> FailureKind:
    """The cell that a contact lies in, by what was judged of it."""
    return FailureKind(
        striker=f"{collision.other_role} {collision.other_kind}",
        ego_manoeuvre=collision.judgement.ego_manoeuvre,
        conflict_type=collision.judgement.conflict_type,
        ego_zone="" if collision.other_kind == "pedestrian" else collision.ego_zone,
        visible=bisect_right(VISIBLE_S, collision.visible_for_s),
        ego_braked=collision.ego_peak_braking_mps2 >= BRAKED_MPS2,
        closing_speed=bisect_right(CLOSING_MPS, collision.relative_speed_mps),
    )
