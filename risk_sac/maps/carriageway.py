"""The carriageway of a net: where cars may drive in a direction.

It consists of the lanes for cars that lead in about that direction, inside junctions too, and of whole junctions where
roads cross or join, without their walkways. Oncoming lanes are part of it only for `ANY_WAY`.
"""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from importlib.resources import files
from itertools import combinations, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from risk_sac.world.net import Link, Net, NetLane
from risk_sac.world.read_net import parse_net, read_tree
from risk_sac.world.types import Floats, Point

SECTORS = 12  # of headings; each lane is near the middle of some of them, for any grid of streets
SECTOR_RAD = math.tau / SECTORS
ANY_WAY = SECTORS  # the sector of an ego that may use oncoming lanes
LEAST_COS = math.cos(math.radians(112.0))  # of a lane against a sector: crossing roads count, oncoming ones do not
SQUARE_M = 32.0
REACH_M = 10.0  # how far distances are measured
MARGIN_M = 35.0  # around a square: what an ego overtakes is up to 30 m ahead of it, see `overtakes`
SLIT_M = 0.6  # gaps no wider lie between lanes that belong together: nets are rounded, and some are drawn loosely
EXACT_M = 0.01


class Surroundings(NamedTuple):
    """Carriageway around a square of the net, for a sector of headings."""

    edges: Floats  # `k x 5`: x, y of both ends of a piece of the outline; 1 / length², 0 for a mere cut
    lanes: Floats  # `l x 7`: x, y, cos, sin, length of a segment of a lane's middle, any direction; speed limit; width


class Carriageway:
    """Carriageway of a net, computed for surroundings that egos reach."""

    def __init__(self, net: Net | None = None) -> None:
        """Reads a net's lanes and junctions; without a net it is empty."""
        pieces, ways, segments = [], [], []
        for lane, limit_mps in () if net is None else _lanes(net):
            for i, (a, b) in enumerate(pairwise(lane.line)):
                if (length_m := math.dist(a, b)) > 0.0:
                    # With its neighbours, so that bends have no gaps.
                    line = shapely.LineString(lane.line[max(i - 1, 0) : i + 3])
                    pieces.append(line.buffer(lane.width_m / 2, cap_style="flat", join_style="mitre"))
                    ways.append(math.atan2(b[1] - a[1], b[0] - a[0]))
                    way = (b[0] - a[0]) / length_m, (b[1] - a[1]) / length_m
                    segments.append((*a, *way, length_m, limit_mps, lane.width_m))
        crossed = [] if net is None else list(_crossed_junctions(net))
        self._pieces = np.array([*pieces, *crossed], dtype=object)
        self._ways = np.array(ways + [math.nan] * len(crossed))  # of junctions: any
        self._segments = np.array(segments, dtype=np.float64).reshape(-1, 7)
        self._tree = shapely.STRtree(self._pieces)
        self._known: dict[tuple[int, int, int], Surroundings] = {}
        self._lanes: dict[tuple[int, int], Floats] = {}

    def around(self, x_m: float, y_m: float, sector: int) -> Surroundings:
        """Returns a point's surroundings for a sector (see `sector_of`) or `ANY_WAY`."""
        key = *square_of(x_m, y_m), sector
        if (known := self._known.get(key)) is None:
            known = self._known[key] = self._surroundings(*key)
        return known

    def lanes(self, square: tuple[int, int]) -> Floats:
        """Returns `Surroundings.lanes` around a square, see `square_of`."""
        if (known := self._lanes.get(square)) is None:
            near = self._near(_square(*square))
            known = self._lanes[square] = self._segments[near[near < len(self._segments)]]
        return known

    def _near(self, square: shapely.Geometry) -> NDArray[np.intp]:
        return np.sort(self._tree.query(square))

    def _surroundings(self, column: int, row: int, sector: int) -> Surroundings:
        square = _square(column, row)
        near = self._near(square)
        turned = np.cos(self._ways[near] - sector * SECTOR_RAD)
        admitted = near if sector == ANY_WAY else near[~(turned < LEAST_COS)]
        ground = shapely.union_all(self._pieces[admitted], grid_size=1e-6)
        for by_m in (SLIT_M / 2, -SLIT_M / 2):
            ground = ground.buffer(by_m, join_style="mitre")
        outline = _outline(ground.simplify(EXACT_M).intersection(square), square.bounds)
        return Surroundings(outline, self._segments[near[near < len(self._segments)]])


