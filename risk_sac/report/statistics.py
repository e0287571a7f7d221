"""Compares methods on runs paired by seed; estimates a budget's detected defects.

Source: Arcuri & Briand 2014, A hitchhiker's guide to statistical tests for assessing randomized algorithms in
software engineering: report an effect size beside every p-value.
"""

import csv
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from math import comb
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.config import CampaignSpec, FamilyName, MethodName
from risk_sac.metrics import RESAMPLING_SEED, MetricName, bootstrap_interval
from risk_sac.records import DefectPower, MethodPower, Phase, Power, RunBudget

LEVEL = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTest:
    """The reference against another method in one metric, runs paired by seed."""

    family: FamilyName
    phase: Phase
    metric: MetricName
    """Or what a user pays for, `headline failures within 30 CPU s`."""
    reference: MethodName
    method: MethodName
    pairs: int
    """Seeds for which both have a value."""
    difference: float | None
    """Mean of reference - method; null without a pair."""
    low: float | None
    """95 % interval of the difference, bootstrapped over the pairs; null with fewer than two."""
    high: float | None
    p: float | None
    """Wilcoxon signed-rank, exact, two-sided; null with fewer than two pairs."""
    p_holm: float | None
    """Corrected over the tests of the same family and phase that were declared beforehand, or over all others."""
    a12: float | None
    """Vargha-Delaney: chance that the reference's value is the larger one."""

    __pydantic_config__ = {"use_attribute_docstrings": True}  # noqa: RUF012 - a body of the service shows it

    @property
    def significant(self) -> bool:
        """Whether the corrected p is below 5 %."""
        return self.p_holm is not None and self.p_holm < LEVEL


Values = Mapping[int, float | None]
"""Seed → the value of its run; None where it has none."""


def paired_tests(
    family: FamilyName, phase: Phase, metric: MetricName, reference: MethodName, values: Mapping[MethodName, Values]
) -> Iterator[PairedTest]:
    """Test the reference against every other method in one metric; not corrected."""
    ours = values[reference]
    for method, theirs in values.items():
        if method == reference:
            continue
        both = [(ours[seed], theirs[seed]) for seed in sorted(ours.keys() & theirs.keys())]
        pairs = [(one, other) for one, other in both if one is not None and other is not None]
        differences = [one - other for one, other in pairs]
        low, high = bootstrap_interval(differences, RESAMPLING_SEED) if len(pairs) > 1 else (None, None)
        yield PairedTest(
            family=family,
            phase=phase,
            metric=metric,
            reference=reference,
            method=method,
            pairs=len(pairs),
            difference=sum(differences) / len(pairs) if pairs else None,
            low=low,
            high=high,
            p=wilcoxon_p(differences) if len(pairs) > 1 else None,
            p_holm=None,
            a12=vargha_delaney(*zip(*pairs, strict=True)) if pairs else None,
        )


def corrected(tests: Sequence[PairedTest]) -> Iterator[PairedTest]:
    """Holm over the tests that have a p."""
    adjusted = iter(holm([test.p for test in tests if test.p is not None]))
    for test in tests:
        yield test if test.p is None else replace(test, p_holm=next(adjusted))


DECIMALS = 12  # beyond which two differences are the same


def wilcoxon_p(differences: Sequence[float]) -> float:
    """Exact two-sided p of Wilcoxon's signed-rank test; 1 without any difference.

    Under the null hypothesis each |difference| is as likely to be positive as negative. The distribution of the rank
    sum is counted over all 2^n signs, with the mid-ranks that the differences have, so ties keep it exact.
    Choice: zero differences are left out, as Wilcoxon did; differences that only rounding tells apart are ties.

    Source: Wilcoxon 1945, Individual comparisons by ranking methods.
    """
    values = np.round(np.asarray(differences, dtype=np.float64), DECIMALS)
    values = values[values != 0.0]
    if not values.size:
        return 1.0
    doubled = _doubled_ranks(np.abs(values))
    ways = [1]  # ways[s]: in how many of the sign patterns the doubled ranks of the positives sum to s
    for rank in doubled:
        longer = ways + [0] * rank
        for total, count in enumerate(ways):
            longer[total + rank] += count
        ways = longer
    positive = sum(rank for rank, value in zip(doubled, values, strict=True) if value > 0)
    least = min(positive, sum(doubled) - positive)
    return min(1.0, 2 * sum(ways[: least + 1]) / (1 << len(values)))


