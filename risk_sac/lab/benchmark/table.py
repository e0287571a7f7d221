"""Tables and critical-difference diagrams of the benchmark.

Methods that a bar connects do not differ significantly (Nemenyi test at 5 % after a Friedman test).
Source: Demšar 2006, "Statistical comparisons of classifiers over multiple data sets".
"""

import csv
import io
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import get_args

import numpy as np
from matplotlib.figure import Figure

from risk_sac.config import RunMethod
from risk_sac.egos.defects.catalogue import DEFECTS, Tier
from risk_sac.failures.from_above import canvas, picture
from risk_sac.lab.benchmark.runs import Detection
from risk_sac.lab.benchmark.statistics import MethodSummary, balanced, friedman, restricted_means, summaries, survival
from risk_sac.metrics.metric import wilson_interval
from risk_sac.report.drawing import CURVE_IN, DPI, STYLE, look_of
from risk_sac.report.rendering import interval, number, platform_in_words, table
from risk_sac.run_folder.durable import replace_file
from risk_sac.world.types import Floats

PACKAGE, REMEDY = "scikit_posthocs", "for the diagram, pip install 'risk-sac[benchmark]'"
SIZE_IN = (6.4, 2.2)


def diagram(methods: Sequence[RunMethod], means: Floats) -> Figure:
    """Draws the mean ranks of the methods, 1 being the quickest.

    Args:
      methods: at least three.
      means: restricted mean steps to detection, `defects x methods`.
    """
    import scikit_posthocs
    from scipy.stats import rankdata

    ranks = dict(zip(methods, rankdata(means, axis=1).mean(axis=0), strict=True))
    p_values = scikit_posthocs.posthoc_nemenyi_friedman(means)
    p_values.index = p_values.columns = list(methods)
    figure = canvas(SIZE_IN)
    axes = figure.add_subplot()
    colours = {method: look_of(method).colour for method in methods}
    scikit_posthocs.critical_difference_diagram(ranks, p_values, ax=axes, color_palette=colours)
    axes.set_title("mean rank of steps to detection over defects", fontsize=9)
    return figure


COLUMNS = (
    *("defects", "family", "method", "seed", "budget_steps", "steps", "episodes"),
    *("reached", "triggered", "detected", "refuted", "kind", "driven_by"),
)
METHODS = (
    *("method", "runs", "falsification rate (95 %)", "mean steps", "median steps"),
    *("restricted mean steps (95 %)", "A12", "p (log-rank)", "in all runs", "in some", "never"),
)
LEGEND = (
    "Falsification rate: runs that detected their defect. Mean and median: over these runs. Restricted mean: over all"
    " runs, with the budget where there was no detection; bootstrap interval. A12: chance that random search takes"
    " longer on the same defect. p: log-rank test against random search. Last columns: defects that all runs, some run,"
    " or no run of the method detected.\n"
)


def sections(detections: Sequence[Detection]) -> dict[str, list[Detection]]:
    """Returns the runs of the test set, of each tier of it, and of all defects.

    Only tasks that every method has played count.
    """
    compared = balanced(detections)
    test_set = [run for run in compared if all(DEFECTS[name].test_set for name in run.defects)]
    named = {"test-set": test_set, **{f"{tier}-test-set": _of_tier(test_set, tier) for tier in get_args(Tier)}}
    if len(compared) > len(test_set):
        named["all"] = compared
    return {name: runs for name, runs in named.items() if runs}


def _of_tier(detections: Sequence[Detection], tier: Tier) -> list[Detection]:
    return [run for run in detections if all(DEFECTS[name].tier == tier for name in run.defects)]


def methods_table(detections: Sequence[Detection]) -> str:
    """Returns the table of methods: A12 and p are against random search."""
    return table(METHODS, methods_rows(detections))


def methods_rows(detections: Sequence[Detection]) -> list[list[str]]:
    """Returns the rows of the table of methods, below the columns `METHODS`."""
    return [_row(each) for each in summaries(detections)]


