"""What the bends of a path ask of a vehicle: worked out once per path, looked up at every step."""

import math
from dataclasses import dataclass

import numpy as np

from risk_sac.jit import compiled
from risk_sac.scenario.limits import Limits
from risk_sac.sim.paths import Path
from risk_sac.types import Floats

GRID_M = 0.5
BODY_M = 4.6  # SUMO turns a body while it passes a corner of the lane, over the body's own length
AHEAD_M = 5.0  # so early braking makes way for a bend; more than BODY_M, or a bend is not seen whole as it begins
NO_BEND_PER_M = 1e-6


@dataclass(frozen=True, slots=True)
class Bends:
    """Lists over the stations 0, GRID_M, 2·GRID_M … of a path; lists, because a step reads single numbers."""

    curvature_per_m: list[float]  # amount of the curvature there
    ahead_per_m: list[float]  # the largest from there until AHEAD_M on
    cap_mps: list[float]  # speed from which all bends ahead can be driven as planned

    def index(self, station_m: float) -> int:
        """Where a station is in the lists; beyond the path's ends, its ends."""
        return min(max(int(station_m / GRID_M), 0), len(self.cap_mps) - 1)


def bends(path: Path, limits: Limits) -> Bends:
    """The bends of a path, and how fast they can be approached under limits.

    v(s)² = min over s' ≥ s of  a / κ(s') + 2 b (s' - s),   a the planned cornering, b the braking left beside it
    """
    profile = _profile(path.station_m, path.heading_rad, limits.cornering_mps2, limits.approach_mps2)
    curvature, ahead, cap = (values.tolist() for values in profile)
    return Bends(curvature, ahead, cap)


@compiled
def _profile(station: Floats, heading: Floats, cornering: float, braking: float) -> tuple[Floats, Floats, Floats]:
    n = int(station[-1] / GRID_M) + 1
    curvature, ahead, cap = np.zeros(n), np.empty(n), np.empty(n)
    for i in range(1, len(station)):
        turn = (heading[i] - heading[i - 1] + math.pi) % (2 * math.pi) - math.pi
        for k in range(math.ceil(station[i] / GRID_M), min(math.ceil((station[i] + BODY_M) / GRID_M), n)):
            curvature[k] += turn / BODY_M
    curvature = np.abs(curvature)
    reachable = np.inf  # square of the speed from which the next station's cap can be braked to
    for k in range(n - 1, -1, -1):
        ahead[k] = curvature[k : k + int(AHEAD_M / GRID_M) + 1].max()
        square = min(cornering / max(ahead[k], NO_BEND_PER_M), reachable)
        cap[k] = math.sqrt(square)
        reachable = square + 2 * braking * GRID_M
    return curvature, ahead, cap
