"""A map from above, with the places that were found on it."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from risk_sac.canvas import canvas, picture
from risk_sac.failures.from_above import SURFACE_COLOURS
from risk_sac.failures.net import SurfaceUse, ribbon
from risk_sac.scenario.maps.found import TITLES, Pattern, Survey
from risk_sac.scenario.maps.net import Net
from risk_sac.types import Floats

MARKS: dict[Pattern, tuple[str, str]] = {
    "car_following": ("o", "tab:blue"),
    "crossing": ("s", "tab:orange"),
    "junction": ("^", "tab:green"),
}
WIDTH_IN, DPI = 9.0, 130
HEIGHT_IN = (4.5, 12.0)  # the least and the most; in between it goes by the map's
NAMED = 60  # so many names can be told apart


def map_png(net: Net, found: Survey) -> bytes:
    """The picture of a whole map."""
    (content,) = picture(partial(_figure, net, found), ["png"], DPI, {})
    return content


def _figure(net: Net, found: Survey) -> Figure:
    ground = _ground(net)
    figure = canvas((WIDTH_IN, _height_in(ground)))
    axis = figure.subplots()
    for use, colour in SURFACE_COLOURS.items():
        axis.add_collection(PolyCollection(ground[use], facecolors=colour, edgecolors="0.6", linewidths=0.2))
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
    axis.legend(loc="upper right", fontsize=7)  # the best place takes minutes to find on a large map
    return figure


def _ground(net: Net) -> Mapping[SurfaceUse, Sequence[Floats]]:
    """Returns the outlines of all surfaces; a lane that is closed to cars is drawn as a sidewalk."""
    lanes = [lane for edge in net.edges.values() for lane in edge.lanes]
    return {
        "junction": [np.array(each.outline) for each in net.junctions.values() if each.outline],
        "lane": [ribbon(np.array(lane.line), lane.width_m) for lane in lanes if lane.drivable],
        "sidewalk": [ribbon(np.array(lane.line), lane.width_m) for lane in lanes if not lane.drivable],
        "crossing": [ribbon(np.array(each.line), each.width_m) for each in net.crossings],
    }


def _height_in(ground: Mapping[SurfaceUse, Sequence[Floats]]) -> float:
    points = np.concatenate([outline for outlines in ground.values() for outline in outlines])
    wide_m, high_m = np.maximum(np.ptp(points, axis=0), 1.0)
    return float(np.clip(WIDTH_IN * high_m / wide_m, *HEIGHT_IN))
