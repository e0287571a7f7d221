"""Areas of the ground as compiled code needs them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.jit import compiled
from risk_sac.scenario.ground import Area
from risk_sac.types import Floats


class Sides(NamedTuple):
    """Sides of several areas, as compiled code needs them."""

    sides: Floats  # k x 3: nx, ny, c
    first: NDArray[np.int64]  # one more than there are areas: the first side of each, and k


def sides_of(areas: Sequence[Area]) -> Sides:
    """The sides of areas, one after the other."""
    sides = np.array([side for area in areas for side in area.sides], dtype=np.float64).reshape(-1, 3)
    return Sides(sides, np.cumsum([0, *(len(area.sides) for area in areas)]))


@compiled
def within(areas: Sides, x_m: float, y_m: float, margin_m: float = 0.0) -> bool:
    """Whether a point lies in any of the areas, or no further than `margin_m` outside one."""
    for area in range(len(areas.first) - 1):
        here = True
        for k in range(areas.first[area], areas.first[area + 1]):
            if areas.sides[k, 0] * x_m + areas.sides[k, 1] * y_m > areas.sides[k, 2] + margin_m:
                here = False
                break
        if here:
            return True
    return False
