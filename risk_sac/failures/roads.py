"""What a picture needs of a SUMO net: the surfaces one drives and walks on, as polygons."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

import sumo_nets
from risk_sac.config import FamilyName
from risk_sac.scenario.families import family_named
from risk_sac.types import Floats

Use = Literal["lane", "sidewalk", "crossing", "junction"]


@dataclass(frozen=True, slots=True)
class Surface:
    """A lane, crossing or junction."""

    use: Use
    outline: Floats  # `k x 2`, m, a closed ring without its last point


def roads_of(family: FamilyName, scene: Mapping[str, float]) -> Sequence[Surface]:
    """Returns the surfaces of a scene's net."""
    return _shipped(family_named(family).layout(scene).net)


@cache  # there are a few nets, and they stay as they are
def _shipped(net: str) -> tuple[Surface, ...]:
    return tuple(read_surfaces(Path(sumo_nets.__path__[0]) / net))


def read_surfaces(net: Path) -> list[Surface]:
    """The surfaces of a net, junctions first so that lanes are drawn over them.

    Lanes inside junctions overlap each other and are left out: the junction's own outline stands for them.
    """
    root = ET.parse(net).getroot()  # a net of ours, not one that a user sent
    surfaces = [
        Surface("junction", points_of(junction.get("shape", "")))
        for junction in root.iter("junction")
        if junction.get("type") not in ("internal", "dead_end")
    ]
    for edge in root.iter("edge"):
        function = edge.get("function", "normal")
        if function not in ("normal", "crossing"):
            continue
        for lane in edge.iter("lane"):
            pedestrian = lane.get("allow") == "pedestrian"
            use: Use = "crossing" if function == "crossing" else "sidewalk" if pedestrian else "lane"
            centre = points_of(lane.get("shape", ""))
            surfaces.append(Surface(use, _ribbon(centre, float(lane.get("width", "3.2")))))
    return surfaces


def points_of(shape: str) -> Floats:
    """`k x 2` of a net's "x,y x,y ..."; a height, where given, is dropped."""
    return np.array([[float(value) for value in point.split(",")[:2]] for point in shape.split()]).reshape(-1, 2)


def _ribbon(centre: Floats, width_m: float) -> Floats:
    """Outline, `2k x 2`, of a ribbon along a line; each point is moved across the line's direction there."""
    along = np.gradient(centre, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    left = np.column_stack((-along[:, 1], along[:, 0])) * width_m / 2
    return np.concatenate((centre + left, (centre - left)[::-1]))
