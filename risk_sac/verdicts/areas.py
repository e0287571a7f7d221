"""Points and areas, whole columns at a time."""

from collections.abc import Sequence

import numpy as np

from risk_sac.scenario.ground import Area
from risk_sac.types import Bools, Floats

KERB_STEPS = 10  # looks within the time ahead


def inside(areas: Sequence[Area], x_m: Floats, y_m: Floats, margin_m: float = 0.0) -> Bools:
    """Which points lie in any of the areas, or no further than `margin_m` outside one."""
    found = np.zeros(np.shape(x_m), dtype=np.bool_)
    for area in areas:
        here = np.ones(np.shape(x_m), dtype=np.bool_)
        for nx, ny, c in area.sides:
            here &= nx * x_m + ny * y_m <= c + margin_m
        found |= here
    return found


def soon_inside(
    areas: Sequence[Area], x_m: Floats, y_m: Floats, vx_mps: Floats, vy_mps: Floats, ahead_s: float
) -> Bools:
    """Which points are in one of the areas now or, keeping their velocity, within `ahead_s`."""
    t = np.linspace(0.0, ahead_s, KERB_STEPS + 1)[:, None]
    soon: Bools = np.any(inside(areas, x_m + t * vx_mps, y_m + t * vy_mps), axis=0)
    return soon
