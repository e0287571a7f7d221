"""A map from above, with the places that were found on it."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from risk_sac.canvas import canvas, picture
from risk_sac.failures.from_above import SURFACE_COLOURS
from risk_sac.failures.net import Surface, read_net, surfaces
from risk_sac.scenario.maps.found import TITLES, Pattern, Survey

MARKS: dict[Pattern, tuple[str, str]] = {
    "car_following": ("o", "tab:blue"),
    "crossing": ("s", "tab:orange"),
    "junction": ("^", "tab:green"),
}
WIDTH_IN, DPI = 9.0, 130
HEIGHT_IN = (4.5, 12.0)  # the least and the most; in between it goes by the map's
NAMED = 60  # so many names can be told apart


def map_png(net: Path, found: Survey) -> bytes:
    """The picture of a whole map."""
    (content,) = picture(partial(_figure, net, found), ["png"], DPI, {})
    return content


def _figure(net: Path, found: Survey) -> Figure:
    ground = surfaces(read_net(net))
    figure = canvas((WIDTH_IN, _height_in(ground)))
    axis = figure.subplots()
    for use, colour in SURFACE_COLOURS.items():
        outlines = [surface.outline for surface in ground if surface.use == use]
        axis.add_collection(PolyCollection(outlines, facecolors=colour, edgecolors="0.6", linewidths=0.2))
    x = [misfit.spot.x_m for misfit in found.misfits]
    y = [misfit.spot.y_m for misfit in found.misfits]
    axis.scatter(x, y, s=5, color="0.5", marker="x", linewidths=0.5, label=f"does not fit ({len(x)})")
    for pattern, (marker, colour) in MARKS.items():
        spots = [fit.spot for fit in found.fits if fit.spot.pattern == pattern]
        x, y = [spot.x_m for spot in spots], [spot.y_m for spot in spots]
        label = f"{TITLES[pattern]} ({len(spots)})"
        axis.scatter(x, y, s=16, color=colour, marker=marker, alpha=0.8, label=label, zorder=3)
    if len(found.fits) <= NAMED:
        for id_, spot in {fit.spot.id: fit.spot for fit in found.fits}.items():  # once where several patterns fit
            if np.isfinite((spot.x_m, spot.y_m)).all():
                axis.annotate(id_, (spot.x_m, spot.y_m), (3, 3), textcoords="offset points", fontsize=5, zorder=4)
    axis.autoscale()
    axis.set_aspect("equal")
    axis.set(xlabel="x, m", ylabel="y, m")
    axis.legend(loc="best", fontsize=7)
    return figure


def _height_in(ground: Sequence[Surface]) -> float:
    points = np.concatenate([surface.outline for surface in ground])
    wide_m, high_m = np.maximum(np.ptp(points, axis=0), 1.0)
    return float(np.clip(WIDTH_IN * high_m / wide_m, *HEIGHT_IN))
