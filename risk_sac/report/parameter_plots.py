"""Pictures over scenario parameters: an ego's boundary, and the standard's verdicts."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.failures.from_above import canvas, picture
from risk_sac.records import stored
from risk_sac.records.rates import BoundaryAxis, BoundaryMap, BoxShare, DriverMap
from risk_sac.report.drawing import STYLE
from risk_sac.report.grid import PlayedGrid, PlayedPoint, StandardVerdict
from risk_sac.run_folder.durable import replace_file
from risk_sac.run_folder.results import BOUNDARY, BOUNDARY_PICTURE
from risk_sac.world.types import Floats

MAP_PANEL_IN, MAP_DPI = (4.4, 3.9), 120
MOST_PANELS = 9  # slices of the third and fourth axis
# Driver → words, colour and dashes of its boundary; other egos take the rest in turn.
LINES = {"ego": ("the ego", "black", "-"), "r157": ("R157's driver", "#1f5fbf", "--"), "fsm": ("FSM", "#0a7d68", ":")}
OTHERS = (("#8e44ad", "-."), ("#8c510a", "--"), ("#555555", ":"), ("#c2185b", "-."))
FAILS, PASSES = "#c0392b", "#2471a3"


def write_boundary(folder: Path, found: BoundaryMap) -> None:
    """Writes the map as JSON and as a picture into a folder."""
    replace_file(folder / BOUNDARY, stored(found).encode())
    replace_file(folder / BOUNDARY_PICTURE, boundary_png(found))


def boundary_png(found: BoundaryMap) -> bytes:
    """Draws failing probability, points and boundaries; equal maps give equal bytes.

    Of three or four axes it draws a panel for each level of the third and fourth.
    """
    (content,) = picture(partial(_map_figure, found), ["png"], MAP_DPI, STYLE)
    return content


def in_words(share: BoxShare) -> str:
    """A share as "12 % (9 to 16 %)"."""
    return f"{100 * share.share:.0f} % ({100 * share.low:.0f} to {100 * share.high:.0f} %)"


def _map_figure(found: BoundaryMap) -> Figure:
    cuts = list(product(*(range(len(axis.levels)) for axis in found.axes[2:])))[:MOST_PANELS]
    columns = min(len(cuts), 3)
    rows = -(-len(cuts) // columns)
    figure = canvas((MAP_PANEL_IN[0] * columns + 2.2, MAP_PANEL_IN[1] * rows))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, cut in zip(panels, cuts, strict=False):
        _map_panel(axes, found, cut)
    handles = {
        label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(list(handles.values()), list(handles), loc="outside right upper", fontsize=7)
    figure.suptitle(f"{found.family}: {found.ego.name}", fontsize=9, x=0.01, ha="left")
    return figure


def _map_panel(axes: Axes, found: BoundaryMap, cut: tuple[int, ...]) -> None:
    x, y = (np.array(axis.levels) for axis in found.axes[:2])
    ego = next((driver for driver in found.maps if driver.name == "ego"), None)
    if ego is not None and ego.probability:
        axes.pcolormesh(
            x, y, _values(found, ego, cut).T, cmap="RdBu_r", vmin=0.0, vmax=1.0, shading="nearest", alpha=0.45
        )
    others = iter(OTHERS * len(found.maps))
    for driver in found.maps:
        words, colour, dashes = LINES.get(driver.name) or (driver.name, *next(others))
        if not driver.probability:
            axes.plot([], [], " ", label=f"{words}: {'fails' if driver.always else 'passes'} everywhere")
            continue
        axes.plot([], [], color=colour, linestyle=dashes, label=f"{words}: fails in {in_words(driver.fails)}")
        values = _values(found, driver, cut)
        if values.min() < 0.5 < values.max():
            width = 2.0 if driver.name == "ego" else 1.4
            axes.contour(x, y, values.T, levels=[0.5], colors=[colour], linestyles=[dashes], linewidths=width, zorder=4)
    _scatter(axes, found, cut)
    for set_label, axis in ((axes.set_xlabel, found.axes[0]), (axes.set_ylabel, found.axes[1])):
        set_label(axis.name if axis.unit in ("", "1") else f"{axis.name}, {axis.unit}", fontsize=8)
    axes.grid(visible=False)
    if cut:
        told_cut = zip(found.axes[2:], cut, strict=True)
        axes.set_title("\n".join(_slice_words(axis, i) for axis, i in told_cut), fontsize=8)


def _slice_words(axis: BoundaryAxis, level: int) -> str:
    """Formats a panel's level of an axis, and its points' range (`_nearest`)."""
    between = [(left + right) / 2 for left, right in pairwise(axis.levels)]
    low, high = (axis.low, *between)[level], (*between, axis.high)[level]
    return f"{axis.name} = {axis.levels[level]:.4g} (points: {low:.4g} to {high:.4g})"


def _values(found: BoundaryMap, driver: DriverMap, cut: tuple[int, ...]) -> Floats:
    values = np.array(driver.probability).reshape([len(axis.levels) for axis in found.axes])
    for level in reversed(cut):
        values = values[..., level]
    return np.asarray(values)


def _scatter(axes: Axes, found: BoundaryMap, cut: tuple[int, ...]) -> None:
    """Draws a panel's points: those nearest to its levels."""
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
    axis_values = zip(found.axes[2:], values, strict=True)
    return tuple(int(np.abs(np.array(axis.levels) - value).argmin()) for axis, value in axis_values)


