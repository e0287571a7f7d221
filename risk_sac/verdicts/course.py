"""Whether two bodies touch, now or if both keep on as they are."""

import math
from typing import Generic, NamedTuple, TypeVar

from risk_sac.jit import compiled
from risk_sac.types import Floats
from risk_sac.verdicts.path import Path, Pose, pose_at

HORIZON_S = 4.0  # nobody foresees further
LOOK_S = 0.05  # between two looks at what is foreseen; at 30 m/s of closing 1.5 m, less than a car is long
CORRIDOR_M = 0.375  # the ego's corridor is this much wider than itself to either side


F = TypeVar("F", float, Floats)  # one number, or one for each frame


class Size(NamedTuple):
    """Half the length and half the width of a body."""

    half_length: float
    half_width: float

    def corridor(self) -> "Size":
        """What the ego takes up on its way, with a margin to either side."""
        return Size(self.half_length, self.half_width + CORRIDOR_M)


class Body(NamedTuple, Generic[F]):
    """An oriented box on the move: now, or in each of `T` frames."""

    x: F
    y: F
    heading: F
    vx: F
    vy: F
    size: Size


@compiled
def at(motion: Body[Floats], t: int) -> Body[float]:
    """The body in one frame."""
    return Body(motion.x[t], motion.y[t], motion.heading[t], motion.vx[t], motion.vy[t], motion.size)


@compiled
def touches(pose0: Pose, size0: Size, pose1: Pose, size1: Size) -> bool:
    """Whether two oriented boxes overlap (separating axes; circles around both first: most pairs are far apart)."""
    (x0, y0, heading0), (half_length0, half_width0) = pose0, size0
    (x1, y1, heading1), (half_length1, half_width1) = pose1, size1
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
def time_to_touch(path: Path, s: float, speed: float, size: Size, other: Body[float], horizon: float) -> float:
    """Time until the ego, keeping its speed along its path, touches a body that keeps its velocity, s; or inf.

    The ego is at `s` on its path; `size` is its own, or its corridor's.
    """
    for look in range(round(horizon / LOOK_S) + 1):
        t = look * LOOK_S
        pose = other.x + other.vx * t, other.y + other.vy * t, other.heading
        if touches(pose_at(path, s + speed * t), size, pose, other.size):
            return t
    return math.inf


@compiled
def entry_distance(
    path: Path, first: int, reach_s: float, size: Size, x: Floats, y: Floats, heading: Floats, other_size: Size
) -> tuple[float, float]:
    """Metres that a body has to go until it is in the ego's corridor, and where along the ego's path that is.

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