def smallest_p(pairs: int) -> float:
    """Returns `wilcoxon_p`'s least p for `pairs`: all differences on one side."""
    return min(1.0, 2 / (1 << pairs))


class PairPower(NamedTuple):
    """Statistical power of tests with this number of pairs."""

    hypotheses: int  # that have a p
    pairs: int
    smallest: float  # p that so many pairs can give
    corrected: float  # over all hypotheses
    needed: int | None  # pairs with which one can pass, where these are too few for any


def pair_power(tests: Sequence[PairedTest]) -> PairPower:
    """Computes what tests with so many pairs can show."""
    hypotheses, pairs = sum(test.p is not None for test in tests), max(test.pairs for test in tests)
    corrected = hypotheses * smallest_p(pairs)
    needed = 1 + math.ceil(math.log2(hypotheses / LEVEL)) if corrected > LEVEL else None
    return PairPower(hypotheses, pairs, smallest_p(pairs), min(1.0, corrected), needed)


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's step-down correction: adjusted p-values, in the order given.

    p̃_(i) = max_{j <= i} min(1, (m - j + 1) p_(j))  with p_(1) <= ... <= p_(m)

    Source: Holm 1979, A simple sequentially rejective multiple test procedure.
    """
    adjusted = [0.0] * len(p_values)
    largest = 0.0
    for place, index in enumerate(sorted(range(len(p_values)), key=lambda each: p_values[each])):
        largest = max(largest, min(1.0, (len(p_values) - place) * p_values[index]))
        adjusted[index] = largest
    return adjusted


def vargha_delaney(first: Sequence[float], second: Sequence[float]) -> float:
    """Computes A12: P(first value exceeds a second), where ties count half.

    Source: Vargha & Delaney 2000, A critique and improvement of the CL common language effect size statistics.
    """
    ordered = np.sort(np.asarray(second, np.float64))
    below, up_to = (int(np.searchsorted(ordered, first, side).sum()) for side in ("left", "right"))
    return (below + up_to) / 2 / (len(first) * len(second))


def _doubled_ranks(values: NDArray[np.float64]) -> list[int]:
    """Returns twice each value's mid-rank, as mid-ranks may end in one half."""
    ordered = np.sort(values)
    below = np.searchsorted(ordered, values, side="left")
    up_to = np.searchsorted(ordered, values, side="right")
    return [int(rank) for rank in below + up_to + 1]


if TYPE_CHECKING:
    from risk_sac.report import FinishedRun


MEASURED = files("risk_sac.report") / "measured" / "detections.csv"  # as `risk-sac benchmark` writes it
NOTE = (
    "Known defects were planted into egos of ours, and searched for with default settings in the whole of each family. "
    "That measures a method and its budget. It is the same whichever ego this campaign has, remote ones included, and "
    "tells nothing about that ego."
)


NOT_MEASURED = (
    "Not measured under these definitions of a failure: what finding nothing is worth is unknown until the benchmark "
    "is run again."
)


class BenchmarkRun(NamedTuple):
    """A run of the benchmark, as `detections.csv` has it."""

    defect: str
    family: str
    method: str
    budget_steps: int
    steps: int
    episodes: int
    detected: int | None


class PlayedCounts(NamedTuple):
    """Counts what a run of a search has played."""

    family: str
    method: str
    episodes: int
    steps: int
    ended: bool


