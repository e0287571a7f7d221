"""Computes the covered part of the ODD.

It counts bins of each scene parameter and of each pair, and cells of the taxonomy.

A bin is looked at by an episode that was played in it; a scene that is refused before its first step tells nothing.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import FamilyName, Interval, Odd
from risk_sac.records import Collision, ConflictType, EpisodeRecord, Outcome, Record
from risk_sac.scenario.families import Family
from risk_sac.scenario.limits import with_environment
from risk_sac.scenario.odd import TINY, field, intersect, narrow, paths
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.verdicts.distinct import CELLS, TaxonomyCell, taxonomy_cell
from risk_sac.world.types import Bools, Floats

BINS, PAIR_BINS = 10, 4
NOT_PLAYED = (Outcome.REJECTED, Outcome.INVALID)
ROLES = ("adversary", "background", "static")
# What a contact can be in each of the taxonomy's respects, as `TaxonomyCell` has it, and in words.
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
        ConflictType.MERGE: "merge of the ego",
        ConflictType.LEADER: "leader",
        ConflictType.CROSSING: "crossing vehicle",
        ConflictType.PEDESTRIAN: "pedestrian",
    },
    "ego_zone": {zone: f"struck at its {zone}" for zone in ("front", "left", "right")},
    "visible": {0: "seen for less than 0.6 s", 1: "seen for 0.6 to 2 s", 2: "seen for 2 s or more"},
    "ego_braked": {True: "braking by 3 m/s² or more", False: "not braking"},
    "closing_speed": {0: "closing at less than 5 m/s", 1: "closing at 5 to 10 m/s", 2: "closing at 10 m/s or more"},
}


class Bin(Record):
    """A part of a parameter's range, or one of its categories."""

    name: str
    played: int
    failed: int
    """Failures, by any requirement that counts."""
    refused: int
    """Scenes that were not played, or not to the end."""


class ParameterCoverage(Record):
    """A scene parameter."""

    name: str
    unit: str
    meaning: str
    low: float
    high: float
    categorical: bool
    """Whether its bins are categories."""
    bins: tuple[Bin, ...]

    @property
    def never(self) -> tuple[str, ...]:
        """Bins in which no episode was played."""
        return tuple(each.name for each in self.bins if not each.played)


class PairCoverage(Record):
    """Two scene parameters together."""

    parameters: tuple[str, str]
    cells: int
    played: int
    """Cells with an episode."""
    failed: int
    """Cells with a failure."""
    never: tuple[str, ...]
    """The cells without an episode, by the bins of both."""


class Kinds(Record):
    """Kinds of a family's valid contacts, in the taxonomy's terms."""

    cells: int
    """Of the taxonomy; most can hold nothing."""
    hit: Mapping[str, int]
    """Cell, in words, → contacts, the most frequent first."""
    values: Mapping[str, Mapping[str, int]]
    """Respect → its values, in words, → contacts."""

    @property
    def never(self) -> tuple[str, ...]:
        """Values that no contact had."""
        return tuple(value for counts in self.values.values() for value, count in counts.items() if not count)


class Coverage(Record):
    """Coverage of one family's ODD."""

    family: FamilyName
    episodes: int
    """That were played."""
    parameters: tuple[ParameterCoverage, ...]
    pairs: tuple[PairCoverage, ...]
    fixed: tuple[str, ...]
    """Fields of the ODD that no scene parameter varies."""
    beyond: tuple[str, ...]
    """What the ODD allows and no scene begins with, because a parameter's own range ends before."""
    kinds: Kinds


@dataclass(frozen=True, slots=True)
class Axis:
    """A parameter and its bins: half-open, the last one closed."""

    parameter: Parameter
    names: tuple[str, ...]  # of the bins: a category, or a range in the parameter's unit
    edges: Floats  # inner ones, one fewer than bins
    categorical: bool = False

    def places(self, values: Floats) -> NDArray[np.int64]:
        """The bin of each value, `n`."""
        return np.searchsorted(self.edges, values, side="right").astype(np.int64)


def axis_of(parameter: Parameter, whole: Parameter, bins: int) -> Axis:
    """Divides a parameter's range within the ODD into bins.

    A category is a bin: the halves of `whole`, the same as its family has it. So is a single value.
    """
    if whole.categories:
        middle = (whole.low + whole.high) / 2  # belongs to the upper half
        left = parameter.low < middle, parameter.high >= middle
        names = tuple(name for name, allowed in zip(whole.categories, left, strict=True) if allowed)
        return Axis(parameter, names, np.array([middle] if all(left) else []), categorical=True)
    if parameter.high <= parameter.low:
        return Axis(parameter, (f"{parameter.low:g}",), np.array([]))
    edges = np.linspace(parameter.low, parameter.high, bins + 1)
    return Axis(parameter, tuple(f"{low:.3g} to {high:.3g}" for low, high in pairwise(edges)), edges[1:-1])


