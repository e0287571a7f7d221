"""Draws one contact as the paper's Fig. 2 does: both paths from above, and what was measured along the way.

Where the contact was judged, the moment at which the conflict began is marked as well.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.errors import ConfigError
from risk_sac.failures.roads import read_surfaces
from risk_sac.risk.ttc import TTC_CAP_S
from risk_sac.run_folder.results import Contact
from risk_sac.run_folder.series import read_series
from risk_sac.scenario.families import FAMILIES
from risk_sac.types import Collision, Floats, Kind, Role

EGO_COLOUR, OTHER_COLOUR, BYSTANDER_COLOUR = "tab:blue", "tab:red", "tab:gray"
SEEN_COLOUR, CONFLICT_COLOUR, RELEASE_COLOUR = "tab:green", "tab:orange", "tab:purple"  # of instants
SURFACE_COLOURS = {"junction": "0.95", "lane": "0.95", "sidewalk": "0.98", "crossing": "0.87"}
GHOSTS_S = (0.5, 1.0, 2.0, 3.0)  # before the contact, where the two bodies are drawn as well
VIEW_S, PANELS_S = 3.0, 8.0  # before the contact: what the view from above holds, and the panels
MARGIN_M = 5.0
WIDTH_IN, PANEL_IN, DPI = 11.0, 1.5, 110
PANEL_WIDTH_IN = 8.7  # what legends and labels leave of the width
VIEW_IN = (2.2, 6.0)  # least and greatest height of the view from above


@dataclass(frozen=True)
class Recording:
    """A contact's time series with time counted from the contact."""

    contact: Contact
    series: dict[str, NDArray[np.generic]]

    @property
    def collision(self) -> Collision:
        """What was recorded at the contact."""
        assert self.contact.episode.collision is not None  # that is what makes an episode a contact
        return self.contact.episode.collision

    @cached_property
    def time_s(self) -> Floats:
        """`T`, negative before the contact."""
        time: Floats = self["time_s"] - self._simulator_release_s - self.collision.time_s
        return time

    @property
    def _simulator_release_s(self) -> float:
        """The release by the simulator's clock; the first frame, in what was recorded before there was a release."""
        return float(self["released_s"] if "released_s" in self.series else self["time_s"][0])

    @property
    def released_s(self) -> float:
        """When the adversaries were released."""
        return -self.collision.time_s

    @property
    def conflict_s(self) -> float | None:
        """When the conflict began; None if nobody judged the contact, or if it was before the recording."""
        if self.collision.judgement is None:
            return None
        began_s = self.collision.judgement.conflict_s - self.collision.time_s
        return began_s if began_s >= self.time_s[0] else None

    @cached_property
    def other(self) -> int:
        """Column of the actor that the ego touched; the ego's is 0."""
        return [str(id_) for id_ in self.series["ids"]].index(self.collision.other_id)

    def __getitem__(self, name: str) -> Floats:
        return np.asarray(self.series[name], dtype=np.float64)

    def pose(self, actor: int, time_s: float) -> tuple[float, float, float]:
        """Centre and heading at any time within the recording, between two frames as the contact's search does."""
        x, y, heading = (self[name][:, actor] for name in ("x_m", "y_m", "heading_rad"))
        at = (float(np.interp(time_s, self.time_s, values)) for values in (x, y, np.unwrap(heading)))
        return next(at), next(at), next(at)

    def hidden(self) -> Iterator[tuple[float, float]]:
        """The spans in which the ego could not see the other."""
        unseen = np.concatenate(([False], self["visible"][:, self.other] == 0, [False]))
        edges = np.flatnonzero(unseen[1:] != unseen[:-1])
        for start, end in edges.reshape(-1, 2):
            yield self.time_s[start], self.time_s[min(end, len(self.time_s) - 1)]