def runs_of(text: str) -> list[BenchmarkRun]:
    """Returns the runs of a `detections.csv`."""
    numbers = ("budget_steps", "steps", "episodes")
    return [
        BenchmarkRun(
            defect=row["defects"],
            family=row["family"],
            method=row["method"],
            detected=int(row["detected"]) if row["detected"] else None,
            **{name: int(row[name]) for name in numbers},
        )
        for row in csv.DictReader(text.splitlines())
    ]


@cache
def measured() -> Sequence[BenchmarkRun]:
    """Returns the shipped runs; none without a benchmark under present definitions."""
    return runs_of(MEASURED.read_text(encoding="utf-8"))


def played_by(finished: "Sequence[FinishedRun]") -> list[PlayedCounts]:
    """Returns what the searches of finished runs have played."""
    found = [(run.cell, run.metrics["search"]) for run in finished]
    return [PlayedCounts(*cell, search.episodes, search.environment_steps, ended=True) for cell, search in found]


def power_of(spec: CampaignSpec, played: Collection[PlayedCounts], runs: Sequence[BenchmarkRun] | None = None) -> Power:
    """Returns a campaign budget's power; says so if nothing was measured.

    Only what its searches have `played` counts, but where a method has none yet in a family. `runs` are the
    benchmark's; the shipped ones if None.
    """
    methods, runs = [], measured() if runs is None else runs
    if not runs:
        return Power(note=NOT_MEASURED, comparison="", methods=())
    for method in spec.methods:
        known = {run.family for run in runs if run.method == method}
        budgets = tuple(_budget(spec, family, method, played, runs) for family in spec.families if family in known)
        power = method_power(method, {each.family: (each.steps, each.runs) for each in budgets}, runs)
        sentences = [*(power.sentences if budgets else ()), *map(_in_words, budgets)]
        if lacking := [family for family in spec.families if family not in known]:
            sentences.append(f"Nothing was measured of {method} in {', '.join(lacking)}.")
        methods.append(power.model_copy(update={"budgets": budgets, "sentences": tuple(sentences)}))
    return Power(note=NOTE, comparison=_comparison(methods, runs), methods=tuple(methods))


def _comparison(methods: Sequence[MethodPower], runs: Sequence[BenchmarkRun]) -> str:
    """Compares methods on defects and environment steps common to all of them."""
    budgeted = [each for each in methods if each.budgets]
    if len(budgeted) < 2:
        return ""
    shared = set.intersection(*({(each.defect, each.family) for each in method.defects} for method in budgeted))
    if not shared:
        return "No known defect was measured with all of these methods: do not compare the counts below."
    names = {each.method for each in budgeted}
    runs = [run for run in runs if run.method in names and (run.defect, run.family) in shared]
    limits = {family: _shared_steps(family, budgeted, runs) for family in sorted({family for _, family in shared})}
    expected = {}
    for method in budgeted:
        budgets = {each.family: (limits[each.family], each.runs) for each in method.budgets if each.family in limits}
        expected[method.method] = method_power(method.method, budgets, runs).expected
    spent = " and ".join(f"{steps:,} environment steps in {family}" for family, steps in limits.items())
    return (
        f"On equal terms: all of these methods were measured with {len(shared)} known defects, within {spent}. "
        f"Of these they detect on average: {', '.join(f'{name} {value:.3g}' for name, value in expected.items())}. "
        "The counts below are of each method's own budget and all of its defects: do not compare them."
    )


def _shared_steps(family: str, methods: Sequence[MethodPower], runs: Sequence[BenchmarkRun]) -> int:
    """Returns the most run steps allowed and measured for all methods."""
    measured_for: dict[tuple[str, str], int] = {}
    for run in runs:
        if run.family == family:
            cell = run.defect, run.method
            measured_for[cell] = max(measured_for.get(cell, 0), run.budget_steps)
    return min(
        *measured_for.values(), *(each.steps for one in methods for each in one.budgets if each.family == family)
    )


