"""Areas of the ground as compiled code needs them."""

import math
from collections.abc import Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.layout import Area
from risk_sac.world.geometry import Pose, Size, touches
from risk_sac.world.jit import compiled
from risk_sac.world.types import Bools, Floats


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
    """Whether a point lies in an area or within `margin_m` of it."""
    for area in range(len(areas.first) - 1):
        here = True
        for k in range(areas.first[area], areas.first[area + 1]):
            if areas.sides[k, 0] * x_m + areas.sides[k, 1] * y_m > areas.sides[k, 2] + margin_m:
                here = False
                break
        if here:
            return True
    return False


STANDING_M = 1e-6  # two points nearer than this are one


class Path(NamedTuple):
    """Path of `m` points, at least one."""

    x: Floats
    y: Floats
    heading: Floats  # of the body, without jumps of 2π
    s: Floats  # metres along the path, never falling


def recorded_path(x: Floats, y: Floats, heading: Floats) -> Path:
    """Builds a path through a body's positions, with its recorded headings."""
    steps = np.hypot(np.diff(x), np.diff(y))
    return Path(
        np.ascontiguousarray(x), np.ascontiguousarray(y), np.unwrap(heading), np.concatenate(([0.0], np.cumsum(steps)))
    )


def polyline(x: Floats, y: Floats, heading_rad: float = 0.0) -> Path:
    """Builds a path through points, with headings along it.

    Args:
      x: `m` points, the ego's centre first.
      y: the same for y.
      heading_rad: of a path of one point.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if len(x) < 2:
        return Path(x, y, np.array([heading_rad]), np.zeros(1))
    along = np.arctan2(np.diff(y), np.diff(x))
    return recorded_path(x, y, np.concatenate((along[:1], along)))


@compiled
def pose_at(path: Path, s: float) -> Pose:
    """Computes the body's pose after `s` metres: x, y, heading."""
    last = len(path.s) - 1
    if s >= path.s[last] or last == 0:
        beyond, h = s - path.s[last], path.heading[last]
        return path.x[last] + beyond * math.cos(h), path.y[last] + beyond * math.sin(h), h
    if s <= path.s[0]:
        beyond, h = s - path.s[0], path.heading[0]
        return path.x[0] + beyond * math.cos(h), path.y[0] + beyond * math.sin(h), h
    k = np.searchsorted(path.s, s, side="right")
    share = (s - path.s[k - 1]) / max(path.s[k] - path.s[k - 1], STANDING_M)
    return (
        path.x[k - 1] + share * (path.x[k] - path.x[k - 1]),
        path.y[k - 1] + share * (path.y[k] - path.y[k - 1]),
        path.heading[k - 1] + share * (path.heading[k] - path.heading[k - 1]),
    )


@compiled
def project(path: Path, first: int, x: float, y: float) -> tuple[float, float, float]:
    """Projects a position onto the path, from its `first` point on.

    Returns metres along, metres to the left and the heading there. The straight extensions count, also the one behind
    the `first` point.
    """
    last = len(path.s) - 1
    h = path.heading[first]
    along = (x - path.x[first]) * math.cos(h) + (y - path.y[first]) * math.sin(h)
    across = (y - path.y[first]) * math.cos(h) - (x - path.x[first]) * math.sin(h)
    best, s, d, heading = math.inf, path.s[first] + along, across, h
    if along <= 0.0:
        best = across * across
    h_end = path.heading[last]
    along = (x - path.x[last]) * math.cos(h_end) + (y - path.y[last]) * math.sin(h_end)
    across = (y - path.y[last]) * math.cos(h_end) - (x - path.x[last]) * math.sin(h_end)
    if along >= 0.0 and across * across < best:
        best, s, d, heading = across * across, path.s[last] + along, across, h_end
    for k in range(first, last):
        dx, dy = path.x[k + 1] - path.x[k], path.y[k + 1] - path.y[k]
        step = path.s[k + 1] - path.s[k]
        if step < STANDING_M:
            continue
        share = min(max(((x - path.x[k]) * dx + (y - path.y[k]) * dy) / (step * step), 0.0), 1.0)
        off_x, off_y = x - path.x[k] - share * dx, y - path.y[k] - share * dy
        squared = off_x * off_x + off_y * off_y
        if squared < best:
            best = squared
            s = path.s[k] + share * step
            side = dx * off_y - dy * off_x
            d = math.copysign(math.sqrt(squared), side)
            heading = path.heading[k] + share * (path.heading[k + 1] - path.heading[k])
    return s, d, heading


