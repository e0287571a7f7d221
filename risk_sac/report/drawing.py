"""Draws the figures of a comparison with matplotlib."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from risk_sac.config import RunMethod
from risk_sac.failures.from_above import canvas, picture
from risk_sac.metrics import RESAMPLING_SEED
from risk_sac.report.comparison import Comparison
from risk_sac.report.figures import Bars, FamilyCurves, Format, Times, curve_values
from risk_sac.world.types import Floats

RESAMPLES = 2000  # per curve; a band needs less than a table
CURVE_IN, BARS_IN, TIMES_IN, DPI = (6.4, 3.4), (7.2, 3.2), (7.2, 3.0), 200
STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
}


@dataclass(frozen=True, slots=True)
class Look:
    """Style of a method in every figure."""

    colour: str
    dashes: str
    width: float = 1.3

    @property
    def line(self) -> dict[str, Any]:
        """As arguments of matplotlib."""
        return {"color": self.colour, "linestyle": self.dashes, "linewidth": self.width}


# One for each method, so that it looks the same whichever others are compared. The page reads the same file.
PALETTE = files("risk_sac.report") / "palette.json"
LOOKS: dict[RunMethod, Look] = {
    method: Look(**look) for method, look in json.loads(PALETTE.read_text(encoding="utf-8")).items()
}
OTHER = Look("#999999", ":")  # of a method without one, such as a sampler of the user's


def look_of(method: RunMethod) -> Look:
    """Returns the style of a method."""
    return LOOKS.get(method, OTHER)


def draw(comparison: Comparison, figure: FamilyCurves | Times | Bars, formats: Sequence[Format]) -> list[bytes]:
    """Returns a figure's files by format; equal comparisons give equal bytes."""
    return picture(partial(_draw, comparison, figure), formats, DPI, STYLE)


def _draw(comparison: Comparison, figure: FamilyCurves | Times | Bars) -> Figure:
    match figure:
        case FamilyCurves():
            return _curves(comparison, figure)
        case Times():
            return _times(comparison, figure)
        case Bars():
            return _bars(comparison, figure)


def _curves(comparison: Comparison, drawn: FamilyCurves) -> Figure:
    family, curve = drawn.family, drawn.curve
    figure, axes = _canvas(CURVE_IN)
    counts = []
    for rank, (method, at, values) in enumerate(curve_values(comparison, family, curve)):
        counts.append(len(values))
        look = look_of(method)
        first = min(curve.first, len(at)) - 1
        at, values = at[first:], values[:, first:]
        axes.plot(at, values.mean(axis=0), label=method, zorder=100 - rank, **look.line)  # the reference lies on top
        if len(values) > 1:
            axes.fill_between(at, *_band(values), color=look.colour, alpha=0.13, linewidth=0, zorder=1)
    axes.set_xlabel("processor time, s" if curve.timed else "search episode")
    axes.set_ylabel(curve.label)
    axes.margins(x=0)
    if curve.log:
        axes.set_yscale("log")
    else:
        axes.set_ylim(0, curve.top)
    band = "; band: 95 % bootstrap interval" if max(counts) > 1 else ""
    axes.set_title(f"{family}: mean over {_seeds(counts)}{band}", fontsize=9, loc="left")
    _legend(figure, axes)
    return figure


def _band(values: Floats) -> tuple[Floats, Floats]:
    """Pointwise bootstrap over the runs, all points by the same draws."""
    runs = len(values)
    drawn = np.random.default_rng(RESAMPLING_SEED).multinomial(runs, [1 / runs] * runs, size=RESAMPLES)
    low, high = np.quantile(drawn / runs @ values, (0.025, 0.975), axis=0)
    return low, high


def _bars(comparison: Comparison, drawn: Bars) -> Figure:
    metric, phase = drawn.metric, drawn.phase
    figure, axes = _canvas(BARS_IN)
    families = [family for family in comparison.spec.families if comparison.group(family, phase)]
    methods = [method for method in comparison.methods if any(cell.method == method for cell in comparison.cells)]
    width = 0.84 / len(methods)
    counts = []
    for place, method in enumerate(methods):
        for middle, family in enumerate(families):
            cells = [cell for cell in comparison.group(family, phase) if cell.method == method]
            estimate = cells[0].estimates[metric.name] if cells else None
            x = middle + (place - (len(methods) - 1) / 2) * width
            counts += [estimate.runs] if estimate and estimate.runs else []
            mean = estimate.mean if estimate else None
            if not mean:  # an invisible bar
                axes.text(x, 0, "–" if mean is None else "0", ha="center", va="bottom", color="0.4", fontsize=7)
            axes.bar(x, mean or 0.0, 0.9 * width, color=look_of(method).colour, label="" if middle else method)
            if estimate and mean is not None and estimate.low is not None and estimate.high is not None:
                error = [[mean - estimate.low], [estimate.high - mean]]
                axes.errorbar(x, mean, error, color="0.35", linewidth=0.9, capsize=1.5 if len(methods) > 5 else 3)
    axes.set_xticks(range(len(families)), families)
    axes.tick_params(axis="x", length=0)
    axes.grid(visible=False, axis="x")
    axes.set_ylabel(f"{metric.symbol} ({phase})")
    axes.set_ylim(bottom=0)
    interval = "; lines: 95 % bootstrap interval" if max(counts, default=0) > 1 else ""
    axes.set_title(f"mean over {_seeds(counts)}{interval}; –: no value", fontsize=9, loc="left")
    _legend(figure, axes)
    return figure


def _times(comparison: Comparison, drawn: Times) -> Figure:
    family, phase = drawn.family, drawn.phase
    figure = canvas(TIMES_IN)
    conflict, contact = figure.subplots(1, 2, sharex=True, sharey=True)
    counts = []
    for cell in (cell for cell in comparison.group(family, phase) if any(cell.contacts_by_second)):
        counts.append(len(cell.seeds))
        for axes, bins in ((conflict, cell.conflicts_by_second), (contact, cell.contacts_by_second)):
            axes.stairs(bins, label=cell.method, **look_of(cell.method).line)
    conflict.set(xlabel="release to conflict, s", ylabel=f"valid contacts ({phase})", ylim=(0, None))
    contact.set_xlabel("release to contact, s")
    conflict.margins(x=0)
    conflict.set_title(f"{family}: sum over {_seeds(counts)}", fontsize=9, loc="left")
    _legend(figure, conflict)
    return figure


def _canvas(size: tuple[float, float]) -> tuple[Figure, Axes]:
    figure = canvas(size)
    return figure, figure.add_subplot()


def _seeds(counts: Sequence[int]) -> str:
    most = max(counts, default=0)
    return ("" if len(set(counts)) < 2 else "up to ") + ("1 seed" if most == 1 else f"{most} seeds")


def _legend(figure: Figure, axes: Axes) -> None:
    """Beside the axes, where ten methods hide nothing."""
    handles: Sequence[object]
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=8, handlelength=2.4)
