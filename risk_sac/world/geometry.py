"""Oriented boxes seen from the ego: overlap, gap, sweep, line of sight.

Everything the risk measures need is expressed once per frame in the ego's frame (`relative_view`):
x ahead of the ego's centre, y to its left. There the ego is an axis-aligned box at the origin, which
makes the separating-axis test (Gottschalk et al. 1996) four rows of one array.
"""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, VX, VY, WIDTH, Bools, Floats, Frame, X, Y

NO_MOTION = 1e-9  # m/s or m; keeps the sweeps' divisions finite, far below anything that matters
Pose = tuple[float, float, float]  # x, y, heading of a body's centre


class Size(NamedTuple):
    """Half the length and half the width of a body."""

    half_length: float
    half_width: float


class RelativeView(NamedTuple):
    """View of the `n` other actors in the ego's frame."""

    x: Floats
    y: Floats
    vx: Floats  # relative velocity: the other's minus the ego's
    vy: Floats
    cos: Floats  # of the heading relative to the ego's
    sin: Floats
    half_length: Floats
    half_width: Floats
    ego_vx: float  # the ego's own velocity along its axes
    ego_vy: float
    ego_half_length: float
    ego_half_width: float
    separation: Floats  # `4 x n`: signed distance of the centres along each separating axis
    reach: Floats  # `4 x n`: sum of both boxes' half extents along that axis
    gap: Floats
    """Distance between the bodies, 0 when they touch."""
    overlap: Bools
    """Whether the bodies touch or overlap (separating-axis theorem, exact)."""


def relative_view(frame: Frame) -> RelativeView:
    """Expresses every other actor of `frame` in the ego's frame."""
    return frame_view(frame.state)


@compiled
def frame_view(state: Floats) -> RelativeView:
    """`relative_view` of a frame's state.

    The separating axes are the ego's x and y, then the other's long and cross axis.
    """
    n = state.shape[1] - 1
    others = np.empty((8, n))
    x, y, vx, vy = others[0], others[1], others[2], others[3]
    cos, sin, half_length, half_width = others[4], others[5], others[6], others[7]
    cos_ego, sin_ego = math.cos(state[HEADING, 0]), math.sin(state[HEADING, 0])
    ego_a, ego_b = state[LENGTH, 0] / 2, state[WIDTH, 0] / 2
    separation, reach = np.empty((4, n)), np.empty((4, n))
    gap, overlap = np.empty(n), np.empty(n, dtype=np.bool_)
    for i in range(n):
        dx, dy = state[X, i + 1] - state[X, 0], state[Y, i + 1] - state[Y, 0]
        dvx, dvy = state[VX, i + 1] - state[VX, 0], state[VY, i + 1] - state[VY, 0]
        turn = state[HEADING, i + 1] - state[HEADING, 0]
        x[i], y[i] = dx * cos_ego + dy * sin_ego, dy * cos_ego - dx * sin_ego
        vx[i], vy[i] = dvx * cos_ego + dvy * sin_ego, dvy * cos_ego - dvx * sin_ego
        cos[i], sin[i] = math.cos(turn), math.sin(turn)
        half_length[i], half_width[i] = state[LENGTH, i + 1] / 2, state[WIDTH, i + 1] / 2
        c, s, a, b = abs(cos[i]), abs(sin[i]), half_length[i], half_width[i]
        separation[0, i] = x[i]
        separation[1, i] = y[i]
        separation[2, i] = x[i] * cos[i] + y[i] * sin[i]
        separation[3, i] = y[i] * cos[i] - x[i] * sin[i]
        reach[0, i] = ego_a + a * c + b * s
        reach[1, i] = ego_b + a * s + b * c
        reach[2, i] = a + ego_a * c + ego_b * s
        reach[3, i] = b + ego_a * s + ego_b * c
        overlap[i] = True
        for axis in range(4):
            overlap[i] &= abs(separation[axis, i]) <= reach[axis, i]
        gap[i] = 0.0 if overlap[i] else _distance(x[i], y[i], cos[i], sin[i], a, b, ego_a, ego_b)
    ego_vx = state[VX, 0] * cos_ego + state[VY, 0] * sin_ego
    ego_vy = state[VY, 0] * cos_ego - state[VX, 0] * sin_ego
    return RelativeView(
        x, y, vx, vy, cos, sin, half_length, half_width, ego_vx, ego_vy, ego_a, ego_b, separation, reach, gap, overlap
    )


