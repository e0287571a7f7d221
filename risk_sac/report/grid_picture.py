"""Picture of the standard's verdicts over two parameters, a panel for each run, with the competent drivers' bounds."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.failures.from_above import canvas, picture
from risk_sac.report.drawing import STYLE
from risk_sac.report.grid import PlayedGrid, PlayedPoint, StandardVerdict
from risk_sac.world.types import Floats

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
    """Draws the scenes of some runs over two parameters; equal runs give equal bytes.

    A place has the worst verdict of its scenes. The lines are where a driver avoids half of
    the scenes.

    Args:
      grids: of one scenario, such as with several egos.
      over: the parameters.
      at: parameter → number or word; of the others only scenes with these values are drawn.

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
    """The words that scenes have of a parameter; none of numbers."""
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
    """Places and the share of their scenes that a driver avoids, `n x 3`."""
    rows = []
    for (x, y), here in places.items():
        avoided = [told for point in here if (told := getattr(point, driver)) is not None]
        if avoided:
            rows.append((x, y, sum(avoided) / len(avoided)))
    return np.array(rows).reshape(-1, 3)


def _bound(axes: Axes, shares: Floats, label: str, colour: str, dashes: str) -> None:
    """Draws where a driver avoids half of the scenes, if it avoids some."""
    if len(shares) < 4 or np.ptp(shares[:, 2]) == 0.0 or min(len(set(shares[:, i])) for i in (0, 1)) < 2:
        return
    low, width = shares[:, :2].min(axis=0), np.ptp(shares[:, :2], axis=0)
    x, y = ((shares[:, :2] - low) / width).T  # one scale for both axes, or the triangles are slivers
    triangles = Triangulation(x, y).triangles
    drawn = Triangulation(shares[:, 0], shares[:, 1], triangles)
    axes.tricontour(drawn, shares[:, 2], levels=[0.5], colors=[colour], linestyles=[dashes], linewidths=1.4, zorder=4)
    axes.plot([], [], color=colour, linestyle=dashes, linewidth=1.4, label=label)
