"""Picture and files of an ego's boundary; the map comes from `risk_sac.search.boundary_map`."""

from collections.abc import Sequence
from functools import partial
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from risk_sac.failures.from_above import canvas, picture
from risk_sac.records import stored
from risk_sac.records.rates import BoundaryAxis, BoundaryMap, BoxShare, DriverMap
from risk_sac.report.drawing import STYLE
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import BOUNDARY, BOUNDARY_PICTURE
from risk_sac.world.types import Floats

PANEL_IN, DPI = (4.4, 3.9), 120
MOST_PANELS = 9  # slices of the third and fourth axis
# Driver → words, colour and dashes of its boundary; other egos take the rest in turn.
LINES = {
    "ego": ("the ego", "black", "-"),
    "r157": ("R157's driver", "#1f5fbf", "--"),
    "fsm": ("FSM", "#0a7d68", ":"),
}
OTHERS = (("#8e44ad", "-."), ("#8c510a", "--"), ("#555555", ":"), ("#c2185b", "-."))
FAILS, PASSES = "#c0392b", "#2471a3"


def write_boundary(folder: Path, found: BoundaryMap) -> None:
    """Writes the map as JSON and as a picture into a folder."""
    replace_file(folder / BOUNDARY, stored(found).encode())
    replace_file(folder / BOUNDARY_PICTURE, boundary_png(found))


def boundary_png(found: BoundaryMap) -> bytes:
    """Draws the ego's probability of failing, its points and all boundaries; equal maps give equal bytes.

    Of three or four axes it draws a panel for each level of the third and fourth.
    """
    (content,) = picture(partial(_figure, found), ["png"], DPI, STYLE)
    return content


def in_words(share: BoxShare) -> str:
    """A share as "12 % (9 to 16 %)"."""
    return f"{100 * share.share:.0f} % ({100 * share.low:.0f} to {100 * share.high:.0f} %)"


def _figure(found: BoundaryMap) -> Figure:
    cuts = list(product(*(range(len(axis.levels)) for axis in found.axes[2:])))[:MOST_PANELS]
    columns = min(len(cuts), 3)
    rows = -(-len(cuts) // columns)
    figure = canvas((PANEL_IN[0] * columns + 2.2, PANEL_IN[1] * rows))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, cut in zip(panels, cuts, strict=False):
        _panel(axes, found, cut)
    handles = {
        label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(handles.values()), list(handles), loc="outside right upper", fontsize=7)
    figure.suptitle(f"{found.family}: {found.ego.name}", fontsize=9, x=0.01, ha="left")
    return figure


def _panel(axes: Axes, found: BoundaryMap, cut: tuple[int, ...]) -> None:
    x, y = (np.array(axis.levels) for axis in found.axes[:2])
    ego = next((told for told in found.maps if told.name == "ego"), None)
    if ego is not None and ego.probability:
        axes.pcolormesh(
            x, y, _values(found, ego, cut).T, cmap="RdBu_r", vmin=0.0, vmax=1.0, shading="nearest", alpha=0.45
        )
    others = iter(OTHERS * len(found.maps))
    for told in found.maps:
        words, colour, dashes = LINES.get(told.name) or (told.name, *next(others))
        if not told.probability:
            axes.plot([], [], " ", label=f"{words}: {'fails' if told.always else 'passes'} everywhere")
            continue
        axes.plot([], [], color=colour, linestyle=dashes, label=f"{words}: fails in {in_words(told.fails)}")
        values = _values(found, told, cut)
        if values.min() < 0.5 < values.max():
            width = 2.0 if told.name == "ego" else 1.4
            axes.contour(x, y, values.T, levels=[0.5], colors=[colour], linestyles=[dashes], linewidths=width, zorder=4)
    _scatter(axes, found, cut)
    for set_label, axis in ((axes.set_xlabel, found.axes[0]), (axes.set_ylabel, found.axes[1])):
        set_label(axis.name if axis.unit in ("", "1") else f"{axis.name}, {axis.unit}", fontsize=8)
    axes.grid(visible=False)
    if cut:
        told_cut = zip(found.axes[2:], cut, strict=True)
        axes.set_title("\n".join(_slice_words(axis, i) for axis, i in told_cut), fontsize=8)


def _slice_words(axis: BoundaryAxis, level: int) -> str:
    """A panel's level of an axis, and the range of the points in it, as `_nearest` sorts them."""
    between = [(left + right) / 2 for left, right in pairwise(axis.levels)]
    low, high = (axis.low, *between)[level], (*between, axis.high)[level]
    return f"{axis.name} = {axis.levels[level]:.4g} (points: {low:.4g} to {high:.4g})"


def _values(found: BoundaryMap, told: DriverMap, cut: tuple[int, ...]) -> Floats:
    """The probabilities of a driver over the first two axes."""
    values = np.array(told.probability).reshape([len(axis.levels) for axis in found.axes])
    for level in reversed(cut):
        values = values[..., level]
    return np.asarray(values)


def _scatter(axes: Axes, found: BoundaryMap, cut: tuple[int, ...]) -> None:
    """Draws the points that belong to a panel: those nearest to its levels."""
    points = [point for point in found.points if _nearest(found, point.values[2:]) == cut]
    looks: Sequence[tuple[bool | None, str, str, str]] = (
        (True, FAILS, "s", "ego fails"),
        (False, PASSES, "o", "ego passes"),
        (None, "0.5", "x", "could not be played"),
    )
    for outcome, colour, marker, label in looks:
        at = np.array([point.values[:2] for point in points if point.fails is outcome]).reshape(-1, 2)
        if len(at):
            axes.scatter(at[:, 0], at[:, 1], s=12, c=colour, marker=marker, label=label, linewidths=0.7, zorder=5)


def _nearest(found: BoundaryMap, values: tuple[float, ...]) -> tuple[int, ...]:
    told = zip(found.axes[2:], values, strict=True)
    return tuple(int(np.abs(np.array(axis.levels) - value).argmin()) for axis, value in told)