def axes_of(family: Family, odd: Odd, bins: int) -> list[Axis]:
    """Divides each scene parameter's range in the ODD into bins."""
    whole = intersect(family.odd, odd)
    every = with_environment(family.space, odd, whole)
    return [
        _alternatives(family, allowed) or axis_of(allowed, own, bins)
        for allowed, own in zip(narrow(every, whole).parameters, every.parameters, strict=True)
    ]


def _alternatives(family: Family, parameter: Parameter) -> Axis | None:
    """Makes a bin of each word or row; None of other parameters."""
    document = family.parameters.get(parameter.name)
    if document is None or parameter.categories or not 0 < document.alternatives <= BINS:
        return None
    count = document.alternatives
    names = document.words or [
        ", ".join(f"{name} {value}" for name, value in row.items()) for row in document.rows or ()
    ]
    return Axis(parameter, tuple(names), np.arange(1, count) / count, categorical=True)


def coverage(family: Family, odd: Odd, records: Sequence[EpisodeRecord]) -> Coverage:
    """Counts covered bins of episodes; skips those that lack a current parameter."""
    whole = intersect(family.odd, odd)
    every = with_environment(family.space, odd, whole)
    space = narrow(every, whole)
    varied = {parameter.odd for parameter in space.parameters}
    known = [record for record in records if set(space.names) <= record.scene.keys()]
    columns = [np.array([record.scene[name] for record in known], dtype=np.float64) for name in space.names]
    played = np.array([record.outcome not in NOT_PLAYED for record in known], dtype=bool)
    failed = np.array([record.outcome is Outcome.FAILURE for record in known], dtype=bool)
    fine, coarse = (axes_of(family, odd, bins) for bins in (BINS, PAIR_BINS))
    placed = [(axis, axis.places(column)) for axis, column in zip(coarse, columns, strict=True)]
    return Coverage(
        family=family.name,
        episodes=int(played.sum()),
        parameters=tuple(
            _parameter(axis, axis.places(column), played, failed) for axis, column in zip(fine, columns, strict=True)
        ),
        pairs=tuple(_pair(*both, played, failed) for both in combinations(placed, 2)),
        fixed=tuple(path for path in paths(whole) if path not in varied),
        beyond=tuple(_beyond(whole, space)),
        kinds=kinds(record.collision for record in known),
    )


def _parameter(axis: Axis, places: NDArray[np.int64], played: Bools, failed: Bools) -> ParameterCoverage:
    counts = [np.bincount(places[rows], minlength=len(axis.names)).tolist() for rows in (played, failed, ~played)]
    parameter = axis.parameter
    return ParameterCoverage(
        **{name: getattr(parameter, name) for name in ("name", "unit", "meaning", "low", "high")},
        categorical=axis.categorical,
        bins=tuple(
            Bin(name=name, played=played, failed=failed, refused=refused)
            for name, played, failed, refused in zip(axis.names, *counts, strict=True)
        ),
    )


def _pair(
    first: tuple[Axis, NDArray[np.int64]], second: tuple[Axis, NDArray[np.int64]], played: Bools, failed: Bools
) -> PairCoverage:
    (one, rows), (other, columns) = first, second
    cells_played, cells_failed = np.zeros((2, len(one.names), len(other.names)), dtype=bool)
    cells_played[rows[played], columns[played]] = True
    cells_failed[rows[failed], columns[failed]] = True
    return PairCoverage(
        parameters=(one.parameter.name, other.parameter.name),
        cells=cells_played.size,
        played=int(cells_played.sum()),
        failed=int(cells_failed.sum()),
        never=tuple(f"{one.names[i]} × {other.names[j]}" for i, j in np.argwhere(~cells_played)),
    )


def _beyond(odd: Odd, space: SceneSpace) -> Iterator[str]:
    for parameter in space.parameters:
        allowed = field(odd, parameter.odd) if parameter.odd else None
        if not isinstance(allowed, Interval):
            continue
        for low, high in ((allowed.low, parameter.low), (parameter.high, allowed.high)):
            if high - low > TINY:
                yield f"{parameter.name} from {low:g} to {high:g} {parameter.unit}".removesuffix(" 1")


def kinds(collisions: Iterable[Collision | None]) -> Kinds:
    """Counts valid contacts by cell of the taxonomy."""
    counts = Counter(taxonomy_cell(collision) for collision in collisions if collision is not None and collision.valid)
    values = {
        respect: {
            words: sum(count for kind, count in counts.items() if getattr(kind, respect) == value)
            for value, words in every.items()
        }
        for respect, every in VALUES.items()
    }
    return Kinds(cells=CELLS, hit={_in_words(kind): count for kind, count in counts.most_common()}, values=values)


def _in_words(kind: TaxonomyCell) -> str:
    parts = (VALUES[respect].get(getattr(kind, respect), "") for respect in TaxonomyCell._fields)
    return ", ".join(part for part in parts if part)
