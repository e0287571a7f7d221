"""The ground of a net that verdicts look at, as convex polygons, and the kerbs of its crossings."""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np

from risk_sac.scenario.clearance import is_near, outlines
from risk_sac.scenario.layout import CAR_LENGTH_M, CAR_WIDTH_M, Area, areas, ribbon, triangles
from risk_sac.world.net import Crossing, Net
from risk_sac.world.read_net import parse_net, read_tree
from risk_sac.world.types import Point

CROSSINGS_M = 60.0  # crossings up to this far from a place are recorded
WALKED_M = 40.0  # a pedestrian's longest way in an episode
JUNCTIONS_M = 120.0
KERB_M = 0.05  # of the crossing before its ends: a pedestrian at the kerb is on the road's edge
CLEAR_M, MOST_BACK_M = 0.3, 5.0  # of the kerb from cars that turn across it, and how far it is moved for that
BESIDE_M = 1.9 + 0.25  # from the crossing's axis, that a pedestrian may reach
LEGS = 3  # of a junction where ways can cross
GROUND_FILE = "ground.json"  # beside a net: its ground, where that was measured by hand
Polygons = Sequence[Sequence[Point]]


@lru_cache(maxsize=64)
def net_of(file: str) -> Net:
    """Reads a net, a file below `sumo_nets/` or an absolute path; raises `MapError` if it is none."""
    return parse_net(read_tree(Path(str(files("sumo_nets"))) / file))


class GroundAreas(NamedTuple):
    """Areas where vehicles and pedestrians meet."""

    crossings: tuple[Area, ...] = ()  # for pedestrians; drivers yield there
    roadway: tuple[Area, ...] = ()  # where vehicles drive, as far as pedestrians may get there
    junctions: tuple[Area, ...] = ()  # where the ways of vehicles cross


@cache
def ground_of(file: str, places: tuple[Point, ...], *, walked: bool) -> GroundAreas:
    """Returns the ground of a net around places.

    Args:
      file: the net's; beside it may lie a `ground.json`, which says it for the whole net.
      places: x and y, m.
      walked: whether pedestrians may get there; if not, crossings and roadway are left out.
    """
    measured = Path(str(files("sumo_nets"))) / Path(file).parent / GROUND_FILE
    if measured.exists():
        return GroundAreas(**{name: areas(corners) for name, corners in json.loads(measured.read_bytes()).items()})
    net = net_of(file)
    kinds: tuple[list[Sequence[Point]], ...] = [], [], []
    for x_m, y_m in places:
        for polygons, new in zip(kinds, _around(net, x_m, y_m, walked=walked), strict=True):
            polygons += [polygon for polygon in _rounded(new) if polygon not in polygons]
    return GroundAreas(*map(areas, kinds))


def _around(net: Net, x_m: float, y_m: float, *, walked: bool) -> tuple[Polygons, Polygons, Polygons]:
    """Crossings, roadway and junctions around a point."""
    junctions = [
        triangle
        for junction in net.junctions.values()
        if math.hypot(junction.x_m - x_m, junction.y_m - y_m) <= JUNCTIONS_M and len(junction.foes) >= LEGS
        for triangle in triangles(junction.outline)
    ]
    if not walked:
        return [], [], junctions
    crossings = [
        quad
        for crossing in net.crossings
        if is_near(crossing.line, x_m, y_m, CROSSINGS_M)
        for quad in ribbon(crossing.line, crossing.width_m)
    ]
    lanes = [lane for edge in net.edges.values() for lane in edge.drivable if is_near(lane.line, x_m, y_m, WALKED_M)]
    for junction in net.junctions.values():
        if math.hypot(junction.x_m - x_m, junction.y_m - y_m) <= 3 * WALKED_M:
            lanes += [lane for lane in net.inside.get(junction.id, ()) if is_near(lane.line, x_m, y_m, WALKED_M)]
    quads = (quad for lane in lanes for quad in ribbon(lane.line, lane.width_m))
    return crossings, [quad for quad in quads if is_near((*quad, quad[0]), x_m, y_m, WALKED_M)], junctions


def _rounded(polygons: Iterable[Sequence[Point]]) -> Iterator[tuple[Point, ...]]:
    """To a millimetre."""
    return (tuple((round(x, 3), round(y, 3)) for x, y in polygon) for polygon in polygons)


class Kerb(NamedTuple):
    """The end of a way across a road."""

    x_m: float
    y_m: float
    along_x: float  # unit vector across the road
    along_y: float


def kerb_of(net: Net, crossing: Crossing, driven_rad: float) -> Kerb:
    """Returns the kerb of a crossing on a driver's right.

    Where cars turn round the corner across the end of a crossing, the kerb is beyond them, so a waiting pedestrian is
    clear.
    """
    right = (math.sin(driven_rad), -math.cos(driven_rad))
    (x0, y0), (x1, y1) = crossing.line[0], crossing.line[-1]
    line = crossing.line if (x0 - x1) * right[0] + (y0 - y1) * right[1] >= 0.0 else crossing.line[::-1]
    (x, y), (to_x, to_y) = line[0], line[1]
    length = math.hypot(to_x - x, to_y - y)
    kerb = Kerb(x, y, (to_x - x) / length, (to_y - y) / length)
    back_m = _turned_over_m(net, crossing.junction, kerb) - KERB_M
    return kerb._replace(x_m=x - kerb.along_x * back_m, y_m=y - kerb.along_y * back_m)


def _turned_over_m(net: Net, junction: str, kerb: Kerb) -> float:
    """Computes how far a kerb moves back to be clear of turning cars."""
    links = [link for edge in net.arriving[junction] for lane in edge.drivable for link in net.onward.get(lane.id, ())]
    if not links:
        return 0.0
    x, y = np.concatenate([outlines(link, CAR_LENGTH_M, CAR_WIDTH_M) for link in links], axis=1)
    along_m = (x - kerb.x_m) * kerb.along_x + (y - kerb.y_m) * kerb.along_y
    across_m = (y - kerb.y_m) * kerb.along_x - (x - kerb.x_m) * kerb.along_y
    met = (np.abs(across_m) <= BESIDE_M) & (along_m >= -MOST_BACK_M) & (along_m < CLEAR_M)
    return min(float(CLEAR_M - along_m[met].min()), MOST_BACK_M) if met.any() else 0.0
