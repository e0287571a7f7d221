"""What the bends of a path ask of a vehicle: worked out once per path, looked up at every step."""

import math

import numpy as np

from risk_sac.jit import compiled
from risk_sac.scenario.layout import CAR_LENGTH_M
from risk_sac.scenario.limits import Limits
from risk_sac.sim.paths import HEADING, STATION, Path
from risk_sac.types import Floats

GRID_M = 0.5
BODY_M = CAR_LENGTH_M  # SUMO turns a body while it passes a corner of the lane, over the body's own length
AHEAD_M = 5.0  # so early braking makes way for a bend; more than BODY_M, or a bend is not seen whole as it begins
NO_BEND_PER_M = 1e-6

# Rows of the bends of a path.
HERE = 0  # amount of the curvature, 1/m
SOON = 1  # the largest from there until AHEAD_M on
CAP = 2  # speed from which all bends ahead can be driven as planned, m/s


def bends(path: Path, limits: Limits) -> Floats:
    """The bends of a path at the stations 0, GRID_M, 2·GRID_M …, and how fast they can be approached; `3 x stations`.

    v(s)² = min over s' ≥ s of  a / κ(s') + 2 b (s' - s),   a the planned cornering, b the braking left beside it
    """
    points = path.points
    return _profile(points[STATION], points[HEADING], limits.cornering_mps2, limits.approach_mps2)


@compiled
def index(bends: Floats, station_m: float) -> int:
    """Column of a station; beyond the path's ends, that of its ends."""
    column: int = min(max(int(station_m / GRID_M), 0), bends.shape[1] - 1)
    return column


@compiled
def _profile(station: Floats, heading: Floats, cornering: float, braking: float) -> Floats:
    n = int(station[-1] / GRID_M) + 1
    found = np.zeros((3, n))
    curvature, ahead, cap = found[HERE], found[SOON], found[CAP]
    for i in range(1, len(station)):
        turn = (heading[i] - heading[i - 1] + math.pi) % (2 * math.pi) - math.pi
        for k in range(math.ceil(station[i] / GRID_M), min(math.ceil((station[i] + BODY_M) / GRID_M), n)):
            curvature[k] += turn / BODY_M
    curvature[:] = np.abs(curvature)
    reachable = np.inf  # square of the speed from which the next station's cap can be braked to
    for k in range(n - 1, -1, -1):
        ahead[k] = curvature[k : k + int(AHEAD_M / GRID_M) + 1].max()
        square = min(cornering / max(ahead[k], NO_BEND_PER_M), reachable)
        cap[k] = math.sqrt(square)
        reachable = square + 2 * braking * GRID_M
    return found
