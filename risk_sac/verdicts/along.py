"""Another body as seen along the ego's path, which may bend."""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.jit import compiled
from risk_sac.types import Floats
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.path import Path, project


class Along(NamedTuple):
    """Another body as seen along the ego's path."""

    gap_m: float  # from the ego's front to the other's rear, below 0 alongside and behind
    behind_m: float  # from the other's front to the ego's rear
    ttc_s: float  # along the path; inf if it is not ahead, or the ego does not close in
    across_m: float  # of its centre from the ego's path, positive to the left
    turn_rad: float  # its heading relative to the path, full turns not taken off
    speed_mps: float  # along the path
    aside_s: float  # until the sides touch, as the two move across now; inf if they do not come nearer


@compiled
def along(path: Path, first: int, s: float, speed: float, half_length: float, half_width: float, other: Body) -> Along:
    """Places a body along the ego's path.

    Args:
      path: of the ego.
      first: the last of its points that the ego has passed.
      s: where on it the ego is.
      speed: of the ego.
      half_length: of the ego.
      half_width: of the ego.
      other: the body.
    """
    other_s, across, heading = project(path, first, other.x, other.y)
    turn = other.heading - heading
    reach = half_length + abs(math.cos(turn)) * other.half_length + abs(math.sin(turn)) * other.half_width
    gap, behind = other_s - s - reach, s - other_s - reach
    speed_along = other.vx * math.cos(heading) + other.vy * math.sin(heading)
    closing = speed - speed_along
    ttc = gap / closing if gap > 0.0 and closing > 0.0 else math.inf
    beside = half_width + abs(math.cos(turn)) * other.half_width + abs(math.sin(turn)) * other.half_length
    room = max(abs(across) - beside, 0.0)
    coming = math.copysign(1.0, across) * (other.vx * math.sin(heading) - other.vy * math.cos(heading))
    aside = room / coming if coming > 0.0 else math.inf
    return Along(gap, behind, ttc, across, turn, speed_along, aside)


class AlongSeries(NamedTuple):
    """`Along` of every frame, `T` of each."""

    gap_m: Floats
    behind_m: Floats
    ttc_s: Floats
    across_m: Floats
    turn_rad: Floats
    speed_mps: Floats
    aside_s: Floats


@compiled
def along_series(
    path: Path,
    speed: Floats,
    half_length: float,
    half_width: float,
    x: Floats,
    y: Floats,
    heading: Floats,
    vx: Floats,
    vy: Floats,
    other_half_length: float,
    other_half_width: float,
) -> AlongSeries:
    """Places a body along the ego's path frame by frame; the path has a point per frame."""
    rows = np.empty((7, len(speed)))
    for t in range(len(speed)):
        other = Body(x[t], y[t], heading[t], vx[t], vy[t], other_half_length, other_half_width)
        seen = along(path, t, path.s[t], speed[t], half_length, half_width, other)
        rows[0, t], rows[1, t], rows[2, t] = seen.gap_m, seen.behind_m, seen.ttc_s
        rows[3, t], rows[4, t], rows[5, t], rows[6, t] = seen.across_m, seen.turn_rad, seen.speed_mps, seen.aside_s
    return AlongSeries(rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], rows[6])