HORIZON_S = 4.0  # look-ahead of every driver
LOOK_S = 0.05  # between two looks at what is foreseen; at 30 m/s of closing 1.5 m, less than a car is long
CORRIDOR_M = 0.375  # the ego's corridor is this much wider than itself to either side
NEAR_S = 1.0  # two that pass a place no further apart in time are in each other's way
RESPONDS_S = 1.15  # UN R157, Annex 3: 0.4 s to perceive, 0.75 s to react
YIELDING_MPS2 = 3.4  # what a driver brakes with to stop at leisure


F = TypeVar("F", float, Floats)  # one number, or one for each frame


class MovingBox(NamedTuple, Generic[F]):
    """Oriented box with a velocity: now, or in each of `T` frames."""

    x: F
    y: F
    heading: F
    vx: F
    vy: F
    size: Size


@compiled
def with_margin(size: Size) -> Size:
    """Adds the corridor's margin to either side of an ego's size."""
    return Size(size.half_length, size.half_width + CORRIDOR_M)


@compiled
def at(motion: MovingBox[Floats], t: int) -> MovingBox[float]:
    """The body in one frame."""
    return MovingBox(motion.x[t], motion.y[t], motion.heading[t], motion.vx[t], motion.vy[t], motion.size)


@compiled
def time_to_touch(path: Path, s: float, speed: float, size: Size, other: MovingBox[float], horizon: float) -> float:
    """Computes the time until the ego touches a body, s; else inf.

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
def time_to_meet(path: Path, s: float, speed: float, size: Size, walker: MovingBox[float]) -> float:
    """Computes the time until the ego reaches a pedestrian's way, s.

    It is inf if the ego could stop later.
    The pedestrian keeps its velocity, and is at the place no more than 1 s before or after the ego: it may stop, turn
    back or run. A driver need not act earlier than its time to stop at leisure, 1.15 s + v / 3.4 m/s² and 4 s at most.

    Choice: 1 s between the two. See `time_to_touch` for the arguments.
    """
    walks_mps = math.hypot(walker.vx, walker.vy)
    heading = math.atan2(walker.vy, walker.vx) if walks_mps > 0.0 else walker.heading
    way = Size(walker.size.half_length + walks_mps * NEAR_S, walker.size.half_width)
    swept = MovingBox(walker.x, walker.y, heading, walker.vx, walker.vy, way)
    return time_to_touch(path, s, speed, size, swept, min(RESPONDS_S + speed / YIELDING_MPS2, HORIZON_S))


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


WANDER_M = 0.375  # what a vehicle strays from its lane's centre without meaning anything
MARKING_S = 1.0  # a vehicle that strays further and reaches the ego's marking within this time is coming over
DANGER_TTC_S = 2.0
LEADER_BRAKES_MPS2 = 5.0


class BodyOnPath(NamedTuple, Generic[F]):
    """Another body along the ego's path: now, or in `T` frames."""

    gap_m: F  # from the ego's front to the other's rear, below 0 alongside and behind
    behind_m: F  # from the other's front to the ego's rear
    ttc_s: F  # along the path; inf if it is not ahead, or the ego does not close in
    across_m: F  # of its centre from the ego's path, positive to the left
    turn_rad: F  # its heading relative to the path, full turns not taken off
    speed_mps: F  # along the path
    reach_m: F  # of its body to either side of its centre, across the path
    nearing_mps: F  # its speed across, positive towards the path


@compiled
def along(path: Path, first: int, s: float, speed: float, size: Size, other: MovingBox[float]) -> BodyOnPath[float]:
    """Places a body along the ego's path, which may bend.

    The ego is at `s`; `first` is the last point of the path that it has passed.
    """
    other_s, across, heading = project(path, first, other.x, other.y)
    turn = other.heading - heading
    cos, sin, (half_length, half_width) = abs(math.cos(turn)), abs(math.sin(turn)), other.size
    reach = size.half_length + cos * half_length + sin * half_width
    gap, behind = other_s - s - reach, s - other_s - reach
    speed_along = other.vx * math.cos(heading) + other.vy * math.sin(heading)
    closing = speed - speed_along
    ttc = gap / closing if gap > 0.0 and closing > 0.0 else math.inf
    nearing = math.copysign(1.0, across) * (other.vx * math.sin(heading) - other.vy * math.cos(heading))
    return BodyOnPath(gap, behind, ttc, across, turn, speed_along, cos * half_width + sin * half_length, nearing)


