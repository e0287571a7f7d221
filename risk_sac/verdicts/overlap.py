"""Finds bodies that overlap in a record before the contact; none should."""

from typing import NamedTuple

import numpy as np

from risk_sac.geometry import overlapping_pairs
from risk_sac.jit import compiled
from risk_sac.types import HEADING, LENGTH, WIDTH, Floats, X, Y
from risk_sac.verdicts.evidence import Evidence


class Overlap(NamedTuple):
    """Two bodies that overlap in one frame."""

    time_s: float  # from the adversaries' release; negative before it
    first: str
    second: str


def overlaps_before_contact(evidence: Evidence) -> list[Overlap]:
    """Finds the overlapping bodies of each frame, without the ego's contact in the last."""
    e = evidence
    pairs = _overlaps(e.x_m, e.y_m, e.heading_rad, e.length_m, e.width_m)
    return [Overlap(float(e.time_s[frame]), e.ids[i], e.ids[j]) for frame, i, j in pairs]


@compiled
def _overlaps(x: Floats, y: Floats, heading: Floats, length: Floats, width: Floats) -> list[tuple[int, int, int]]:
    """Finds frame and columns of each overlap of two bodies.

    `x`, `y` and `heading` are `T x n`, NaN where an actor has left.
    """
    steps, n = x.shape
    found = [(0, 0, 0) for _ in range(0)]  # an empty list with a type that the compiler infers
    state = np.zeros((WIDTH + 1, n))
    state[LENGTH], state[WIDTH] = length, width
    for frame in range(steps):
        state[X], state[Y], state[HEADING] = x[frame], y[frame], heading[frame]
        for i, j in overlapping_pairs(state):
            if i > 0 or frame < steps - 1:
                found.append((frame, i, j))
    return found