def method_power(method: str, budgets: Mapping[str, tuple[int, int]], runs: Sequence[BenchmarkRun]) -> MethodPower:
    """Returns how many known defects a method's budgets detect.

    Budgets are by family: steps of a run, and runs.
    """
    defects, at_least = [], False
    of_method = [run for run in runs if run.method == method and run.family in budgets]
    for defect, family in dict.fromkeys((run.defect, run.family) for run in of_method):
        of_defect = [run for run in of_method if (run.defect, run.family) == (defect, family)]
        limit = min(budgets[family][0], max(run.budget_steps for run in of_defect))
        at_least |= limit < budgets[family][0]
        long_enough = [run for run in of_defect if run.budget_steps >= limit]
        detected = sum(run.detected is not None and run.detected <= limit for run in long_enough)
        defects.append(DefectPower(defect=defect, family=family, detected=detected, runs=len(long_enough)))
    expected = sum(_chance(each, budgets[each.family][1]) for each in defects)
    once = tuple(each.defect for each in defects if each.detected)
    most = tuple(each.defect for each in defects if 2 * each.detected > each.runs)
    never = tuple(each.defect for each in defects if not each.detected)
    families = ", ".join(family for family in budgets if any(each.family == family for each in defects))
    about = f"{'at least ' if at_least else ''}{expected:.3g} on average"
    sentence = (
        f"Of {len(defects)} known defects that it was measured with in {families}, this budget detects {about}; "
        f"never found: {', '.join(never) or 'none'}."
    )
    return MethodPower(
        method=method,
        budgets=(),
        defects=tuple(defects),
        expected=expected,
        at_least=at_least,
        in_most_seeds=most,
        at_least_once=once,
        never=never,
        sentences=(sentence, *_basis(defects)),
    )


def _chance(defect: DefectPower, seeds: int) -> float:
    """Returns the share of choices of runs in which one detects.

    Each choice has so many of the measured runs.
    """
    chosen = min(seeds, defect.runs)
    return 1 - comb(defect.runs - defect.detected, chosen) / comb(defect.runs, chosen)


def _basis(found: Sequence[DefectPower]) -> Iterator[str]:
    if found:
        least, most = min(each.runs for each in found), max(each.runs for each in found)
        yield f"Seeds that were measured: {least if least == most else f'{least} to {most}'} of each defect."


def _budget(
    spec: CampaignSpec, family: str, method: str, played: Collection[PlayedCounts], runs: Sequence[BenchmarkRun]
) -> RunBudget:
    """Returns a run's budget by episodes of the campaign, else the benchmark."""
    cell = (family, method)
    own = [each for each in played if (each.family, each.method) == cell]
    begun = any(each.steps for each in own)
    known: Sequence[PlayedCounts | BenchmarkRun] = (
        own if begun else [run for run in runs if (run.family, run.method) == cell]
    )
    mean = sum(each.steps for each in known) / sum(each.episodes for each in known)
    episodes = [each.episodes if each.ended else spec.budget.episodes for each in own] or [spec.budget.episodes]
    return RunBudget(
        family=family,
        runs=len(own) or len(spec.seeds),
        episodes=round(sum(episodes) / len(episodes)),
        steps_per_episode=mean,
        estimated_from="campaign" if begun else "benchmark",
        steps=round(mean * sum(episodes) / len(episodes)),
    )


def _in_words(budget: RunBudget) -> str:
    whose = "its own episodes" if budget.estimated_from == "campaign" else "episodes of the benchmark"
    runs = "1 run" if budget.runs == 1 else f"{budget.runs} runs"
    return (
        f"In {budget.family}: {runs} of {budget.episodes} episodes, which are {budget.steps:,} environment steps "
        f"at the mean of {whose}, {budget.steps_per_episode:.0f}."
    )