def along_series(path: Path, speed: Floats, size: Size, other: MovingBox[Floats]) -> BodyOnPath[Floats]:
    """Places a body along the ego's path; the path has `T` points."""
    return BodyOnPath(*_along_rows(path, speed, size, other))


@compiled
def _along_rows(path: Path, speed: Floats, size: Size, other: MovingBox[Floats]) -> Floats:
    rows = np.empty((8, len(speed)))
    for t in range(len(speed)):
        for row, value in enumerate(along(path, t, path.s[t], speed[t], size, at(other, t))):
            rows[row, t] = value
    return rows


@compiled
def towards(across_m: float, offset_m: float, lane_width_m: float) -> float:
    """Computes a vehicle's offset from its lane's centre towards the ego, m.

    SUMO's offset jumps by a lane's width when the vehicle passes to the next lane; where it stands across the ego's
    path tells which lane's centre is meant. Without a recorded offset (NaN) that place alone decides. `across_m` is its
    distance from the ego's path, positive to the left, `offset_m` that from its lane's centre.
    """
    seen = lane_width_m - abs(across_m)
    if math.isnan(offset_m):
        return seen
    recorded = -offset_m if across_m > 0.0 else offset_m
    return recorded + lane_width_m * round((seen - recorded) / lane_width_m)


@compiled
def lane_conflict(
    other: BodyOnPath[float], speed_mps: float, offset_m: float, accel_mps2: float, lane_width_m: float, wary: bool
) -> tuple[bool, bool]:
    """Detects beginning and continuation of a conflict with a same-direction vehicle.

    A vehicle comes over if its body is beyond the marking of the ego's lane. It also does if it is more than 0.375 m
    off its own lane's centre towards the ego and reaches that marking within 1 s. The conflict begins when it does so
    alongside the ego or less than 2 s ahead. One with a leader begins when it brakes harder than 5 m/s², or is less
    than 2 s ahead. Choices: braking counts within 4 s of the ego's way; a conflict goes on while the ego closes in
    within 4 s. A vehicle that keeps its lane is in no conflict.

    `speed_mps` is the ego's, `accel_mps2` the vehicle's. To a wary driver a vehicle comes over whenever it is more than
    0.375 m off its lane's centre.
    """
    in_lane = abs(other.across_m) <= lane_width_m / 2
    off_m = towards(other.across_m, offset_m, lane_width_m)
    to_marking_m = lane_width_m / 2 - off_m - other.reach_m
    strays = in_lane or off_m > WANDER_M
    comes = in_lane or to_marking_m < 0.0 or (strays and (wary or to_marking_m <= MARKING_S * other.nearing_mps))
    alongside = other.gap_m <= 0.0 and other.behind_m <= 0.0
    near = 0.0 < other.gap_m <= HORIZON_S * speed_mps
    brakes = in_lane and near and accel_mps2 < -LEADER_BRAKES_MPS2
    begins = brakes or (comes and (alongside or other.ttc_s < DANGER_TTC_S))
    return begins, begins or (strays and other.ttc_s < HORIZON_S)


@compiled
def lane_conflicts(
    others: BodyOnPath[Floats], speed_mps: Floats, offset_m: Floats, accel_mps2: Floats, width_m: Floats, wary: bool
) -> tuple[Bools, Bools]:
    """`lane_conflict` in each of `T` frames."""
    begins, lasts = np.empty(len(speed_mps), dtype=np.bool_), np.empty(len(speed_mps), dtype=np.bool_)
    for t in range(len(speed_mps)):
        o = others
        other = BodyOnPath(
            o.gap_m[t],
            o.behind_m[t],
            o.ttc_s[t],
            o.across_m[t],
            o.turn_rad[t],
            o.speed_mps[t],
            o.reach_m[t],
            o.nearing_mps[t],
        )
        begins[t], lasts[t] = lane_conflict(other, speed_mps[t], offset_m[t], accel_mps2[t], width_m[t], wary)
    return begins, lasts
