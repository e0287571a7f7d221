"""Which cells of the fixed taxonomy of failures were hit, and which of its values never were."""

from collections import Counter
from collections.abc import Iterable, Mapping

from risk_sac.records import Collision, ConflictType, Record
from risk_sac.verdicts.taxonomy import CELLS, FailureKind, kind_of

ROLES = ("adversary", "background")
# What a failure can be in each of the taxonomy's respects, as `FailureKind` has it, and in words.
VALUES: Mapping[str, Mapping[object, str]] = {
    "striker": {f"{role} {kind}": f"{kind} ({role})" for role in ROLES for kind in ("vehicle", "pedestrian")},
    "ego_manoeuvre": {
        "straight": "the ego goes straight",
        "left_turn": "the ego turns left",
        "right_turn": "the ego turns right",
        "lane_change": "the ego changes lane",
    },
    "conflict_type": {
        ConflictType.CUT_IN: "cut-in",
        ConflictType.LEADER: "leader",
        ConflictType.CROSSING: "crossing vehicle",
        ConflictType.PEDESTRIAN: "pedestrian",
    },
    "ego_zone": {zone: f"struck at its {zone}" for zone in ("front", "left", "right")},
    "visible": {0: "seen for less than 0.6 s", 1: "seen for 0.6 to 2 s", 2: "seen for 2 s or more"},
    "ego_braked": {True: "braking by 3 m/s² or more", False: "not braking"},
    "closing_speed": {0: "closing at less than 5 m/s", 1: "closing at 5 to 10 m/s", 2: "closing at 10 m/s or more"},
}


class Kinds(Record):
    """What a family's valid failures are, in the taxonomy's terms."""

    cells: int
    """Of the taxonomy; most of them hold what no ego and no road allows."""
    hit: Mapping[str, int]
    """Cell, in words, → failures, the most frequent first."""
    values: Mapping[str, Mapping[str, int]]
    """Respect → its values, in words, → failures."""

    @property
    def never(self) -> tuple[str, ...]:
        """Values that no failure had."""
        return tuple(value for counts in self.values.values() for value, count in counts.items() if not count)


def kinds(collisions: Iterable[Collision | None]) -> Kinds:
    """Counts valid failures; contacts that are none, or that nobody judged, are left out."""
    found = Counter(
        kind_of(each, each.judgement) for each in collisions if each is not None and each.valid and each.judgement
    )
    values = {
        respect: {
            words: sum(count for kind, count in found.items() if getattr(kind, respect) == value)
            for value, words in every.items()
        }
        for respect, every in VALUES.items()
    }
    return Kinds(cells=CELLS, hit={in_words(kind): count for kind, count in found.most_common()}, values=values)


def in_words(kind: FailureKind) -> str:
    """A cell of the taxonomy."""
    parts = (VALUES[respect].get(getattr(kind, respect), "") for respect in FailureKind._fields)
    return ", ".join(part for part in parts if part)
