"""Results so far, curves of searches, and effects of parameters.

Live figures of runs that go on; `service.views.reports` compares those that have finished. Mean ECR and PCR and their
intervals are those of the report. Pure.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import FamilyName, MethodName, Odd
from risk_sac.env.problem import adjustments
from risk_sac.metrics import (
    METRICS,
    RATIOS,
    WINDOW,
    estimate,
    headline_driven_by,
    mean_over_runs,
    pcr_by_driver,
    pooled_bins,
    pooled_counts,
    pooled_headline,
    pooled_names,
    pooled_published,
    pooled_requirements,
)
from risk_sac.records import (
    Adjustment,
    Counts,
    DrivenBy,
    EpisodeRecord,
    Outcome,
    Real,
    Record,
    Results,
    RunMetrics,
    State,
    Total,
)
from risk_sac.report.coverage import NOT_PLAYED, Axis, axes_of
from risk_sac.report.statistics import PlayedCounts
from risk_sac.scenario.families import family_named
from risk_sac.verdicts.distinct import DistinctFailures
from risk_sac.world.types import Bools, Floats
from service.errors import OutdatedError
from service.store.stored import StoredCampaign, StoredRecord, StoredRun


def results(campaign: StoredCampaign) -> Results:
    """Results so far; complete once the campaign has ended."""
    return Results(
        campaign_id=campaign.id,
        state=campaign.state,
        complete=campaign.state.final,
        headline=campaign.headline,
        headline_published=campaign.headline_published,
        adjustments=_adjustments(campaign),
        runs=campaign.runs,
        totals=totals(campaign.searches),
    )


def played(campaign: StoredCampaign) -> list[PlayedCounts]:
    """Returns the counts of each search so far."""
    found = [(run, run.metrics or Counts()) for run in campaign.searches]
    return [
        PlayedCounts(run.family, run.method, did.episodes, did.environment_steps, run.state.final) for run, did in found
    ]


def _adjustments(campaign: StoredCampaign) -> tuple[Adjustment, ...]:
    try:
        return adjustments(campaign.spec)
    except OutdatedError:
        return ()


def totals(runs: Sequence[StoredRun]) -> list[Total]:
    """Returns a total per family and method of begun runs, in order."""
    groups: dict[tuple[str, str], list[RunMetrics]] = {}
    for run in runs:
        if run.metrics is not None:
            groups.setdefault((run.family, run.method), []).append(run.metrics)
    return [_total(family, method, group) for (family, method), group in groups.items()]


def _total(family: str, method: str, group: Sequence[RunMetrics]) -> Total:
    counts = pooled_counts(group)
    return Total.model_validate(
        dict(counts)
        | {ratio.name: ratio.formula(counts) for ratio in RATIOS}
        | _means(group)
        | {
            "family": family,
            "method": method,
            "runs": len(group),
            "headline": pooled_headline(group),
            "headline_published": pooled_published(group),
            "requirements": pooled_requirements(group),
            "pcr_by_driver": pcr_by_driver(group),
            "episodes_driven_by": pooled_names([metrics.episodes_driven_by for metrics in group]),
            "headline_driven_by": headline_driven_by(group),
            "by_severity": pooled_names([metrics.by_severity for metrics in group]),
            "by_fault": pooled_names([metrics.by_fault for metrics in group]),
            "kinds": pooled_names([metrics.kinds for metrics in group]),
            "conflicts_by_second": pooled_bins([metrics.conflicts_by_second for metrics in group]),
            "contacts_by_second": pooled_bins([metrics.contacts_by_second for metrics in group]),
        }
    )


def _means(group: Sequence[RunMetrics]) -> dict[str, float | None]:
    means: dict[str, float | None] = {}
    for metric in METRICS:
        if metric.field not in Total.model_fields:
            continue
        means[metric.field] = mean_over_runs(metric, group)
        if f"{metric.field}_low" in Total.model_fields:
            pooled = estimate(metric, group)
            means |= {f"{metric.field}_low": pooled.low, f"{metric.field}_high": pooled.high}
    return means


Spread = NDArray[np.int64]


class RunCurves(Record):
    """Curves of a search, an entry per point; later refused failures excluded."""

    run_id: str
    family: FamilyName
    method: MethodName
    seed: int
    state: State
    episodes: list[int]
    """How many episodes of the search there were; evenly spread, the newest included."""
    window_ecr: list[Real]
    """ECR over the newest 100 episodes by then: valid contacts alone."""
    window_pcr: list[Real]
    """PCR over the newest 100 episodes by then: valid contacts alone."""
    distinct: list[int]
    """Distinct violations so far, of all requirements that count."""
    preventable: list[int]
    """Failures so far that a reference driver would have prevented, repetitions included."""
    distinct_preventable: list[int]
    """The distinct ones among them."""
    dual_variable: list[Real]
    """λ after the last episode."""
    driven_by: Mapping[DrivenBy, list[int]]
    """What drove the adversaries → episodes so far; without what never did."""
    mean_cost: list[Real]
    """Realism cost per step of the episodes since the point before; null where none of them was simulated."""


class Curves(Record):
    """Curves of all runs of a campaign, in queue order."""

    runs: list[RunCurves]


def curves(campaign: StoredCampaign, episodes: Iterable[StoredRecord], points: int) -> Curves:
    """Returns curves of all searches, each with at most `points` points."""
    searches = {run.number: _RunningSums() for run in campaign.searches}
    for each in episodes:
        if each.record.searching:
            searches[each.run_number].add(each.record)
    return Curves(runs=[_curves(run, searches[run.number], points) for run in campaign.searches])


@dataclass(slots=True)
class _RunningSums:
    rated: list[int] = field(default_factory=list)  # so far: episodes in which the ego did not fail to drive
    contacts: list[bool] = field(default_factory=list)  # valid ones, of these episodes alone
    preventable_contacts: list[bool] = field(default_factory=list)
    preventable: list[bool] = field(default_factory=list)
    distinct: list[int] = field(default_factory=list)
    distinct_preventable: list[int] = field(default_factory=list)
    driven_by: list[str | None] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    cost: list[float] = field(default_factory=list)  # summed over the steps
    dual_variable: list[float] = field(default_factory=list)
    _kinds: DistinctFailures = field(default_factory=DistinctFailures)
    _preventable_kinds: DistinctFailures = field(default_factory=DistinctFailures)

    def add(self, record: EpisodeRecord) -> None:
        valid = record.valid_violations
        preventable = [violation for violation in valid if violation.preventable]
        if record.outcome is not Outcome.INVALID:
            contact = record.collision
            self.contacts.append(contact is not None and contact.valid)
            self.preventable_contacts.append(contact is not None and contact.preventable)
        self.rated.append(len(self.contacts))
        self.preventable.append(bool(preventable))
        self.distinct.append(sum(map(self._kinds.add, valid)))
        self.distinct_preventable.append(sum(map(self._preventable_kinds.add, preventable)))
        self.driven_by.append(record.driven_by)
        self.steps.append(record.steps)
        self.cost.append(record.mean_cost * record.steps if record.steps else 0.0)
        self.dual_variable.append(record.dual_variable)


def _curves(run: StoredRun, search: _RunningSums, points: int) -> RunCurves:
    at = spread(len(search.steps), points)
    steps, cost = (np.diff(_summed(each)[at], prepend=0.0) for each in (search.steps, search.cost))
    lines = {name: _summed(getattr(search, name))[at] for name in ("distinct", "preventable", "distinct_preventable")}
    rated = np.array([0, *search.rated])[at]
    lines |= {
        "window_ecr": _window(search.contacts, rated),
        "window_pcr": _window(search.preventable_contacts, rated),
        "dual_variable": np.array([0.0, *search.dual_variable])[at],
        "mean_cost": np.divide(cost, steps, out=np.full(len(at), np.nan), where=steps > 0.0),
    }
    named = {name: getattr(run, name) for name in ("family", "method", "seed", "state")}
    values = {name: line.tolist() for name, line in lines.items()}
    drove = {
        driver: _summed([name == driver for name in search.driven_by])[at].tolist()
        for driver in DrivenBy
        if driver in search.driven_by
    }
    return RunCurves.model_validate(named | values | {"run_id": run.id, "episodes": at.tolist(), "driven_by": drove})


def spread(count: int, points: int) -> Spread:
    """Returns at most `points` of 1, …, `count`, evenly, the last included."""
    if count == 0:
        return np.empty(0, dtype=np.int64)
    return np.unique(-(-count * np.arange(1, points + 1) // points))


def _summed(values: Sequence[float]) -> Floats:
    """Sums of the first 0, 1, 2, … values."""
    return np.concatenate((np.zeros(1), np.cumsum(values)))


def _window(happened: Sequence[bool], at: Spread) -> Floats:
    """Share of the newest `WINDOW` episodes by then in which it happened."""
    sums, before = _summed(happened), np.maximum(at - WINDOW, 0)
    shares: Floats = (sums[at] - sums[before]) / np.maximum(at - before, 1)
    return shares


BINS = 6  # of each parameter, so that a matrix of two can be read
Bins = NDArray[np.int64]


class SceneParameterEffect(Record):
    """Effect of a scene parameter on failure, and episodes per part."""

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


def _effect(axis: Axis, column: Floats, places: Bins, failed: Bools, tests: int) -> SceneParameterEffect:
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
    """Returns Vargha and Delaney's A12 and p, NaN for an empty sample."""
    from scipy.stats import mannwhitneyu  # here, because few ask for it, and every process of a server loads this

    if not failing.size or not safe.size:
        return np.nan, np.nan
    if np.ptp(np.concatenate([failing, safe])) == 0:  # a parameter that the ODD fixes
        return 0.5, 1.0
    tested = mannwhitneyu(failing, safe, method="asymptotic")
    return float(tested.statistic / (failing.size * safe.size)), float(tested.pvalue)


def _pair(first: tuple[Axis, Bins], second: tuple[Axis, Bins], failed: Bools) -> PairPlayed:
    (one, rows), (other, columns) = first, second
    cells = np.zeros((2, len(one.names), len(other.names)), dtype=np.int64)
    np.add.at(cells[0], (rows, columns), 1)
    np.add.at(cells[1], (rows[failed], columns[failed]), 1)
    played, failures = cells.tolist()
    return PairPlayed(parameters=(one.parameter.name, other.parameter.name), played=played, failed=failures)