@compiled
def _distance(x: float, y: float, cos: float, sin: float, a: float, b: float, ego_a: float, ego_b: float) -> float:
    """Computes the distance of two bodies that do not overlap.

    The other's half length and width are `a` and `b`, at (x, y) in the ego's frame.
    """
    squared = math.inf
    for along in (-1.0, 1.0):
        for across in (-1.0, 1.0):
            px, py = along * a, across * b
            squared = min(squared, _outside(x + px * cos - py * sin, y + px * sin + py * cos, ego_a, ego_b))
            px, py = along * ego_a - x, across * ego_b - y
            squared = min(squared, _outside(px * cos + py * sin, py * cos - px * sin, a, b))
    return math.sqrt(squared)


@compiled
def _outside(x: float, y: float, half_length: float, half_width: float) -> float:
    """Squared distance from a point to a box about the origin."""
    along, across = max(abs(x) - half_length, 0.0), max(abs(y) - half_width, 0.0)
    return along * along + across * across


@compiled
def along_axes(vx: float, vy: float, cos: float, sin: float) -> tuple[float, float, float, float]:
    """Velocity along each of the separating axes.

    Compiled code copies a whole view slowly, so it takes numbers.
    """
    return vx, vy, vx * cos + vy * sin, vy * cos - vx * sin


@compiled
def time_to_contact(view: RelativeView) -> Floats:
    """Computes the time to contact at constant velocity, `n`, s; or inf.

    Swept as oriented boxes, crossing and oncoming bodies count as much as a leader in the same lane, of which it is
    gap / closing speed (Hayward 1972).
    On each separating axis the overlap lasts from t_in to t_out; bodies touch from the largest t_in on,
    provided it is no later than the smallest t_out.
    """
    n = len(view.x)
    ttc = np.empty(n)
    for i in range(n):
        enter, leave = -np.inf, np.inf
        speeds = along_axes(view.vx[i], view.vy[i], view.cos[i], view.sin[i])
        for axis in range(4):
            speed = speeds[axis]
            if abs(speed) < NO_MOTION:
                speed = NO_MOTION
            centre, half = -view.separation[axis, i] / speed, view.reach[axis, i] / abs(speed)
            enter, leave = max(enter, centre - half), min(leave, centre + half)
        ttc[i] = np.inf if enter > leave or leave < 0.0 else max(enter, 0.0)
    return ttc


@compiled
def corners(view: RelativeView) -> tuple[Floats, Floats]:
    """Computes others' corners in the ego's frame, two arrays `4 x n`.

    They go counter-clockwise from the front left.
    """
    n = len(view.x)
    corner_x, corner_y = np.empty((4, n)), np.empty((4, n))
    for i in range(n):
        for k, (along, across) in enumerate(((1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))):
            a, b = along * view.half_length[i], across * view.half_width[i]
            corner_x[k, i] = view.x[i] + a * view.cos[i] - b * view.sin[i]
            corner_y[k, i] = view.y[i] + a * view.sin[i] + b * view.cos[i]
    return corner_x, corner_y


@compiled
def line_of_sight(view: RelativeView, occludes: Bools) -> Bools:
    """Whether the ego's centre sees a body's centre or corner, `n`.

    Args:
      view: the scene.
      occludes: `n`; which bodies block the view. A body never hides itself.
    """
    n = len(view.x)
    corner_x, corner_y = corners(view)
    seen = np.zeros(n, dtype=np.bool_)
    for i in range(n):
        for k in range(5):
            px, py = (view.x[i], view.y[i]) if k == 4 else (corner_x[k, i], corner_y[k, i])
            blocked = False
            for wall in range(n):
                if wall != i and occludes[wall] and _crosses(view, wall, px, py):
                    blocked = True
                    break
            if not blocked:
                seen[i] = True
                break
    return seen


class Sight(NamedTuple):
    """Limits of a sensor at the ego's centre."""

    reach_m: float
    half_view_rad: float  # to either side of the ego's heading
    occlusion: bool  # whether vehicles hide what stands behind them
    unlit_m: float = math.inf  # the reach to what carries no lights


@compiled
def in_sight(view: RelativeView, vehicle: Bools, sight: Sight) -> Bools:
    """See `bodies_in_sight`; all vehicles conceal and carry lights, and pedestrians do neither."""
    return bodies_in_sight(view, vehicle, vehicle, sight)