def draw(family: FamilyName, contact: Contact, folder: Path, picture: Path) -> None:
    """Draws a contact into a file.

    Args:
      family: of the run.
      contact: of the run's results.
      folder: where results.json lies.
      picture: its suffix names the format: png, pdf or svg.

    Raises:
      ConfigError: the format is none of these.
      OSError: the time series is gone or the picture cannot be written.
    """
    if picture.suffix not in (".png", ".pdf", ".svg"):
        raise ConfigError(f"got {str(picture)!r}; wanted a name that ends in .png, .pdf or .svg", field="out")
    recording = Recording(contact, read_series(folder / contact.series))
    picture.parent.mkdir(parents=True, exist_ok=True)
    draw_recording(family, recording).savefig(picture, dpi=DPI)


def draw_recording(family: FamilyName, recording: Recording) -> Figure:
    """The whole figure: the view from above, and one panel per kind of measurement over a common time axis."""
    panels: tuple[Callable[[Axes, Recording], None], ...] = (_speeds, _accelerations, _distance, _ttc, _robustness)
    low, high = _extent(recording)
    view_in = PANEL_WIDTH_IN * (high - low)[1] / (high - low)[0]
    heights = (view_in, *(PANEL_IN for _ in panels))
    figure = Figure(figsize=(WIDTH_IN, sum(heights) + 1.2), layout="constrained")
    FigureCanvasAgg(figure)
    view, *axes = figure.subplots(len(heights), 1, height_ratios=heights)
    figure.suptitle(_title(family, recording), fontsize=11)
    _from_above(view, family, recording)
    view.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    for axis, panel in zip(axes, panels, strict=True):
        panel(axis, recording)
        _mark_instants(axis, recording)
        axis.sharex(axes[0])
        axis.label_outer()
    axes[0].set_xlim(max(recording.time_s[0], -PANELS_S), 0.15)
    axes[-1].set_xlabel("time before the contact, s")
    return figure


def _title(family: FamilyName, recording: Recording) -> str:
    collision = recording.collision
    reason = f" ({recording.contact.episode.reason})" if recording.contact.episode.reason else ""
    return (
        f"{family} · episode {recording.contact.id} · {recording.contact.episode.outcome}{reason}\n"
        f"the ego's {collision.ego_zone} at {collision.ego_speed_mps:.1f} m/s, the {collision.other_zone} of "
        f"{collision.other_role} {collision.other_id!r} at {collision.other_speed_mps:.1f} m/s; "
        f"visible for {collision.visible_for_s:.1f} s" + _judged(collision)
    )


def _judged(collision: Collision) -> str:
    """Lines with who would have prevented it, how and where it began, and whether the striker was in the wrong."""
    judgement = collision.judgement
    if judgement is None:
        return ""
    grade = f"grade {judgement.grade}" if judgement.grade else "no grade"
    broke = ", ".join(judgement.broke) or "nothing"
    before_s = collision.time_s - judgement.conflict_s
    return (
        f"\n{grade} · {judgement.conflict_type} from {before_s:.1f} s before the contact, {judgement.conflict_s:.1f} s "
        f"after the release, at ({judgement.conflict_x_m:.1f}, {judgement.conflict_y_m:.1f}) m\n"
        f"the striker broke {broke}".replace("_", " ")
    )


def _extent(recording: Recording) -> tuple[Floats, Floats]:
    """Corners of the ground that both took in the last seconds, grown to a shape that fits the page."""
    begin_s = recording.conflict_s
    shown = recording.time_s >= min(-VIEW_S, max(begin_s, -PANELS_S) if begin_s is not None else 0.0)
    pair = [0, recording.other]
    points = np.concatenate([recording[name][shown][:, pair].reshape(1, -1) for name in ("x_m", "y_m")])
    low, high = points.min(axis=1) - MARGIN_M, points.max(axis=1) + MARGIN_M
    width, height = high - low
    height = max(height, width * VIEW_IN[0] / PANEL_WIDTH_IN)
    width = max(width, height * PANEL_WIDTH_IN / VIEW_IN[1])
    middle, half = (low + high) / 2, np.array((width, height)) / 2
    return middle - half, middle + half


