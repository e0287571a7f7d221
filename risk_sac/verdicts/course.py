"""Whether two bodies touch, now or if both keep on as they are."""

import math
from typing import Generic, NamedTuple, TypeVar

from risk_sac.geometry import Size, touches
from risk_sac.jit import compiled
from risk_sac.types import Floats
from risk_sac.verdicts.path import Path, pose_at

HORIZON_S = 4.0  # look-ahead of every driver
LOOK_S = 0.05  # between two looks at what is foreseen; at 30 m/s of closing 1.5 m, less than a car is long
CORRIDOR_M = 0.375  # the ego's corridor is this much wider than itself to either side


F = TypeVar("F", float, Floats)  # one number, or one for each frame


class Body(NamedTuple, Generic[F]):
    """An oriented box on the move: now, or in each of `T` frames."""

    x: F
    y: F
    heading: F
    vx: F
    vy: F
    size: Size


@compiled
def with_margin(size: Size) -> Size:
    """Adds the corridor's margin to either side of an ego of this size."""
    return Size(size.half_length, size.half_width + CORRIDOR_M)


@compiled
def at(motion: Body[Floats], t: int) -> Body[float]:
    """The body in one frame."""
    return Body(motion.x[t], motion.y[t], motion.heading[t], motion.vx[t], motion.vy[t], motion.size)


@compiled
def time_to_touch(path: Path, s: float, speed: float, size: Size, other: Body[float], horizon: float) -> float:
    """Computes the time until the ego touches another body, s; inf if never.

    The ego keeps its speed along its path, the body its velocity.

    The ego is at `s` on its path; `size` is its own, or its corridor's. Looks at which the two are too far apart, even
    if they came straight towards each other, are left out.
    """
    reach = size.half_length + size.half_width + other.size.half_length + other.size.half_width
    nearer = (speed + math.hypot(other.vx, other.vy)) * LOOK_S  # from one look to the next, at most
    look, last = 0, round(horizon / LOOK_S)
    while look <= last:
        t = look * LOOK_S
        pose, own = (other.x + other.vx * t, other.y + other.vy * t, other.heading), pose_at(path, s + speed * t)
        apart = math.hypot(pose[0] - own[0], pose[1] - own[1]) - reach
        if apart <= nearer:
            if touches(own, size, pose, other.size):
                return t
            look += 1
        elif nearer * (last - look) < apart:
            return math.inf
        else:
            look += int(apart / nearer)
    return math.inf


@compiled
def entry_distance(
    path: Path, first: int, reach_s: float, size: Size, x: Floats, y: Floats, heading: Floats, other_size: Size
) -> tuple[float, float]:
    """Computes a body's way to the ego's corridor, and where it enters.

    The way is in metres, and so is the place, along the ego's path.

    Args:
      path: of the ego; its corridor is what the ego's body sweeps from the `first` point on, up to `reach_s`.
      first: the ego's point on it.
      reach_s: metres along the path, where the corridor ends.
      size: of the corridor.
      x: `k` poses the body goes through, the present one first.
      y: the same, north.
      heading: the same.
      other_size: of the body.

    Returns:
      (inf, inf) if none of the poses is in the corridor.
    """
    start = path.s[first]
    spacing = size.half_length
    count = max(1, math.ceil((reach_s - start) / spacing) + 1)
    corridor = [pose_at(path, start + k * spacing) for k in range(count)]
    gone = 0.0
    for j in range(len(x)):
        if j:
            gone += math.hypot(x[j] - x[j - 1], y[j] - y[j - 1])
        for k in range(count):
            if touches(corridor[k], size, (x[j], y[j], heading[j]), other_size):
                return gone, start + k * spacing
    return math.inf, math.inf
