"""Draws one contact as the paper's Fig. 2 does: both paths from above, and what was measured along the way."""

import textwrap
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from risk_sac.canvas import canvas, picture
from risk_sac.config import FamilyName
from risk_sac.errors import ConfigError
from risk_sac.failures.from_above import CONFLICT_COLOUR, EGO_COLOUR, OTHER_COLOUR, draw_from_above, legend
from risk_sac.failures.recording import Recording
from risk_sac.records import Grade
from risk_sac.risk.ttc import TTC_CAP_S
from risk_sac.types import Floats

CAPTION_WIDTH = 120  # characters
SEEN_COLOUR, RELEASE_COLOUR, HIDDEN_COLOUR = "tab:green", "tab:purple", "0.9"
VIEW_S, PANELS_S = 3.0, 8.0  # before the contact: what the view from above holds, and the panels
MARGIN_M = 5.0
WIDTH_IN, PANEL_IN, DPI = 11.0, 1.5, 110
PANEL_WIDTH_IN = 8.7  # what legends and labels leave of the width
LABEL_IN = 0.25  # what a label needs on the page
VIEW_IN = (2.2, 6.0)  # least and greatest height of the view from above
PREVENTED = {
    Grade.CAREFUL: "a careful driver would have prevented it",
    Grade.IDEAL: "only full braking at once would have prevented it",
    Grade.UNAVOIDABLE: "not even full braking at once would have prevented it",
}


def caption(family: FamilyName, recording: Recording) -> str:
    """Returns which contact it is, what touched what, and what its judgement says."""
    episode, collision, judgement = recording.contact.episode, recording.collision, recording.collision.judgement
    failed = f" · failed rules: {_words(episode.reason)}" if episode.reason else ""
    seen_s = collision.visible_for_s
    seen = f"which it had seen for {seen_s:.1f} s" if seen_s > 0 else "which it had not seen"
    lines = [
        f"{family} · episode {recording.contact.id} · {episode.outcome}{failed}",
        f"the ego's {collision.ego_zone}, at {collision.ego_speed_mps:.1f} m/s, touched the {collision.other_zone} of "
        f"{collision.other_role} {collision.other_id!r}, at {collision.other_speed_mps:.1f} m/s, {seen}",
    ]
    if judgement is not None:
        before_s = collision.time_s - judgement.conflict_s
        grade = "" if judgement.grade is None else f" · grade {judgement.grade}: {PREVENTED[judgement.grade]}"
        lines += [
            judgement.signature,
            f"the conflict began {before_s:.1f} s before the contact{grade}",
            f"broken by the other: {_words(', '.join(judgement.broke)) or 'nothing'}",
        ]
    return "\n".join(textwrap.fill(line, CAPTION_WIDTH) for line in lines)


def _words(names: str) -> str:
    return names.replace("_", " ")


def _speeds(axis: Axes, recording: Recording) -> None:
    _both(axis, recording, "speed_mps")
    axis.set_ylabel("speed\nm/s")
    if any(True for _ in recording.hidden()):
        axis.add_patch(Rectangle((0, 0), 0, 0, color=HIDDEN_COLOUR, label="hidden from the ego"))
    legend(axis)


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
    axis.set(ylabel=f"time to\ncollision, s\n({TTC_CAP_S:g}: none)", ylim=(0, TTC_CAP_S * 1.05))


def _robustness(axis: Axes, recording: Recording) -> None:
    for name, values in zip(recording.series["requirements"], recording["robustness"].T, strict=True):
        axis.plot(recording.time_s, values, linewidth=0.9, label=str(name))
    axis.plot(
        recording.time_s, recording["soft_min"], color="black", linestyle="--", linewidth=1.4, label="soft minimum"
    )
    axis.axhline(0, color="0.6", linewidth=0.6)
    axis.set_ylabel("requirements\nbroken below 0")
    legend(axis)


PANELS: tuple[Callable[[Axes, Recording], None], ...] = (_speeds, _accelerations, _distance, _ttc, _robustness)


def _mark_instants(axis: Axes, recording: Recording) -> None:
    """Draws upright lines at the instants, and grey ground where the ego did not see the other."""
    axis.grid(visible=True, linewidth=0.3)
    for start, end in recording.hidden():
        axis.axvspan(start, end, color=HIDDEN_COLOUR, zorder=0)
    for time_s, _, colour in _instants(recording):
        axis.axvline(time_s, color=colour, linewidth=1.0, linestyle="--" if time_s == 0 else ":")