def _row(summary: MethodSummary) -> list[str]:
    rate = f"{summary.detected} of {summary.runs}{interval(*wilson_interval(summary.detected, summary.runs), '.2f')}"
    restricted = f"{summary.restricted_mean:.0f}{interval(summary.low, summary.high, '.0f')}"
    told = (number(summary.mean_steps, ".0f"), number(summary.median_steps, ".0f"), restricted)
    tests = (number(summary.a12, ".2f"), number(summary.p, ".3g"))
    counts = map(str, (summary.always, summary.once, summary.never))
    return [summary.method, str(summary.runs), rate, *told, *tests, *counts]


def defects_table(detections: Sequence[Detection]) -> str:
    """Returns how many runs of each method detected each defect, and the median steps of those that did."""
    methods = list(dict.fromkeys(each.method for each in detections))
    rows = []
    for defects in dict.fromkeys(each.defects for each in detections):
        of_defect = [each for each in detections if each.defects == defects]
        cells = [_cell([each for each in of_defect if each.method == method]) for method in methods]
        rows.append(["+".join(defects), of_defect[0].family, *cells])
    return table(["defect", "family", *methods], rows, left=2)


def _cell(runs: Sequence[Detection]) -> str:
    found = [each.detected for each in runs if each.detected is not None]
    return f"{len(found)} of {len(runs)}" + (f", {np.median(found):.0f}" if found else "")


def detections_csv(detections: Sequence[Detection]) -> bytes:
    """Returns a row for each run."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for each in detections:
        driven_by = each.episode.driven_by if each.episode else None
        told = each.model_dump() | {"defects": "+".join(each.defects), "driven_by": driven_by or ""}
        writer.writerow(told[name] for name in COLUMNS)
    return text.getvalue().encode()


def curves(detections: Sequence[Detection]) -> Figure:
    """Draws the share of runs that have detected their defect over environment steps (Kaplan-Meier)."""
    figure = canvas(CURVE_IN)
    axes = figure.add_subplot()
    for method in dict.fromkeys(each.method for each in detections):
        runs = [each for each in detections if each.method == method]
        steps, left = survival(runs)
        places = np.array([0.0, *steps, runs[0].budget_steps])
        shares = np.array([0.0, *(1.0 - left), 1.0 - left[-1]])
        axes.step(places, shares, where="post", label=method, **look_of(method).line)
    axes.set(xlabel="environment steps", ylabel="share of runs that detected", ylim=(0.0, 1.0))
    axes.legend()
    return figure


def write(detections: Sequence[Detection], out: Path, command: str) -> None:
    """Writes tables and figures of the runs that have ended."""
    replace_file(out / "detections.csv", detections_csv(detections))
    text = [f"`{command}`\n", f"{platform_in_words()}. {LEGEND}"]
    for name, runs in sections(detections).items():
        defects, seeds = {each.defects for each in runs}, {each.seed for each in runs}
        text.append(
            f"## {name.capitalize().replace('-', ' ')}: {len(defects)} defects, {len(seeds)} seeds, "
            f"{runs[0].budget_steps} steps\n"
        )
        text += [methods_table(runs), *_difference(runs, out, name), defects_table(runs)]
        _figure(partial(curves, runs), out / f"curves-{name}.svg")
    replace_file(out / "benchmark.md", "\n".join(text).encode())


def _difference(runs: Sequence[Detection], out: Path, name: str) -> list[str]:
    methods, means = restricted_means(runs)
    p = friedman(means)
    if p is None:
        return []
    told = f"Friedman test that the methods rank alike over defects: p = {p:.3g}"
    if find_spec(PACKAGE) is None:
        return [f"{told}; {REMEDY}.\n"]
    _figure(partial(diagram, methods, means), out / f"difference-{name}.svg")
    return [f"{told}; `difference-{name}.svg` has the critical differences (Nemenyi test).\n"]


def _figure(draw: Callable[[], Figure], file: Path) -> None:
    (drawn,) = picture(draw, [file.suffix[1:]], DPI, STYLE)
    replace_file(file, drawn)
