"""Power of a budget: how many known defects a method has detected within so many environment steps."""

import csv
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from math import comb
from typing import TYPE_CHECKING, NamedTuple

from risk_sac.config import CampaignSpec
from risk_sac.records import DefectPower, MethodPower, Power, RunBudget

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
    """Returns the runs that are shipped; none until the benchmark is measured under the present definitions."""
    return runs_of(MEASURED.read_text(encoding="utf-8"))


def played_by(finished: "Sequence[FinishedRun]") -> list[PlayedCounts]:
    """Returns what the searches of finished runs have played."""
    found = [(run.cell, run.metrics["search"]) for run in finished]
    return [PlayedCounts(*cell, search.episodes, search.environment_steps, ended=True) for cell, search in found]


def power_of(spec: CampaignSpec, played: Collection[PlayedCounts], runs: Sequence[BenchmarkRun] | None = None) -> Power:
    """Returns what the budget of a campaign is worth; says so where nothing was measured at all.

    Args:
      spec: of the campaign.
      played: by its searches so far. Only these count, but where a method has none yet in a family.
      runs: of the benchmark; those that are shipped if None.
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
    """Compares methods on equal terms: the defects and environment steps that all of them were measured with."""
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
    """Returns the most steps of a run that all methods may spend and were measured for."""
    measured_for: dict[tuple[str, str], int] = {}
    for run in runs:
        if run.family == family:
            cell = run.defect, run.method
            measured_for[cell] = max(measured_for.get(cell, 0), run.budget_steps)
    return min(
        *measured_for.values(), *(each.steps for one in methods for each in one.budgets if each.family == family)
    )


def method_power(method: str, budgets: Mapping[str, tuple[int, int]], runs: Sequence[BenchmarkRun]) -> MethodPower:
    """Returns how many known defects a method detects.

    Args:
      method: its name.
      budgets: family → environment steps of a run, and how many runs there are, each with a seed of its own.
      runs: of the benchmark.
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
    """Returns the chance that one of so many seeds detects the defect.

    It is the share of all choices of that many measured runs, or of all runs, in which at least one detected it.
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
    """Returns the budget of a run, by the method's episodes of the campaign, or else of the benchmark."""
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
