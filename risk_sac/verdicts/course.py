"""Whether two bodies touch, now or if both keep on as they are."""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.jit import compiled
from risk_sac.types import Floats
from risk_sac.verdicts.path import Path, pose_at

HORIZON_S = 4.0  # nobody foresees further
LOOK_S = 0.05  # between two looks at what is foreseen; at 30 m/s of closing 1.5 m, less than a car is long
CORRIDOR_M = 0.375  # the ego's corridor is this much wider than itself to either side


class Body(NamedTuple):
    """An oriented box on the move."""

    x: float
    y: float
    heading: float
    vx: float
    vy: float
    half_length: float
    half_width: float


@compiled
def touches(
    x0: float,
    y0: float,
    heading0: float,
    half_length0: float,
    half_width0: float,
    x1: float,
    y1: float,
    heading1: float,
    half_length1: float,
    half_width1: float,
) -> bool:
    """Whether two oriented boxes overlap (separating axes; circles around both first: most pairs are far apart)."""
    dx, dy = x1 - x0, y1 - y0
    reach = half_length0 + half_width0 + half_length1 + half_width1
    if dx * dx + dy * dy > reach * reach:
        return False
    cos0, sin0, cos1, sin1 = math.cos(heading0), math.sin(heading0), math.cos(heading1), math.sin(heading1)
    c, s = abs(cos0 * cos1 + sin0 * sin1), abs(sin1 * cos0 - cos1 * sin0)
    return bool(
        abs(dx * cos0 + dy * sin0) <= half_length0 + half_length1 * c + half_width1 * s
        and abs(dy * cos0 - dx * sin0) <= half_width0 + half_length1 * s + half_width1 * c
        and abs(dx * cos1 + dy * sin1) <= half_length1 + half_length0 * c + half_width0 * s
        and abs(dy * cos1 - dx * sin1) <= half_width1 + half_length0 * s + half_width0 * c
    )


@compiled
def time_to_touch(
    path: Path, s: float, speed: float, half_length: float, half_width: float, other: Body, horizon: float
) -> float:
    """Time until the ego, keeping its speed along its path, touches a body that keeps its velocity, s; or inf.

    Args:
      path: of the ego.
      s: where on it the ego is.
      speed: of the ego.
      half_length: of the ego.
      half_width: of the ego, or of its corridor.
      other: the other body.
      horizon: how far to look ahead.
    """
    for look in range(round(horizon / LOOK_S) + 1):
        t = look * LOOK_S
        x, y, heading = pose_at(path, s + speed * t)
        if touches(
            x,
            y,
            heading,
            half_length,
            half_width,
            other.x + other.vx * t,
            other.y + other.vy * t,
            other.heading,
            other.half_length,
            other.half_width,
        ):
            return t
    return math.inf


@compiled
def entry_distance(
    path: Path,
    first: int,
    reach_s: float,
    half_length: float,
    half_width: float,
    other_x: Floats,
    other_y: Floats,
    other_heading: Floats,
    other_half_length: float,
    other_half_width: float,
) -> tuple[float, float]:
    """Metres that a body has to go until it is in the ego's corridor, and where along the ego's path that is.

    Args:
      path: of the ego; its corridor is what the ego's body sweeps from the `first` point on, up to `reach_s`.
      first: the ego's point on it.
      reach_s: metres along the path, where the corridor ends.
      half_length: of the ego.
      half_width: of the corridor.
      other_x: `k` poses the body goes through, the present one first.
      other_y: the same, north.
      other_heading: the same.
      other_half_length: of the body.
      other_half_width: of the body.

    Returns:
      (inf, inf) if none of the poses is in the corridor.
    """
    start = path.s[first]
    spacing = half_length
    count = max(1, math.ceil((reach_s - start) / spacing) + 1)
    corridor = np.empty((count, 3))
    for k in range(count):
        corridor[k] = pose_at(path, start + k * spacing)
    gone = 0.0
    for j in range(len(other_x)):
        if j:
            gone += math.hypot(other_x[j] - other_x[j - 1], other_y[j] - other_y[j - 1])
        for k in range(count):
            if touches(
                corridor[k, 0],
                corridor[k, 1],
                corridor[k, 2],
                half_length,
                half_width,
                other_x[j],
                other_y[j],
                other_heading[j],
                other_half_length,
                other_half_width,
            ):
                return gone, start + k * spacing
    return math.inf, math.inf