PANEL_IN, DPI = (4.0, 3.6), 130
LOOKS: Mapping[StandardVerdict, tuple[str, str, float]] = {  # colour, marker, size; the worst first
    StandardVerdict.FAIL: ("#c0392b", "s", 26.0),
    StandardVerdict.UNJUDGED: ("#8e44ad", "x", 18.0),
    StandardVerdict.OUT_OF_SCOPE: ("#7f8c8d", "^", 20.0),
    StandardVerdict.PASS: ("#27ae60", "o", 10.0),
    StandardVerdict.REFUSED: ("#d5d8dc", ".", 6.0),
}
DRIVERS: Mapping[str, tuple[str, str, str]] = {  # words, colour, dashes
    "r157": ("R157's driver", "black", "-"),
    "fsm": ("FSM", "tab:blue", "--"),
}


def grid_png(grids: Sequence[PlayedGrid], over: tuple[str, str], at: Mapping[str, str]) -> bytes:
    """Draws the runs' scenes over two parameters; equal runs give equal bytes.

    A place has the worst verdict of its scenes. The lines are where a driver avoids half of them. `at` has values of
    other parameters, as text; scenes with other values are left out.

    Raises:
      ConfigError: a parameter is not there, or no scene has these values.
    """
    chosen = {id(grid): _at(grid, over, at) for grid in grids}
    (content,) = picture(partial(_figure, grids, chosen, over, at), ["png"], DPI, STYLE)
    return content


def _at(grid: PlayedGrid, over: tuple[str, str], at: Mapping[str, str]) -> list[PlayedPoint]:
    names = list(grid.points[0].values) if grid.points else []
    for field, name in (*(("over", name) for name in over), *(("at", name) for name in at)):
        if name not in names:
            raise ConfigError(field, repr(name), f"one of {', '.join(names)}", did_you_mean(name, names))
    points = [point for point in grid.points if all(_is(point.values[name], text) for name, text in at.items())]
    if not points:
        name, text = next(iter(at.items()))
        known = dict.fromkeys(_text(point.values[name]) for point in grid.points)
        raise ConfigError("at", f"{name}={text}, which no scene has", f"one of {', '.join(list(known)[:20])}")
    return points


def _is(value: float | str, text: str) -> bool:
    if isinstance(value, str):
        return value == text
    try:
        return bool(np.isclose(value, float(text), rtol=1e-6, atol=1e-9))
    except ValueError:
        return False


