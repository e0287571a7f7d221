"""Picture of a scenario from above: how it begins, and where its actors may start."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from risk_sac.config import Scenario
from risk_sac.config.scenario import EGO
from risk_sac.errors import ConfigError, InfeasibleScene
from risk_sac.failures.from_above import EGO_COLOUR, HALO, canvas, picture
from risk_sac.failures.net import surfaces
from risk_sac.scenario.check import bodies_of, scenes
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.world.net import Net
from risk_sac.world.types import Floats

SCENES = 60
WIDTH_IN, DPI = 6.0, 150
RATIO = (1.4, 2.4)  # least and greatest of width over height; in between it follows from the view
AROUND_M, LEAST_M = 14.0, 30.0  # of road around the actors; height of the view
AHEAD_S = 2.0  # that arrows show
SCALE_M = 20.0
COLOURS = ("tab:red", "tab:orange", "tab:green", "tab:purple", "tab:brown", "tab:pink", "tab:olive", "tab:cyan")
SURFACES = {"junction": "0.87", "lane": "0.87", "sidewalk": "0.95", "crossing": "0.72"}  # seen at 76 pixels, too
TRAFFIC = "0.55"
RANGE_ALPHA = 0.12
LABEL: dict[str, Any] = {
    "xytext": (0, 7),
    "textcoords": "offset points",
    "ha": "center",
    "fontsize": 12,
    "path_effects": HALO,
    "zorder": 4,
}


def scenario_png(document: Scenario, nets: Mapping[str, str]) -> bytes:
    """Draws a scenario; equal documents give equal bytes.

    The view holds the ego and its adversaries in the middle of all ranges. Arrows show where they are 2 s later if they
    go straight on; faint bodies show other starts.

    Args:
      document: of the scenario; of several nets the first scene's is drawn.
      nets: the file of each network that it names.

    Raises:
      ConfigError: none of the scenes is possible.
    """
    of = Interpreter(document, nets)
    starts: dict[str, list[Floats]] = defaultdict(list)
    net: Net | None = None
    ahead: dict[str, Floats] = {}
    for scene in scenes(of, SCENES):
        try:
            layout = of.layout(scene.values)
        except InfeasibleScene as infeasible:
            if isinstance(infeasible.__cause__, ConfigError):
                raise infeasible.__cause__ from infeasible
            continue
        net = net or net_of(layout.net)
        ahead = ahead or bodies_of(layout, net, AHEAD_S)
        if net is net_of(layout.net):
            for name, box in bodies_of(layout, net).items():
                starts[name if name in document.actors or name == EGO else name.rpartition("_")[0]].append(box)
    if net is None:
        raise ConfigError("constraints", "no scene that keeps them", "constraints that leave some scenes")
    (content,) = picture(partial(_figure, document, net, starts, ahead), ["png"], DPI, {})
    return content


def _figure(
    document: Scenario, net: Net, starts: Mapping[str, Sequence[Floats]], ahead: Mapping[str, Floats]
) -> Figure:
    traffic = {
        name
        for name in starts
        if name in document.streams or (name in document.actors and document.actors[name].role == "background")
    }
    acting = [name for name in starts if name not in traffic]
    low, high, ratio = _view([starts[name][0] for name in acting] + [ahead[name] for name in acting if name in ahead])
    figure = canvas((WIDTH_IN, WIDTH_IN / ratio))
    figure.set_layout_engine("none")
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axis.set_axis_off()
    ground = surfaces(net)
    for use, colour in SURFACES.items():
        outlines = [surface.outline for surface in ground if surface.use == use]
        axis.add_collection(PolyCollection(outlines, facecolors=colour, edgecolors="0.6", linewidths=0.4))
    colours = iter(COLOURS * (1 + len(document.actors) // len(COLOURS)))
    for name, boxes in starts.items():
        colour = EGO_COLOUR if name == EGO else TRAFFIC if name in traffic else next(colours)
        axis.add_collection(PolyCollection(boxes, facecolors=colour, edgecolors="none", alpha=RANGE_ALPHA, zorder=2))
        axis.add_collection(PolyCollection(boxes[:1], facecolors=colour, edgecolors="0.2", linewidths=0.6, zorder=3))
        start = boxes[0].mean(axis=0)
        if name in ahead and not np.allclose(ahead[name], boxes[0]):
            arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 2.0, "mutation_scale": 16, "shrinkA": 0}
            axis.annotate("", ahead[name].mean(axis=0), start, arrowprops=arrow, zorder=3, annotation_clip=False)
        if name not in traffic and (low < start).all() and (start < high).all():
            axis.annotate(name.replace("_", " "), (float(start[0]), float(start[1])), color=colour, **LABEL)
    edge_m = 0.03 * (high[0] - low[0])
    axis.plot([low[0] + edge_m, low[0] + edge_m + SCALE_M], [low[1] + edge_m] * 2, color="0.3", linewidth=2, zorder=4)
    axis.annotate(f"{SCALE_M:.0f} m", (low[0] + edge_m + SCALE_M / 2, low[1] + edge_m), color="0.3", **LABEL)
    return figure


def _view(boxes: Sequence[Floats]) -> tuple[Floats, Floats, float]:
    """Returns the corners of the view around the boxes, m, and its width over its height."""
    points = np.concatenate(boxes)
    low, high = points.min(axis=0) - AROUND_M, points.max(axis=0) + AROUND_M
    wide_m, high_m = high - low
    high_m = max(high_m, LEAST_M)
    ratio = float(np.clip(wide_m / high_m, *RATIO))
    size = np.array([max(wide_m, ratio * high_m), max(high_m, wide_m / ratio)])
    middle = (low + high) / 2
    return middle - size / 2, middle + size / 2, ratio
