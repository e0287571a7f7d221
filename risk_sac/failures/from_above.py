"""Draws failures and maps from above, with matplotlib and without a window."""

import io
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke

from risk_sac.config import FamilyName
from risk_sac.failures.net import LAMPS, Surface, SurfaceUse, roads_of, signal_heads, surfaces
from risk_sac.failures.recording import BOX, Recording, on_body
from risk_sac.maps.found import TITLES, Survey
from risk_sac.records import Collision
from risk_sac.scenario.bodies import body_of
from risk_sac.world.net import Net
from risk_sac.world.types import Floats, Role

_UNDATED: dict[str, dict[str, Any]] = {
    "svg": {"Date": None},
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Producer": None},
}
_DRAWING = threading.Lock()  # matplotlib's style is one per process


def canvas(size_in: tuple[float, float]) -> Figure:
    """An empty figure, width x height in inches."""
    figure = Figure(figsize=size_in, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def picture(draw: Callable[[], Figure], formats: Sequence[str], dpi: float, style: dict[Any, Any]) -> list[bytes]:
    """Returns a figure's file in each format; equal figures give equal bytes.

    Args:
      draw: makes the figure; in the style, and while nothing else is drawn.
      formats: png | svg | pdf.
      dpi: dots per inch.
      style: matplotlib's settings that differ from its defaults.
    """
    files = []
    with _DRAWING, mpl.rc_context():
        mpl.rcdefaults()  # neither the user's own style nor one that an ego has set
        mpl.rcParams.update(style | {"svg.hashsalt": "risk-sac"})
        figure = draw()
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # it is laid out now; each file would do it again, a little differently
        for format_ in formats:
            file = io.BytesIO()
            figure.savefig(file, format=format_, dpi=dpi, metadata=_UNDATED[format_])
            files.append(file.getvalue())
    return files


ASIDE: Floats = np.array([(0, 1), (0, -1), (1, 0), (-1, 0)], dtype=np.float64)  # above, below, right, left
GAPS_PT = (3.0, 12.0, 24.0)
CHARACTER = (0.65, 1.3)  # width and height of a character, in font sizes
HALO = [withStroke(linewidth=2, foreground="white")]


@dataclass
class Labels:
    """Labels of one view; a box is two opposite corners, m."""

    axis: Axes
    low: Floats  # corners of the view, m
    high: Floats
    m_per_pt: float
    _taken: list[tuple[Floats, Floats]] = field(default_factory=list)

    def reserve(self, corners: Floats) -> None:
        """Keeps labels off a body, given its corners, `k x 2`, m."""
        self._taken.append((corners.min(axis=0), corners.max(axis=0)))

    def write(self, text: str, body: Floats, ways: Iterable[Floats], size_pt: float, colour: str) -> None:
        """Writes beside a visible body, on the first side with room.

        Args:
          text: one line.
          body: its corners, `k x 2`, m.
          ways: directions from its middle, best first.
          size_pt: of the font.
          colour: of the text.
        """
        half = np.array((len(text), 1.0)) * CHARACTER * size_pt * self.m_per_pt / 2
        middle, reach = (body.min(axis=0) + body.max(axis=0)) / 2, np.ptp(body, axis=0) / 2
        if (middle < self.low).any() or (middle > self.high).any():
            return
        for gap_pt in GAPS_PT:
            for way in ways:
                centre = middle + way * (reach + half + gap_pt * self.m_per_pt)
                box = centre - half, centre + half
                inside = (box[0] > self.low).all() and (box[1] < self.high).all()
                if inside and not any(_overlap(box, other) for other in self._taken):
                    self._taken.append(box)
                    x, y = centre.tolist()
                    style: dict[str, Any] = {
                        "fontsize": size_pt,
                        "color": colour,
                        "ha": "center",
                        "va": "center",
                        "clip_on": True,
                    }
                    self.axis.text(x, y, text, path_effects=HALO, zorder=6, **style)
                    return


def _overlap(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> bool:
    return bool((one[0] < other[1]).all() and (other[0] < one[1]).all())


EGO_COLOUR, OTHER_COLOUR, BYSTANDER_COLOUR = "tab:blue", "tab:red", "tab:gray"
CONFLICT_COLOUR = "tab:orange"


def legend(axis: Axes, title: str | None = None) -> None:
    """Draws the legend beside the axes, so that it covers nothing."""
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False, title=title, title_fontsize=7)


SURFACE_COLOURS: Mapping[SurfaceUse, str] = {"junction": "0.95", "lane": "0.95", "sidewalk": "0.98", "crossing": "0.87"}
APART_IN = 0.25  # earlier places of a body that are nearer on the page are drawn as one
GHOSTS_S = (0.5, 1.0, 2.0, 3.0)  # times before the violation at which the two bodies are drawn as well
OUTLINE: dict[str, Any] = {"facecolor": "none", "edgecolor": "0.3", "linewidth": 0.8}
CONFLICT: dict[str, Any] = {"facecolor": "none", "edgecolor": CONFLICT_COLOUR, "linewidth": 1.4, "linestyle": "--"}


def draw_from_above(
    axis: Axes, family: FamilyName, recording: Recording, view: tuple[Floats, Floats], m_per_in: float
) -> None:
    """Draws everything on the ground.

    `view` has the corners of the ground that the axes show, m; `m_per_in` is what an inch of the page shows.
    """
    labels = Labels(axis, *view, 1.3 * m_per_in / 72)  # the layout shrinks the axes by up to a third
    for surface in roads_of(family, recording.failure.episode.scene):
        colour = SURFACE_COLOURS[surface.use]
        axis.add_patch(Polygon(surface.outline, facecolor=colour, edgecolor="0.7", linewidth=0.5))
    _draw_signals(axis, family, recording)
    bystanders = [actor for actor in range(len(recording.series["ids"])) if actor not in recording.involved]
    for actor in bystanders:
        _draw_actor(axis, recording, actor, BYSTANDER_COLOUR)
    for actor in range(len(recording.series["ids"])):
        if np.isfinite(recording.pose(actor, 0.0)).all():
            labels.reserve(_body(recording, actor, 0.0))
    for actor, colour in [*zip(recording.involved, (EGO_COLOUR, OTHER_COLOUR), strict=False)][::-1]:
        _draw_actor(axis, recording, actor, colour, involved=True)
        for times_s in _ghosts(recording, actor, APART_IN * m_per_in):
            _draw_body(axis, recording, actor, -times_s[0], **OUTLINE | {"edgecolor": colour})
            _label_body(labels, recording, actor, times_s, colour)
    for actor in bystanders:
        if np.isfinite(recording.pose(actor, 0.0)).all():
            name = str(recording.series["ids"][actor])
            labels.write(name, _body(recording, actor, 0.0), ASIDE, 6, "0.4")
    if recording.collision is not None and not recording.twin:
        _draw_contact_point(axis, recording, recording.collision)
    _draw_conflict(axis, recording)
    axis.set(xlabel="x, m", ylabel="y, m")
    axis.add_patch(Polygon(np.empty((0, 2)), label="earlier", **OUTLINE))  # for the legend alone
    if bystanders:
        grey: dict[str, Any] = {"facecolor": BYSTANDER_COLOUR, "edgecolor": BYSTANDER_COLOUR, "alpha": 0.3}
        axis.add_patch(Polygon(np.empty((0, 2)), label="others", **grey))
    axis.plot([], [], color="0.3", linewidth=1.2, label="paths")
    when = "contact" if recording.collision else "violation"
    legend(axis, title=f"filled: at the {when}{' in the failure' if recording.twin else ''}")


def _ghosts(recording: Recording, actor: int, apart_m: float) -> list[list[float]]:
    """Groups times of `GHOSTS_S` at which the body is almost unmoved."""
    groups: list[list[float]] = []
    for before_s in GHOSTS_S:
        if -before_s < recording.time_s[0]:
            continue
        there = recording.pose(actor, -before_s)[:2]
        if groups and np.hypot(*np.subtract(there, recording.pose(actor, -groups[-1][0])[:2])) < apart_m:
            groups[-1].append(before_s)
        else:
            groups.append([before_s])
    return groups


def _draw_actor(axis: Axes, recording: Recording, actor: int, colour: str, *, involved: bool = False) -> None:
    name = str(recording.series["ids"][actor])
    driver = Role(int(recording.series["role"][actor])).name.lower()
    x, y = recording["x_m"][:, actor], recording["y_m"][:, actor]
    axis.plot(x, y, color=colour, linewidth=1.2 if involved else 0.6, alpha=1.0 if involved else 0.5)
    here = recording.pose(actor, 0.0)[:2]
    if not np.isfinite(here).all():
        return
    label = ("ego" if actor == 0 else f"{name} ({driver})") if involved else None
    alpha = 0.6 if involved else 0.3
    _draw_body(axis, recording, actor, 0.0, facecolor=colour, edgecolor=colour, alpha=alpha, label=label)


def _draw_body(axis: Axes, recording: Recording, actor: int, time_s: float, **style: object) -> None:
    pose, size = recording.pose(actor, time_s), (recording["length_m"][actor], recording["width_m"][actor])
    axis.add_patch(Polygon(_body(recording, actor, time_s), **style))  # type: ignore[arg-type]
    if body_of(int(recording.series["body"][actor])).shape in ("vehicle", "two_wheels"):
        arrow = on_body(pose, size, [(0.45, 1), (1, 0), (0.45, -1)])
        axis.plot(arrow[:, 0], arrow[:, 1], color=str(style["edgecolor"]), linewidth=0.6)


def _body(recording: Recording, actor: int, time_s: float) -> Floats:
    size = recording["length_m"][actor], recording["width_m"][actor]
    return on_body(recording.pose(actor, time_s), size, BOX)


def _draw_signals(axis: Axes, family: FamilyName, recording: Recording) -> None:
    """Draws signals as bars across their lanes, as at the violation.

    A green one is open.
    """
    time_s = float(recording["released_s"]) + recording.violation.time_s
    for head in signal_heads(family, recording.failure.episode.scene):
        for mark in head.marks(time_s):
            axis.plot(*mark.T, color=LAMPS[head.colour(time_s)], linewidth=2.5, solid_capstyle="butt")
    if axis.lines:
        for name in ("green", "yellow", "red"):
            axis.plot([], [], color=LAMPS[name], linewidth=2.5, label=f"signal: {name}")


def _label_body(labels: Labels, recording: Recording, actor: int, times_s: list[float], colour: str) -> None:
    """Writes the times beside a body, first away from the other body."""
    x, y, heading = recording.pose(actor, -times_s[0])
    partner_x, partner_y, _ = recording.pose((recording.other or 0) if actor == 0 else 0, -times_s[0])
    left = np.array((-np.sin(heading), np.cos(heading)))
    away = -left if left @ (partner_x - x, partner_y - y) > 0 else left
    text = ", ".join(f"−{each:g}" for each in times_s) + " s"
    labels.write(text, _body(recording, actor, -times_s[0]), (away, -away), 7, colour)


def _draw_contact_point(axis: Axes, recording: Recording, collision: Collision) -> None:
    x, y, heading = recording.pose(0, 0.0)
    along, across = collision.contact_x_m, collision.contact_y_m
    cos, sin = np.cos(heading), np.sin(heading)
    place = x + along * cos - across * sin, y + along * sin + across * cos
    axis.plot(*place, marker="x", color="black", markersize=7, linestyle="none", zorder=5, label="touched here")


def _draw_conflict(axis: Axes, recording: Recording) -> None:
    """Draws both bodies and the striker's place as the conflict began."""
    begin_s = recording.conflict_s
    if recording.collision is None or begin_s is None:
        return
    for actor in recording.involved:
        if np.isfinite(recording.pose(actor, begin_s)).all():
            label = "as the conflict began" if actor == 0 else None
            _draw_body(axis, recording, actor, begin_s, label=label, **CONFLICT)
    judgement = recording.collision.judgement
    place = judgement.conflict_x_m, judgement.conflict_y_m
    style: dict[str, Any] = {"marker": "D", "color": CONFLICT_COLOUR, "markersize": 5, "linestyle": "none", "zorder": 5}
    axis.plot(*place, label="striker then", **style)


MARKS = dict(zip(TITLES, (("o", "tab:blue"), ("s", "tab:orange"), ("^", "tab:green")), strict=True))
WIDTH_IN, DPI = 9.0, 130
HEIGHT_IN = (4.5, 12.0)  # least and greatest height; in between it follows from the map's
NAMED = 60  # most places that are labelled with their names


def map_png(net: Net, survey: Survey) -> bytes:
    """The picture of a whole map."""
    (content,) = picture(partial(_figure, net, survey), ["png"], DPI, {})
    return content


def _figure(net: Net, survey: Survey) -> Figure:
    ground = surfaces(net)
    figure = canvas((WIDTH_IN, _height_in(ground)))
    axis = figure.subplots()
    for use, colour in SURFACE_COLOURS.items():
        outlines = [surface.outline for surface in ground if surface.use == use]
        axis.add_collection(PolyCollection(outlines, facecolors=colour, edgecolors="0.6", linewidths=0.2))
    x = [misfit.spot.x_m for misfit in survey.misfits]
    y = [misfit.spot.y_m for misfit in survey.misfits]
    axis.scatter(x, y, s=5, color="0.5", marker="x", linewidths=0.5, label=f"does not fit ({len(x)})")
    for pattern, (marker, colour) in MARKS.items():
        spots = [fit.spot for fit in survey.fits if fit.spot.pattern == pattern]
        x, y = [spot.x_m for spot in spots], [spot.y_m for spot in spots]
        label = f"{TITLES[pattern]} ({len(spots)})"
        axis.scatter(x, y, s=16, color=colour, marker=marker, alpha=0.8, label=label, zorder=3)
    if len(survey.fits) <= NAMED:
        for id_, spot in {fit.spot.id: fit.spot for fit in survey.fits}.items():  # once where several patterns fit
            if np.isfinite((spot.x_m, spot.y_m)).all():
                axis.annotate(id_, (spot.x_m, spot.y_m), (3, 3), textcoords="offset points", fontsize=5, zorder=4)
    axis.autoscale()
    axis.set_aspect("equal")
    axis.set(xlabel="x, m", ylabel="y, m")
    axis.legend(loc="upper right", fontsize=7)  # the best place takes minutes to find on a large map
    return figure


def _height_in(ground: Sequence[Surface]) -> float:
    points = np.concatenate([surface.outline for surface in ground])
    wide_m, high_m = np.maximum(np.ptp(points, axis=0), 1.0)
    return float(np.clip(WIDTH_IN * high_m / wide_m, *HEIGHT_IN))