def _text(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _figure(
    grids: Sequence[PlayedGrid],
    chosen: Mapping[int, Sequence[PlayedPoint]],
    over: tuple[str, str],
    at: Mapping[str, str],
) -> Figure:
    figure = canvas((PANEL_IN[0] * len(grids) + 1.4, PANEL_IN[1]))
    panels = figure.subplots(1, len(grids), sharex=True, sharey=True, squeeze=False)[0]
    words = [_words(chosen.values(), name) for name in over]
    for axes, grid in zip(panels, grids, strict=True):
        points = chosen[id(grid)]
        _panel(axes, points, over, words)
        where = ", ".join([f"{name} = {text}" for name, text in at.items()])
        axes.set_title(f"{grid.spec.family}: {grid.ego}" + (f"\n{where}" if where else ""), fontsize=8, loc="left")
        axes.set_xlabel(over[0])
    panels[0].set_ylabel(over[1])
    handles: dict[str, Artist] = {}
    for axes in panels:
        handles |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(list(handles.values()), list(handles), loc="outside right upper", fontsize=7)
    return figure


def _words(chosen: Iterable[Sequence[PlayedPoint]], name: str) -> list[str]:
    values = (point.values[name] for points in chosen for point in points)
    return sorted({value for value in values if isinstance(value, str)})


def _panel(axes: Axes, points: Sequence[PlayedPoint], over: tuple[str, str], words: Sequence[Sequence[str]]) -> None:
    places: dict[tuple[float, float], list[PlayedPoint]] = defaultdict(list)
    for point in points:
        x, y = (_coordinate(point.values[name], known) for name, known in zip(over, words, strict=True))
        places[x, y].append(point)
    order = list(LOOKS)
    worst = {place: min((point.verdict for point in here), key=order.index) for place, here in places.items()}
    for verdict in reversed(order):
        colour, marker, size = LOOKS[verdict]
        at = np.array([place for place, found in worst.items() if found is verdict]).reshape(-1, 2)
        if len(at):
            label = verdict.value.replace("_", " ")
            axes.scatter(at[:, 0], at[:, 1], s=size, c=colour, marker=marker, label=label, linewidths=0.8, zorder=3)
    for driver, (name, colour, dashes) in DRIVERS.items():
        _bound(axes, _shares(places, driver), f"bound of {name}", colour, dashes)
    for axis, known in ((axes.xaxis, words[0]), (axes.yaxis, words[1])):
        if known:
            axis.set_ticks(range(len(known)), known)
    x, y = np.array(list(places)).T
    for limit, values in ((axes.set_xlim, x), (axes.set_ylim, y)):
        room = 0.06 * float(np.ptp(values)) or 0.5
        limit(float(values.min()) - room, float(values.max()) + room)


def _coordinate(value: float | str, words: Sequence[str]) -> float:
    return float(words.index(value)) if isinstance(value, str) else value


def _shares(places: Mapping[tuple[float, float], Sequence[PlayedPoint]], driver: str) -> Floats:
    """Returns places and shares of scenes a driver avoids, `n x 3`."""
    rows = []
    for (x, y), here in places.items():
        avoided = [outcome for point in here if (outcome := getattr(point, driver)) is not None]
        if avoided:
            rows.append((x, y, sum(avoided) / len(avoided)))
    return np.array(rows).reshape(-1, 3)


def _bound(axes: Axes, shares: Floats, label: str, colour: str, dashes: str) -> None:
    """Draws where a driver avoids half of the scenes, if any."""
    if len(shares) < 4 or np.ptp(shares[:, 2]) == 0.0 or min(len(set(shares[:, i])) for i in (0, 1)) < 2:
        return
    low, width = shares[:, :2].min(axis=0), np.ptp(shares[:, :2], axis=0)
    x, y = ((shares[:, :2] - low) / width).T  # one scale for both axes, or the triangles are slivers
    triangles = Triangulation(x, y).triangles
    drawn = Triangulation(shares[:, 0], shares[:, 1], triangles)
    axes.tricontour(drawn, shares[:, 2], levels=[0.5], colors=[colour], linestyles=[dashes], linewidths=1.4, zorder=4)
    axes.plot([], [], color=colour, linestyle=dashes, linewidth=1.4, label=label)
