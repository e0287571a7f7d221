"""Paths drawn by hand: a straight, an arc, a straight."""

import math

import numpy as np

from risk_sac.sim.paths import Path, path_through

STRAIGHT_M = 60.0  # before the arc
AFTER_M = 120.0
LIMIT_MPS = 13.89


def road(
    radius_m: float | None = None, *, left: bool = True, turn_rad: float = math.pi / 2, piece_m: float = 1.0
) -> Path:
    """Path along x that turns after `STRAIGHT_M`; straight without a radius.

    Args:
      radius_m: of the arc.
      left: which way it turns.
      turn_rad: by how much.
      piece_m: length of a straight piece of the polyline.
    """
    arc_m = 0.0 if radius_m is None else turn_rad * radius_m
    pieces = max(round(arc_m / piece_m), 1) if arc_m else 0
    middles = (np.arange(pieces) + 0.5) / max(pieces, 1)
    heading = np.concatenate(([0.0], turn_rad * middles, [turn_rad if arc_m else 0.0])) * (1 if left else -1)
    length = np.concatenate(([STRAIGHT_M], np.full(pieces, arc_m / max(pieces, 1)), [AFTER_M]))
    station, x, y = (
        np.concatenate(([0.0], np.cumsum(v))) for v in (length, length * np.cos(heading), length * np.sin(heading))
    )
    return path_through(x, y, station, np.append(heading, heading[-1]), np.full(len(x), LIMIT_MPS))


def arc_m(radius_m: float, turn_rad: float = math.pi / 2) -> tuple[float, float]:
    """Where the arc of `road` begins and ends."""
    return STRAIGHT_M, STRAIGHT_M + radius_m * turn_rad
