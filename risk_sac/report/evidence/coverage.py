"""Which part of the ODD was looked at: bins of each scene parameter and of each pair, and cells of the taxonomy.

A bin is looked at by an episode that was played in it; a scene that is refused before its first step tells nothing.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from risk_sac.config import FamilyName, Interval, Odd
from risk_sac.records import EpisodeRecord, Outcome, Record
from risk_sac.report.evidence.bins import Axis, axis_of
from risk_sac.report.evidence.bounds import NOT_PLAYED
from risk_sac.report.evidence.taxonomy import Kinds, kinds
from risk_sac.scenario.family import Family
from risk_sac.scenario.odd import TINY, field, intersect, narrow
from risk_sac.scenario.space import SceneSpace
from risk_sac.types import Bools, Floats

BINS, PAIR_BINS = 10, 4


class Bin(Record):
    """A part of a parameter's range, or one of its categories."""

    name: str
    played: int
    failed: int
    """Valid failures."""
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
    """Cells with a valid failure."""
    never: tuple[str, ...]
    """The cells without an episode, by the bins of both."""


class Coverage(Record):
    """What was looked at in one family."""

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


def coverage(family: Family, odd: Odd, records: Sequence[EpisodeRecord]) -> Coverage:
    """What these episodes looked at.

    Args:
      family: of their scenes.
      odd: the campaign's, which narrows the family's.
      records: episodes; those from before the family had all its parameters are left out.
    """
    whole = intersect(family.odd, odd)
    space = narrow(family.space, whole)
    known = [record for record in records if set(space.names) <= record.scene.keys()]
    values = np.array([[record.scene[name] for name in space.names] for record in known], dtype=np.float64)
    counted = _Counted(
        columns=tuple(values.reshape(-1, space.dimension).T),
        played=np.array([record.outcome not in NOT_PLAYED for record in known], dtype=bool),
        failed=np.array([record.outcome is Outcome.FAILURE for record in known], dtype=bool),
    )
    fine, coarse = (
        [axis_of(*both, bins) for both in zip(space.parameters, family.space.parameters, strict=True)]
        for bins in (BINS, PAIR_BINS)
    )
    pairs = combinations(range(space.dimension), 2)
    return Coverage(
        family=family.name,
        episodes=int(counted.played.sum()),
        parameters=tuple(counted.parameter(index, axis) for index, axis in enumerate(fine)),
        pairs=tuple(counted.pair(pair, (coarse[pair[0]], coarse[pair[1]])) for pair in pairs),
        fixed=tuple(_fixed(whole, space)),
        beyond=tuple(_beyond(whole, space)),
        kinds=kinds(record.collision for record in known),
    )


class _Counted:
    """Episodes, one a row."""

    def __init__(self, columns: Sequence[Floats], played: Bools, failed: Bools) -> None:
        """Takes the values of each scene parameter, `n`, and which episodes were played, and which failed."""
        self._columns, self.played, self._failed = columns, played, failed

    def parameter(self, index: int, axis: Axis) -> ParameterCoverage:
        places = axis.places(self._columns[index])
        played, failed, refused = (
            np.bincount(places[rows], minlength=len(axis.names)).tolist()
            for rows in (self.played, self._failed, ~self.played)
        )
        told = {name: getattr(axis.parameter, name) for name in ("name", "unit", "meaning", "low", "high")}
        return ParameterCoverage(
            **told,
            categorical=bool(axis.parameter.categories),
            bins=tuple(
                Bin(name=name, played=played[at], failed=failed[at], refused=refused[at])
                for at, name in enumerate(axis.names)
            ),
        )

    def pair(self, indices: tuple[int, int], axes: tuple[Axis, Axis]) -> PairCoverage:
        places = [axis.places(self._columns[index]) for index, axis in zip(indices, axes, strict=True)]
        played, failed = (np.zeros([len(axis.names) for axis in axes], dtype=bool) for _ in range(2))
        played[places[0][self.played], places[1][self.played]] = True
        failed[places[0][self._failed], places[1][self._failed]] = True
        return PairCoverage(
            parameters=(axes[0].parameter.name, axes[1].parameter.name),
            cells=played.size,
            played=int(played.sum()),
            failed=int(failed.sum()),
            never=tuple(f"{axes[0].names[i]} × {axes[1].names[j]}" for i, j in np.argwhere(~played)),
        )


def _fixed(odd: Odd, space: SceneSpace) -> Iterator[str]:
    varied = {parameter.odd for parameter in space.parameters}
    for branch in type(odd).model_fields:
        for name in type(getattr(odd, branch)).model_fields:
            if f"{branch}.{name}" not in varied:
                yield f"{branch}.{name}"


def _beyond(odd: Odd, space: SceneSpace) -> Iterator[str]:
    for parameter in space.parameters:
        allowed = field(odd, parameter.odd) if parameter.odd else None
        if not isinstance(allowed, Interval):
            continue
        for low, high in ((allowed.low, parameter.low), (parameter.high, allowed.high)):
            if high - low > TINY:
                yield f"{parameter.name} from {low:g} to {high:g} {parameter.unit}".removesuffix(" 1")
