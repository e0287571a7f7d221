"""Computes scene parameters' effects on failures, and the played parts of the ODD.

Scenes of the searches alone count; a scene that was refused before its first step does not. Pure.
"""

from collections.abc import Iterable, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import FamilyName, Odd
from risk_sac.records import EpisodeRecord, Outcome, Real, Record
from risk_sac.report.coverage import NOT_PLAYED, Axis, axes_of
from risk_sac.scenario.families import family_named
from risk_sac.world.types import Bools, Floats
from service.store.stored import StoredCampaign, StoredRecord

BINS = 6  # of each parameter, so that a matrix of two can be read
Counts = NDArray[np.int64]


class SceneParameterEffect(Record):
    """Effect of a scene parameter on failure, and the episodes played in each part of it."""

    name: str
    unit: str
    meaning: str
    effect: Real
    """Vargha and Delaney's A12: the probability that a failing scene has a larger value than a safe one, ties counted
    half. 0.5: no difference; null without failing or without safe scenes."""
    p: Real
    """Two-sided p of the Mann-Whitney U test, times the number of parameters. A search chooses its scenes, so this is
    a hint and no proof. It sees no effect that rises and falls again; `failed` by `played` does."""
    bins: list[str]
    """Ranges of equal width in `unit`, or categories."""
    played: list[int]
    """Episodes in each bin."""
    failed: list[int]
    """Of these, the failures."""


class PairPlayed(Record):
    """Cells of two scene parameters, with the episodes played in each."""

    parameters: tuple[str, str]
    played: list[list[int]]
    """Episodes by the bin of the first parameter, then of the second."""
    failed: list[list[int]]
    """Of these, the failures."""


class FamilySceneEffects(Record):
    """The scenes of one family."""

    family: FamilyName
    episodes: int
    """That were played."""
    failures: int
    """Of these, by any requirement that counts."""
    parameters: list[SceneParameterEffect]
    """The largest effect first."""
    pairs: list[PairPlayed]


class SceneEffects(Record):
    """Scenes of a campaign, by family."""

    families: list[FamilySceneEffects]
    """Those in which an episode was played."""


def scene_effects(campaign: StoredCampaign, episodes: Iterable[StoredRecord]) -> SceneEffects:
    """Compares failing with safe scenes, and counts what was played."""
    families = {run.number: run.family for run in campaign.searches}
    records: dict[str, list[EpisodeRecord]] = {}
    for each in episodes:
        if each.record.outcome not in NOT_PLAYED:
            records.setdefault(families[each.run_number], []).append(each.record)
    return SceneEffects(families=[_family(name, campaign.spec.odd, played) for name, played in records.items()])


def _family(name: str, odd: Odd, played: Sequence[EpisodeRecord]) -> FamilySceneEffects:
    axes = axes_of(family_named(name), odd, BINS)
    played = [record for record in played if {axis.parameter.name for axis in axes} <= record.scene.keys()]
    failed = np.array([record.outcome is Outcome.FAILURE for record in played], dtype=bool)
    columns = [np.array([record.scene[axis.parameter.name] for record in played]) for axis in axes]
    placed = [(axis, axis.places(column)) for axis, column in zip(axes, columns, strict=True)]
    effects = [
        _effect(axis, column, places, failed, len(axes)) for (axis, places), column in zip(placed, columns, strict=True)
    ]
    return FamilySceneEffects(
        family=name,
        episodes=len(played),
        failures=int(failed.sum()),
        parameters=sorted(effects, key=lambda each: -abs((0.5 if each.effect is None else each.effect) - 0.5)),
        pairs=[_pair(*both, failed) for both in combinations(placed, 2)],
    )


def _effect(axis: Axis, column: Floats, places: Counts, failed: Bools, tests: int) -> SceneParameterEffect:
    effect, p = _a12(column[failed], column[~failed])
    played, failures = (np.bincount(places[rows], minlength=len(axis.names)) for rows in (slice(None), failed))
    return SceneParameterEffect(
        **{name: getattr(axis.parameter, name) for name in ("name", "unit", "meaning")},
        effect=effect,
        p=min(1.0, p * tests),
        bins=list(axis.names),
        played=played.tolist(),
        failed=failures.tolist(),
    )


def _a12(failing: Floats, safe: Floats) -> tuple[float, float]:
    """Vargha and Delaney's A12 of two samples and its p, NaN where one of them is empty."""
    from scipy.stats import mannwhitneyu  # here, because few ask for it, and every process of a server loads this

    if not failing.size or not safe.size:
        return np.nan, np.nan
    if np.ptp(np.concatenate([failing, safe])) == 0:  # a parameter that the ODD fixes
        return 0.5, 1.0
    tested = mannwhitneyu(failing, safe, method="asymptotic")
    return float(tested.statistic / (failing.size * safe.size)), float(tested.pvalue)


def _pair(first: tuple[Axis, Counts], second: tuple[Axis, Counts], failed: Bools) -> PairPlayed:
    (one, rows), (other, columns) = first, second
    cells = np.zeros((2, len(one.names), len(other.names)), dtype=np.int64)
    np.add.at(cells[0], (rows, columns), 1)
    np.add.at(cells[1], (rows[failed], columns[failed]), 1)
    played, failures = cells.tolist()
    return PairPlayed(parameters=(one.parameter.name, other.parameter.name), played=played, failed=failures)
