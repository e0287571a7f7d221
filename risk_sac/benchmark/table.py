"""Tables and the figure of a benchmark; they can be made of the runs that have ended so far."""

import csv
import io
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from risk_sac.benchmark.detection import Detection
from risk_sac.benchmark.statistics import Summary, summaries, survival
from risk_sac.canvas import canvas, picture
from risk_sac.metrics.intervals import wilson_interval
from risk_sac.report.drawing import CURVE_IN, DPI, LOOKS, STYLE
from risk_sac.report.page import interval, number, table
from risk_sac.run_folder.durable import replace_file

COLUMNS = (
    *("defects", "family", "method", "seed", "budget_steps", "steps", "episodes"),
    *("reached", "triggered", "detected", "refuted", "signature"),
)
METHODS = (
    *("method", "runs", "detected", "falsification rate (95 %)", "mean steps", "median steps"),
    *("restricted mean steps (95 %)", "A12", "p (log-rank)", "always", "at least once", "never"),
)


def methods_table(detections: Sequence[Detection]) -> str:
    """Returns the table of methods: A12 and p are against random search."""
    return table(METHODS, [_row(each) for each in summaries(detections)])


def _row(each: Summary) -> list[str]:
    rate = f"{each.rate:.2f}{interval(*wilson_interval(each.detected, each.runs), '.2f')}"
    restricted = f"{each.restricted_mean:.0f}{interval(each.low, each.high, '.0f')}"
    told = (number(each.mean_steps, ".0f"), number(each.median_steps, ".0f"), restricted)
    tests = (number(each.a12, ".2f"), number(each.p, ".3g"))
    counts = map(str, (each.always, each.once, each.never))
    return [each.method, str(each.runs), str(each.detected), rate, *told, *tests, *counts]


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
        told = each.model_dump() | {"defects": "+".join(each.defects)}
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
        axes.step(places, shares, where="post", label=method, **LOOKS[method].line)
    axes.set(xlabel="environment steps", ylabel="share of runs that detected", ylim=(0.0, 1.0))
    axes.legend()
    return figure


def write(detections: Sequence[Detection], out: Path, command: str) -> None:
    """Writes what has ended so far: `detections.csv`, `benchmark.md` and `curves.svg`."""
    replace_file(out / "detections.csv", detections_csv(detections))
    text = "\n".join((f"`{command}`\n", methods_table(detections), defects_table(detections)))
    replace_file(out / "benchmark.md", text.encode())
    (drawn,) = picture(partial(curves, detections), ["svg"], DPI, STYLE)
    replace_file(out / "curves.svg", drawn)