def square_of(x_m: float, y_m: float) -> tuple[int, int]:
    """Returns column and row of the square that a point is in."""
    return int(x_m // SQUARE_M), int(y_m // SQUARE_M)


def _square(column: int, row: int) -> shapely.Polygon:
    x, y = column * SQUARE_M, row * SQUARE_M
    return shapely.box(x - MARGIN_M, y - MARGIN_M, x + SQUARE_M + MARGIN_M, y + SQUARE_M + MARGIN_M)


@lru_cache(maxsize=8)
def carriageway_of(net: str) -> Carriageway:
    """Returns a net's carriageway; the file is below `sumo_nets/` or absolute."""
    return Carriageway(parse_net(read_tree(Path(str(files("sumo_nets"))) / net)))


def sector_of(heading_rad: float) -> int:
    """Returns the sector of a heading."""
    return round(heading_rad / SECTOR_RAD) % SECTORS


def _lanes(net: Net) -> Iterator[tuple[NetLane, float]]:
    """Yields lanes for cars and limits; junctions take those of entering lanes.

    SUMO's limits inside junctions are turning speeds.
    """
    entered: dict[str, float] = {}
    for link in (link for links in net.onward.values() for link in links):
        for lane in link.inside:
            entered[lane.id] = max(link.source.limit_mps, entered.get(lane.id, 0.0))
    for edge in net.edges.values():
        yield from ((lane, lane.limit_mps) for lane in edge.drivable)
    for lanes in net.inside.values():
        yield from ((lane, entered.get(lane.id, lane.limit_mps)) for lane in lanes)


def _crossed_junctions(net: Net) -> Iterator[shapely.Geometry]:
    """Yields junction areas where links of different roads meet, without walkways."""
    links: dict[str, list[Link]] = {}
    for leading in net.onward.values():
        for link in leading:
            links.setdefault(net.edges[link.source.edge].end, []).append(link)
    for id_, junction in net.junctions.items():
        pairs = combinations(links.get(id_, ()), 2)
        if len(junction.outline) > 2 and any(a.source.edge != b.source.edge and net.are_foes(a, b) for a, b in pairs):
            yield _polygon(junction.outline).difference(shapely.union_all([*map(_polygon, net.walkways[id_])]))


def _polygon(outline: Sequence[Point]) -> shapely.Geometry:
    return shapely.Polygon(outline).buffer(0.0) if len(outline) > 2 else shapely.Polygon()


def _outline(ground: shapely.Geometry, bounds: tuple[float, float, float, float]) -> Floats:
    """Returns polygons' rings as rows of `Surroundings.edges`; edges on bounds are cuts."""
    rows = []
    for polygon in shapely.get_parts(ground):
        for ring in (polygon.exterior, *polygon.interiors) if polygon.geom_type == "Polygon" else ():
            points = shapely.get_coordinates(ring).round(3)  # removes rounding errors of GEOS
            for a, b in pairwise(points):
                on = [abs(a[k % 2] - bounds[k]) < 1e-6 and abs(b[k % 2] - bounds[k]) < 1e-6 for k in range(4)]
                length2 = ((b - a) ** 2).sum()
                rows.append((*a, *b, 0.0 if any(on) or length2 == 0.0 else 1.0 / length2))
    return np.array(rows, dtype=np.float64).reshape(-1, 5)