def _name_instants(axis: Axes, recording: Recording) -> None:
    """Writes names above the first panel, each in a row of its own so that they do not overlap."""
    for row, (time_s, name, colour) in enumerate(_instants(recording)):
        axis.annotate(
            name,
            (time_s, 1),
            (0, 3 + 9 * row),
            xycoords=axis.get_xaxis_transform(),
            textcoords="offset points",
            va="bottom",
            ha="right" if time_s == 0 else "left",
            fontsize=7,
            color=colour,
            annotation_clip=True,
        )


def _instants(recording: Recording) -> Iterator[tuple[float, str, str]]:
    """Yields time, name and colour of what is marked."""
    yield 0.0, "contact of the failure" if recording.twin else "contact", "black"
    if recording.collision.visible_for_s > 0 and not recording.twin:
        yield recording.time_s[-1] - recording.collision.visible_for_s, "in the ego's view from here", SEEN_COLOUR
    yield recording.released_s, "adversaries released", RELEASE_COLOUR
    if recording.conflict_s is not None:
        yield recording.conflict_s, "conflict begins", CONFLICT_COLOUR


def draw(family: FamilyName, recording: Recording, file: Path, twin: Recording | None = None) -> None:
    """Draws a contact, and its twin beside it, into a png, pdf or svg file."""
    if file.suffix not in (".png", ".pdf", ".svg"):
        raise ConfigError("out", f"{str(file)!r}", "a name that ends in .png, .pdf or .svg")
    content = recording_bytes(family, recording, file.suffix.removeprefix("."), twin)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)


def recording_bytes(family: FamilyName, recording: Recording, format_: str, twin: Recording | None = None) -> bytes:
    """Returns the picture of a contact as a png, pdf or svg."""
    return picture(partial(draw_recording, family, recording, twin), [format_], DPI, {})[0]


def draw_recording(family: FamilyName, recording: Recording, twin: Recording | None = None) -> Figure:
    """Draws the view from above, and one panel per kind of measurement over a common time axis.

    A twin is drawn beside it, on the same ground, clock and scales.
    """
    columns = [recording] if twin is None else [recording, twin]
    low, high = _extent(recording)
    view_in = PANEL_WIDTH_IN * (high - low)[1] / (high - low)[0]
    heights = (view_in, *(PANEL_IN for _ in PANELS))
    figure = canvas((WIDTH_IN * len(columns), sum(heights) + 1.2))
    grid = figure.subplots(len(heights), len(columns), height_ratios=heights, squeeze=False)
    figure.suptitle(caption(family, recording), fontsize=11)
    for each, (view, *axes) in zip(columns, grid.T, strict=True):
        draw_from_above(view, family, each, apart_m=LABEL_IN * (high - low)[0] / PANEL_WIDTH_IN)
        view.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        if twin is not None:
            view.set_title(each.twin or "the failure", fontsize=10)
        for axis, panel, first in zip(axes, PANELS, grid[1:, 0], strict=True):
            axis.sharex(grid[1, 0])
            if axis is not first:
                axis.sharey(first)  # before anything is drawn, so that there is room for both
            panel(axis, each)
            _mark_instants(axis, each)
            axis.label_outer()
        _name_instants(axes[0], each)
        axes[-1].set_xlabel("time before the contact, s")
    after_s = 0.15 if twin is None else max(0.15, twin.time_s[-1])
    grid[1, 0].set_xlim(max(recording.time_s[0], -PANELS_S), after_s)
    return figure


def _extent(recording: Recording) -> tuple[Floats, Floats]:
    """Corners of the ground that both took in the last seconds, grown to a shape that fits the page."""
    begin_s = recording.conflict_s
    shown = recording.time_s >= min(-VIEW_S, max(begin_s, -PANELS_S) if begin_s is not None else 0.0)
    pair = [0, recording.other]
    points = np.concatenate([recording[name][shown][:, pair].reshape(1, -1) for name in ("x_m", "y_m")])
    low, high = np.nanmin(points, axis=1) - MARGIN_M, np.nanmax(points, axis=1) + MARGIN_M
    width, height = high - low
    height = max(height, width * VIEW_IN[0] / PANEL_WIDTH_IN)
    width = max(width, height * PANEL_WIDTH_IN / VIEW_IN[1])
    middle, half = (low + high) / 2, np.array((width, height)) / 2
    return middle - half, middle + half
