"""What a picture needs of a SUMO net: the surfaces one drives and walks on, as polygons."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from risk_sac.types import Floats


@dataclass(frozen=True, slots=True)
class Surface:
    """A lane, crossing or junction."""

    use: str  # lane | sidewalk | crossing | junction
    outline: Floats  # `k x 2`, m, a closed ring without its last point


def read_surfaces(net: Path) -> list[Surface]:
    """The surfaces of a net, junctions first so that lanes are drawn over them.

    Lanes inside junctions overlap each other and are left out: the junction's own outline stands for them.
    """
    root = ET.parse(net).getroot()  # a net of ours, not one that a user sent
    surfaces = [
        Surface("junction", _points(junction.get("shape", "")))
        for junction in root.iter("junction")
        if junction.get("type") not in ("internal", "dead_end")
    ]
    for edge in root.iter("edge"):
        function = edge.get("function", "normal")
        if function not in ("normal", "crossing"):
            continue
        for lane in edge.iter("lane"):
            pedestrian = lane.get("allow") == "pedestrian"
            use = "crossing" if function == "crossing" else "sidewalk" if pedestrian else "lane"
            centre = _points(lane.get("shape", ""))
            surfaces.append(Surface(use, _ribbon(centre, float(lane.get("width", "3.2")))))
    return surfaces


def _points(shape: str) -> Floats:
    """`k x 2` of a net's "x,y x,y ..."; a height, where given, is dropped."""
    return np.array([[float(value) for value in point.split(",")[:2]] for point in shape.split()]).reshape(-1, 2)


def _ribbon(centre: Floats, width_m: float) -> Floats:
    """Outline, `2k x 2`, of a ribbon along a line; each point is moved across the line's direction there."""
    along = np.gradient(centre, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    left = np.column_stack((-along[:, 1], along[:, 0])) * width_m / 2
    return np.concatenate((centre + left, (centre - left)[::-1]))
