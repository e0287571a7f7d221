"""The ground around a place: crossings, lanes and junctions as convex polygons."""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from risk_sac.scenario.family import WALK_OFFSET_M
from risk_sac.scenario.ground import Point, ribbon, triangles
from risk_sac.scenario.layout import CAR_LENGTH_M, CAR_WIDTH_M
from risk_sac.scenario.maps.clearance import is_near, outlines
from risk_sac.scenario.maps.net import Crossing, Net
from risk_sac.scenario.place import Ground, Signal, Walk

CROSSINGS_M = 60.0  # crossings up to this far from a place are recorded
WALKED_M = 40.0  # a pedestrian's longest way in an episode
JUNCTIONS_M = 120.0
KERB_M = 0.05  # of the crossing before its ends: a pedestrian at the kerb is on the road's edge
CLEAR_M, MOST_BACK_M = 0.3, 5.0  # of the kerb from cars that turn across it, and how far it is moved for that
BESIDE_M = WALK_OFFSET_M + 0.25  # from the crossing's axis, that a pedestrian may reach
LEGS = 3  # of a junction where ways can cross


def ground_around(net: Net, x_m: float, y_m: float, *, walked: bool) -> Ground:
    """The ground around a point that verdicts look at; where no pedestrian walks, the junctions alone."""
    junctions = [
        triangle
        for junction in net.junctions.values()
        if math.hypot(junction.x_m - x_m, junction.y_m - y_m) <= JUNCTIONS_M and len(junction.foes) >= LEGS
        for triangle in triangles(junction.outline)
    ]
    if not walked:
        return Ground(junctions=_rounded(junctions))
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
    roadway = [quad for quad in quads if is_near((*quad, quad[0]), x_m, y_m, WALKED_M)]
    return Ground(crossings=_rounded(crossings), roadway=_rounded(roadway), junctions=_rounded(junctions))


def walk_over(net: Net, crossing: Crossing, driven_rad: float) -> Walk:
    """Returns a walk over a crossing, from the kerb on a driver's right.

    Where cars turn round the corner across the end of a crossing, the kerb is beyond them, so a waiting pedestrian is
    clear.
    """
    right = (math.sin(driven_rad), -math.cos(driven_rad))
    (x0, y0), (x1, y1) = crossing.line[0], crossing.line[-1]
    line = crossing.line if (x0 - x1) * right[0] + (y0 - y1) * right[1] >= 0.0 else crossing.line[::-1]
    (x, y), (to_x, to_y) = line[0], line[1]
    length = math.hypot(to_x - x, to_y - y)
    along_x, along_y = (to_x - x) / length, (to_y - y) / length
    kerb = Walk(x_m=x, y_m=y, along_x=along_x, along_y=along_y)
    back_m = _turned_over_m(net, crossing.junction, kerb) - KERB_M
    return kerb.model_copy(update={"x_m": x - along_x * back_m, "y_m": y - along_y * back_m})


def _turned_over_m(net: Net, junction: str, kerb: Walk) -> float:
    """Computes how far a kerb moves back to be clear of turning cars."""
    links = [link for edge in net.arriving[junction] for lane in edge.drivable for link in net.onward.get(lane.id, ())]
    if not links:
        return 0.0
    x, y = np.concatenate([outlines(link, CAR_LENGTH_M, CAR_WIDTH_M) for link in links], axis=1)
    along_m = (x - kerb.x_m) * kerb.along_x + (y - kerb.y_m) * kerb.along_y
    across_m = (y - kerb.y_m) * kerb.along_x - (x - kerb.x_m) * kerb.along_y
    met = (np.abs(across_m) <= BESIDE_M) & (along_m >= -MOST_BACK_M) & (along_m < CLEAR_M)
    return min(float(CLEAR_M - along_m[met].min()), MOST_BACK_M) if met.any() else 0.0


def signal_of(net: Net, ids: Iterable[str | None]) -> Signal | None:
    """The first of the signals that are there."""
    found = (Signal(id=id_, cycle_s=net.cycles_s[id_]) for id_ in ids if id_ and net.cycles_s.get(id_, 0.0) > 0.0)
    return next(found, None)


def _rounded(polygons: Iterable[Sequence[Point]]) -> tuple[tuple[Point, ...], ...]:
    """To a millimetre."""
    return tuple(tuple((round(x, 3), round(y, 3)) for x, y in polygon) for polygon in polygons)