@compiled
def bodies_in_sight(view: RelativeView, conceals: Bools, lit: Bools, sight: Sight) -> Bools:
    """Returns which of `n` others are in reach, in view, not hidden.

    Bodies that conceal hide what is behind them; those without lights are seen less far at night.
    """
    seen = line_of_sight(view, conceals) if sight.occlusion else np.ones(len(view.x), dtype=np.bool_)
    for i in range(len(seen)):
        x, y = view.x[i], view.y[i]
        reach_m = sight.reach_m if lit[i] else min(sight.reach_m, sight.unlit_m)
        if x * x + y * y > reach_m * reach_m or abs(math.atan2(y, x)) > sight.half_view_rad:
            seen[i] = False
    return seen


@compiled
def _crosses(view: RelativeView, wall: int, px: float, py: float) -> bool:
    """Whether a body blocks the ego centre's ray to (px, py)."""
    cos, sin = view.cos[wall], view.sin[wall]
    ray_x, ray_y = px * cos + py * sin, py * cos - px * sin
    if abs(ray_x) < NO_MOTION:
        ray_x = NO_MOTION
    if abs(ray_y) < NO_MOTION:
        ray_y = NO_MOTION
    middle_x, half_x = view.separation[2, wall] / ray_x, view.half_length[wall] / abs(ray_x)
    middle_y, half_y = view.separation[3, wall] / ray_y, view.half_width[wall] / abs(ray_y)
    enter, leave = max(middle_x - half_x, middle_y - half_y), min(middle_x + half_x, middle_y + half_y)
    return bool(enter < leave and enter < 1.0 and leave > 0.0)


@compiled
def touches(pose0: Pose, size0: Size, pose1: Pose, size1: Size) -> bool:
    """Whether two boxes overlap by separating axes; circles first exclude most pairs."""
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
def overlapping_pairs(state: Floats) -> list[tuple[int, int]]:
    """Returns pairs i < j of actors whose bodies touch or overlap."""
    pairs = [(0, 0) for _ in range(0)]  # an empty list whose type the compiler can tell
    for i in range(state.shape[1]):
        for j in range(i + 1, state.shape[1]):
            if touches(pose_of(state, i), size_of(state, i), pose_of(state, j), size_of(state, j)):
                pairs.append((i, j))
    return pairs


@compiled
def pose_of(state: Floats, actor: int) -> Pose:
    """Pose of an actor in a frame's state."""
    return state[X, actor], state[Y, actor], state[HEADING, actor]


@compiled
def size_of(state: Floats, actor: int) -> Size:
    """Size of an actor in a frame's state."""
    return Size(state[LENGTH, actor] / 2, state[WIDTH, actor] / 2)


ZONE_MARGIN_M = 0.05  # a contact this close to an edge lies on it


def contact_point(view: RelativeView) -> tuple[float, float]:
    """Computes the middle of all corners that lie in the other box."""
    margin = ZONE_MARGIN_M
    a, b = view.ego_half_length, view.ego_half_width
    corner_x, corner_y = (c[:, 0] for c in corners(view))
    theirs = (np.abs(corner_x) <= a + margin) & (np.abs(corner_y) <= b + margin)
    own_x, own_y = np.array([a, -a, -a, a]), np.array([b, b, -b, -b])
    dx, dy = own_x - view.x[0], own_y - view.y[0]
    along, across = dx * view.cos[0] + dy * view.sin[0], dy * view.cos[0] - dx * view.sin[0]
    ours = (np.abs(along) <= view.half_length[0] + margin) & (np.abs(across) <= view.half_width[0] + margin)
    points_x = np.concatenate((corner_x[theirs], own_x[ours]))
    points_y = np.concatenate((corner_y[theirs], own_y[ours]))
    if len(points_x) == 0:  # edges cross without a corner inside: the bodies' centres tell the place
        return float(np.clip(view.x[0], -a, a)), float(np.clip(view.y[0], -b, b))
    return float(np.clip(points_x.mean(), -a, a)), float(np.clip(points_y.mean(), -b, b))


def zone(x: float, y: float, half_length: float, half_width: float) -> str:
    """Returns a point's side of a body; corners are front or rear."""
    depth = {
        "front": half_length - x,
        "rear": half_length + x,
        "left": half_width - y + ZONE_MARGIN_M,
        "right": half_width + y + ZONE_MARGIN_M,
    }
    return min(depth, key=lambda side: depth[side])