def _from_above(axis: Axes, family: FamilyName, recording: Recording) -> None:
    layout = FAMILIES[family].layout(recording.contact.episode.scene)
    for surface in read_surfaces(Path(sumo_nets.__path__[0]) / layout.net):
        colour = SURFACE_COLOURS[surface.use]
        axis.add_patch(Polygon(surface.outline, facecolor=colour, edgecolor="0.7", linewidth=0.5))
    for actor in range(1, len(recording.series["ids"])):
        if actor != recording.other:
            _draw_actor(axis, recording, actor, BYSTANDER_COLOUR, ghosts=())
    _draw_actor(axis, recording, recording.other, OTHER_COLOUR, GHOSTS_S)
    _draw_actor(axis, recording, 0, EGO_COLOUR, GHOSTS_S)
    _draw_contact_point(axis, recording)
    _draw_conflict(axis, recording)
    axis.set(xlabel="x, m", ylabel="y, m")
    _legend(axis)


def _draw_actor(axis: Axes, recording: Recording, actor: int, colour: str, ghosts: tuple[float, ...]) -> None:
    """Path, body at the contact, and bodies at the earlier times with their labels."""
    involved = bool(ghosts)
    name = str(recording.series["ids"][actor])
    driver = Role(int(recording.series["role"][actor])).name.lower()
    x, y = recording["x_m"][:, actor], recording["y_m"][:, actor]
    axis.plot(x, y, color=colour, linewidth=1.2 if involved else 0.6, alpha=1.0 if involved else 0.5)
    label = "ego" if actor == 0 else f"{name} ({driver})"
    for before_s in ghosts:
        if -before_s >= recording.time_s[0]:
            _draw_body(axis, recording, actor, -before_s, facecolor="none", edgecolor=colour, linewidth=0.8)
            _label_body(axis, recording, actor, -before_s, colour)
    if np.isfinite(x[-1]):
        _draw_body(
            axis,
            recording,
            actor,
            0.0,
            facecolor=colour,
            edgecolor=colour,
            alpha=0.6 if involved else 0.2,
            label=label if involved else None,
        )
        if not involved:
            axis.annotate(name, (x[-1], y[-1]), fontsize=6, color=colour, ha="center", va="center", clip_on=True)


def _draw_body(axis: Axes, recording: Recording, actor: int, time_s: float, **style: object) -> None:
    x, y, heading = recording.pose(actor, time_s)
    half_length, half_width = recording["length_m"][actor] / 2, recording["width_m"][actor] / 2
    cos, sin = np.cos(heading), np.sin(heading)
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (half_length, half_width)
    outline = corners @ np.array([(cos, sin), (-sin, cos)]) + (x, y)
    axis.add_patch(Polygon(outline, **style))  # type: ignore[arg-type]
    front = np.array([(0.45, 1), (1, 0), (0.45, -1)]) * (half_length, half_width)  # an arrow head tells where it heads
    if recording.series["kind"][actor] == Kind.VEHICLE:
        arrow = front @ np.array([(cos, sin), (-sin, cos)]) + (x, y)
        axis.plot(arrow[:, 0], arrow[:, 1], color=str(style["edgecolor"]), linewidth=0.6)


def _label_body(axis: Axes, recording: Recording, actor: int, time_s: float, colour: str) -> None:
    """The time beside a body, on the side that faces away from the other one."""
    x, y, heading = recording.pose(actor, time_s)
    partner_x, partner_y, _ = recording.pose(recording.other if actor == 0 else 0, time_s)
    left = np.array((-np.sin(heading), np.cos(heading)))
    away = -left if left @ (partner_x - x, partner_y - y) > 0 else left
    axis.annotate(
        f"−{-time_s:g} s",
        tuple(np.array((x, y)) + away * recording["width_m"][actor] / 2),
        tuple(away * (16, 8)),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=7,
        color=colour,
        annotation_clip=True,
    )


