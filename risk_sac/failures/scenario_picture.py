"""Picture of a scenario from above: its roads, and the ranges of all starts."""

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
from risk_sac.failures.from_above import EGO_COLOUR, HALO, SURFACE_COLOURS, canvas, picture
from risk_sac.failures.net import surfaces
from risk_sac.scenario.check import bodies_of, scenes
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.world.net import Net
from risk_sac.world.types import Floats

SCENES = 60
WIDTH_IN, DPI = 9.0, 110
HEIGHT_IN = (2.2, 8.0)  # least and greatest; in between it follows from the view
AROUND_M = 25.0  # of road around all starts
COLOURS = ("tab:red", "tab:orange", "tab:green", "tab:purple", "tab:brown", "tab:pink", "tab:olive", "tab:cyan")
TRAFFIC = "0.55"
RANGE_ALPHA = 0.12
LABEL: dict[str, Any] = {
    "xytext": (0, 7),
    "textcoords": "offset points",
    "ha": "center",
    "fontsize": 7,
    "path_effects": HALO,
    "zorder": 4,
}


def scenario_png(document: Scenario, nets: Mapping[str, str]) -> bytes:
    """Draws a scenario; equal documents give equal bytes.

    Args:
      document: of the scenario; of several nets the first scene's is drawn.
      nets: the file of each network that it names.

    Raises:
      ConfigError: none of the scenes is possible.
    """
    of = Interpreter(document, nets)
    starts: dict[str, list[Floats]] = defaultdict(list)
    net: Net | None = None
    for scene in scenes(of, SCENES):
        try:
            layout = of.layout(scene.values)
        except InfeasibleScene as infeasible:
            if isinstance(infeasible.__cause__, ConfigError):
                raise infeasible.__cause__ from infeasible
            continue
        net = net or net_of(layout.net)
        if net is net_of(layout.net):
            for name, box in bodies_of(layout, net).items():
                starts[name if name in document.actors or name == EGO else name.rpartition("_")[0]].append(box)
    if net is None:
        raise ConfigError("constraints", "no scene that keeps them", "constraints that leave some scenes")
    (content,) = picture(partial(_figure, document, net, starts), ["png"], DPI, {})
    return content


def _figure(document: Scenario, net: Net, starts: Mapping[str, Sequence[Floats]]) -> Figure:
    points = np.concatenate([np.concatenate(boxes) for boxes in starts.values()])
    low, high = points.min(axis=0) - AROUND_M, points.max(axis=0) + AROUND_M
    wide_m, high_m = high - low
    figure = canvas((WIDTH_IN, float(np.clip(WIDTH_IN * high_m / wide_m + 0.8, *HEIGHT_IN))))
    axis = figure.subplots()
    ground = surfaces(net)
    for use, colour in SURFACE_COLOURS.items():
        outlines = [surface.outline for surface in ground if surface.use == use]
        axis.add_collection(PolyCollection(outlines, facecolors=colour, edgecolors="0.6", linewidths=0.4))
    colours = iter(COLOURS * (1 + len(document.actors) // len(COLOURS)))
    for name, boxes in starts.items():
        traffic = name in document.streams or (name in document.actors and document.actors[name].role == "background")
        colour = EGO_COLOUR if name == EGO else TRAFFIC if traffic else next(colours)
        axis.add_collection(PolyCollection(boxes, facecolors=colour, edgecolors="none", alpha=RANGE_ALPHA, zorder=2))
        axis.add_collection(PolyCollection(boxes[:1], facecolors="none", edgecolors=colour, linewidths=1.2, zorder=3))
        axis.plot([], [], color=colour, linewidth=4, label=name)
        x, y = boxes[0].mean(axis=0)
        axis.annotate(name, (float(x), float(y)), color=colour, **LABEL)
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x, m", ylabel="y, m", aspect="equal")
    axis.set_title(f"{document.name}: outlines show the middle of all ranges", fontsize=8, loc="left")
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)
    return figure
