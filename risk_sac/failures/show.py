"""Draws one contact as the paper's Fig. 2 does: both paths from above, and what was measured along the way.

Where the contact was judged, the moment at which the conflict began is marked as well.
"""

from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from risk_sac.canvas import canvas, picture
from risk_sac.config import FamilyName
from risk_sac.errors import ConfigError
from risk_sac.failures.caption import caption
from risk_sac.failures.from_above import draw_from_above
from risk_sac.failures.panels import PANELS, mark_instants, name_instants
from risk_sac.failures.recording import Recording
from risk_sac.types import Floats

VIEW_S, PANELS_S = 3.0, 8.0  # before the contact: what the view from above holds, and the panels
MARGIN_M = 5.0
WIDTH_IN, PANEL_IN, DPI = 11.0, 1.5, 110
PANEL_WIDTH_IN = 8.7  # what legends and labels leave of the width
LABEL_IN = 0.25  # what a label needs on the page
VIEW_IN = (2.2, 6.0)  # least and greatest height of the view from above


def draw(family: FamilyName, recording: Recording, file: Path, twin: Recording | None = None) -> None:
    """Draws a contact into a file.

    Args:
      family: of the run.
      recording: of the contact.
      file: its suffix names the format: png, pdf or svg.
      twin: is drawn beside it.

    Raises:
      ConfigError: the format is none of these.
      OSError: the picture cannot be written.
    """
    if file.suffix not in (".png", ".pdf", ".svg"):
        raise ConfigError("out", f"{str(file)!r}", "a name that ends in .png, .pdf or .svg")
    content = recording_bytes(family, recording, file.suffix.removeprefix("."), twin)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)


def recording_bytes(family: FamilyName, recording: Recording, format_: str, twin: Recording | None = None) -> bytes:
    """The picture of a contact as a file: png, pdf or svg."""
    return picture(partial(draw_recording, family, recording, twin), [format_], DPI, {})[0]


def draw_recording(family: FamilyName, recording: Recording, twin: Recording | None = None) -> Figure:
    """The whole figure: the view from above, and one panel per kind of measurement over a common time axis.

    Args:
      family: of the run.
      recording: of the contact.
      twin: is drawn beside it, on the same ground, clock and scales.
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
            mark_instants(axis, each)
            axis.label_outer()
        name_instants(axes[0], each)
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