def _draw_contact_point(axis: Axes, recording: Recording) -> None:
    x, y, heading = recording.pose(0, 0.0)
    along, across = recording.collision.contact_x_m, recording.collision.contact_y_m
    cos, sin = np.cos(heading), np.sin(heading)
    place = x + along * cos - across * sin, y + along * sin + across * cos
    axis.plot(*place, marker="x", color="black", markersize=7, linestyle="none", zorder=5, label="contact")


def _draw_conflict(axis: Axes, recording: Recording) -> None:
    """Where the striker was when the conflict began, and both bodies at that moment."""
    judgement, begin_s = recording.collision.judgement, recording.conflict_s
    if judgement is None or begin_s is None:
        return
    for actor in (0, recording.other):
        if np.isfinite(recording.pose(actor, begin_s)).all():
            style = {"facecolor": "none", "edgecolor": CONFLICT_COLOUR, "linewidth": 1.4, "linestyle": "--"}
            _draw_body(axis, recording, actor, begin_s, **style)
    place = judgement.conflict_x_m, judgement.conflict_y_m
    axis.plot(*place, marker="D", color=CONFLICT_COLOUR, markersize=5, linestyle="none", zorder=5, label="conflict")


def _speeds(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "speed_mps")
    axis.set_ylabel("speed\nm/s")
    _legend(axis)


def _accelerations(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "accel_mps2")
    axis.set_ylabel("acceleration\nm/s²")


def _both(axis: Axes, recording: Recording, name: str) -> None:
    for actor, colour in ((0, EGO_COLOUR), (recording.other, OTHER_COLOUR)):
        label = str(recording.series["ids"][actor])
        axis.plot(recording.time_s, recording[name][:, actor], color=colour, linewidth=1.2, label=label)


def _distance(axis: Axes, recording: Recording) -> None:
    axis.plot(recording.time_s, recording["distance_m"][:, recording.other], color="black", linewidth=1.2)
    axis.set_ylabel("distance\nm")
    axis.set_ylim(bottom=0)


def _ttc(axis: Axes, recording: Recording) -> None:
    axis.plot(recording.time_s, recording["ttc_s"][:, recording.other], color="black", linewidth=1.2)
    axis.set(ylabel="TTC\ns", ylim=(0, TTC_CAP_S * 1.05))


def _robustness(axis: Axes, recording: Recording) -> None:
    for name, values in zip(recording.series["requirements"], recording["robustness"].T, strict=True):
        axis.plot(recording.time_s, values, linewidth=0.9, label=str(name))
    axis.plot(
        recording.time_s, recording["soft_min"], color="black", linestyle="--", linewidth=1.4, label="soft minimum"
    )
    axis.axhline(0, color="0.6", linewidth=0.6)
    axis.set_ylabel("robustness\nscaled")
    _legend(axis)


def _legend(axis: Axes) -> None:
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)


def _mark_instants(axis: Axes, recording: Recording) -> None:
    """The contact, since when the other was in view, where it was hidden before, release and begin of the conflict."""
    axis.axvline(0, color="black", linewidth=0.8, linestyle="--")
    axis.grid(visible=True, linewidth=0.3)
    for start, end in recording.hidden():
        axis.axvspan(start, end, color="0.9", zorder=0)
    first_visible = recording.time_s[-1] - recording.collision.visible_for_s
    _mark(axis, first_visible, "in view", SEEN_COLOUR, row=0)
    _mark(axis, recording.released_s, "release", RELEASE_COLOUR, row=1)
    if recording.conflict_s is not None:
        _mark(axis, recording.conflict_s, "conflict", CONFLICT_COLOUR, row=2)


def _mark(axis: Axes, time_s: float, name: str, colour: str, row: int) -> None:
    """An instant with its name at the top, in a row of its own so that names do not cover each other."""
    axis.axvline(time_s, color=colour, linewidth=1.0, linestyle=":")
    axis.annotate(
        name,
        (time_s, 1),
        (2, -2 - 9 * row),
        xycoords=axis.get_xaxis_transform(),
        textcoords="offset points",
        va="top",
        fontsize=7,
        color=colour,
        annotation_clip=True,
    )
