"""Present conflicts with actors, and places that hide pedestrians.

The measures are those of `risk_sac.verdicts.conflict`; only what a record knows of the future is foreseen here: the
ego's path is given, and everything else goes on straight.
"""

import math
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from risk_sac.scenario.bodies import body_of
from risk_sac.scenario.layout import Area
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.verdicts.conflict import BRAKES_MPS2, FIRM_MPS2, KERB_S, SAME_WAY_COS
from risk_sac.verdicts.course import (
    CORRIDOR_M,
    HORIZON_S,
    NEAR_S,
    YIELDING_MPS2,
    MovingBox,
    Path,
    Sides,
    along,
    entry_distance,
    lane_conflict,
    pose_at,
    sides_of,
    time_to_meet,
    time_to_touch,
    with_margin,
    within,
)
from risk_sac.verdicts.evidence import KERB_STEPS, Ground
from risk_sac.world.geometry import Size
from risk_sac.world.jit import compiled
from risk_sac.world.types import ACCEL, HEADING, LENGTH, OFFSET, SPEED, VX, VY, WIDTH, Bools, Floats, X, Y

WAITING_M = 2.0  # of sidewalk at either end of a crossing, on which pedestrians wait
SPOT_M = 1.0  # between two places on a crossing that are looked at
LOOK_M = 0.5  # between two places on the path that may be on a crossing
CORNER = 0.99  # just inside the corner: a body does not hide itself
ALONG_COS = math.cos(math.radians(45.0))


class Crossings(NamedTuple):
    """Pedestrian crossings on a path."""

    entries: Floats  # k x 2: metres along the path at which it enters and leaves each
    spots: Floats  # m x 4: x, y, the crossing, and metres beside the corridor


def boxes_of(crossings: Sequence[Area]) -> Floats:
    """Computes crossings' boxes, `k x 6`: centre, longest side's direction, half sizes."""
    found = np.empty((len(crossings), 6))
    for row, area in zip(found, crossings, strict=True):
        corners = np.array(_corners(area))
        sides = np.roll(corners, -1, axis=0) - corners
        direction = sides[np.hypot(*sides.T).argmax()]
        direction /= np.hypot(*direction)
        along, across = corners @ direction, corners @ (-direction[1], direction[0])
        middle, aside = (along.max() + along.min()) / 2, (across.max() + across.min()) / 2
        x, y = middle * direction[0] - aside * direction[1], middle * direction[1] + aside * direction[0]
        row[:] = x, y, *direction, (along.max() - along.min()) / 2, (across.max() - across.min()) / 2
    return found


def _corners(area: Area) -> list[tuple[float, float]]:
    found = []
    for (ax, ay, a), (bx, by, b) in zip(area.sides, (*area.sides[1:], area.sides[0]), strict=True):
        cross = ax * by - ay * bx
        if abs(cross) > 1e-9:
            found.append(((a * by - b * ay) / cross, (ax * b - bx * a) / cross))
    return found


@compiled
def crossings_on(path: Path, from_m: float, to_m: float, boxes: Floats, half_width_m: float) -> Crossings:
    """Finds crossings on part of a path, with spots including waiting areas."""
    entries, count = np.empty((len(boxes), 2)), 0
    spots, filled = np.empty((64 * len(boxes), 4)), 0
    for k in range(len(boxes)):
        x, y, ux, uy, half_u, half_v = boxes[k]
        enters, leaves, at = math.nan, math.nan, from_m
        while at <= to_m:
            px, py, _ = pose_at(path, at)
            dx, dy = px - x, py - y
            if abs(dx * ux + dy * uy) <= half_u and abs(dy * ux - dx * uy) <= half_v:
                if math.isnan(enters):
                    enters = at
                leaves = at
            elif not math.isnan(enters):
                break
            at += max(LOOK_M, math.hypot(dx, dy) - half_u - half_v)
        if math.isnan(enters):
            continue
        mx, my, heading = pose_at(path, (enters + leaves) / 2)
        cos, sin = math.cos(heading), math.sin(heading)
        wx, wy, half = ux, uy, half_u
        if abs(cos * ux + sin * uy) > ALONG_COS:  # the path leads along its longest side
            wx, wy, half = -uy, ux, half_v
        half += WAITING_M
        entries[count] = enters, leaves
        steps = min(math.ceil(2.0 * half / SPOT_M), 63)
        for j in range(steps + 1):
            along = -half + 2.0 * half * j / steps
            sx, sy = x + along * wx, y + along * wy
            aside = abs((sy - my) * cos - (sx - mx) * sin) - half_width_m - CORRIDOR_M
            spots[filled] = sx, sy, float(count), max(aside, 0.0)
            filled += 1
        count += 1
    return Crossings(entries[:count], spots[:filled])


def concealing(codes: Iterable[int]) -> Bools:
    """Tells by body codes which bodies hide what is behind them."""
    return np.array([body_of(int(code)).conceals for code in codes], dtype=np.bool_)


@compiled
def walls_of(state: Floats, hides: Bools) -> Floats:
    """Lists the bodies that hide others behind them, `w x 6`.

    Columns are centre, cos and sin of the heading, and half sizes.
    """
    found, count = np.empty((len(hides), 6)), 0
    for i in range(len(hides)):
        if hides[i] and not math.isnan(state[X, i]):  # it has left
            heading = state[HEADING, i]
            found[count, 0], found[count, 1] = state[X, i], state[Y, i]
            found[count, 2], found[count, 3] = math.cos(heading), math.sin(heading)
            found[count, 4], found[count, 5] = state[LENGTH, i] / 2, state[WIDTH, i] / 2
            count += 1
    return found[:count]


@compiled
def is_in_view(walls: Floats, eye_x: float, eye_y: float, body: MovingBox[float]) -> bool:
    """Whether a corner or centre is visible, as in `risk_sac.world.geometry.line_of_sight`."""
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    for ahead, left in ((0.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        a, b = ahead * CORNER * body.size.half_length, left * CORNER * body.size.half_width
        if not is_hidden(walls, eye_x, eye_y, body.x + a * cos - b * sin, body.y + a * sin + b * cos):
            return True
    return False


@compiled
def is_hidden(walls: Floats, eye_x: float, eye_y: float, x: float, y: float) -> bool:
    """Tells whether a body lies between the eye and a place.

    One that stands on the place hides nothing.
    """
    for k in range(len(walls)):
        cos, sin, half_length, half_width = walls[k, 2], walls[k, 3], walls[k, 4], walls[k, 5]
        ex, ey = eye_x - walls[k, 0], eye_y - walls[k, 1]
        px, py = x - walls[k, 0], y - walls[k, 1]
        to_x, to_y = px * cos + py * sin, py * cos - px * sin
        if abs(to_x) <= half_length and abs(to_y) <= half_width:
            continue
        from_x, from_y = ex * cos + ey * sin, ey * cos - ex * sin
        enter, leave = 0.0, 1.0
        for start, end, half in ((from_x, to_x, half_length), (from_y, to_y, half_width)):
            step = end - start
            if abs(step) < 1e-9:
                if abs(start) > half:
                    enter = 2.0
                continue
            first, last = (-half - start) / step, (half - start) / step
            enter, leave = max(enter, min(first, last)), min(leave, max(first, last))
        if enter < leave:
            return True
    return False


AHEAD_M = 1.0  # between two foreseen poses
STANDING_MPS = 0.1
RED, UNCONTROLLED, YELLOW, GREEN_MINOR = b"ruyg"  # signals at which a driver is expected to stop, or to yield


class OnPath(NamedTuple):
    """The ego on its path."""

    path: Path
    first: int  # the last point that it has passed
    s: float
    speed_mps: float
    size: Size


class Street(NamedTuple):
    """Ground of an episode, as compiled code needs it."""

    roadway: Sides  # none: pedestrians are judged as if always on it
    walked: Sides  # roadway and crossings
    junctions: Sides
    boxes: Floats  # of the crossings, see `boxes_of`
    lane_width_m: float
    grip_mps2: float


def street_of(ground: Ground) -> Street:
    """Converts a ground."""
    areas = _areas_of(ground.roadway, ground.crossings, ground.junctions)
    return Street(*areas, ground.lane_width_m, ground.friction * GRAVITY_MPS2)


@lru_cache(maxsize=8)  # an episode's friction is its own, but many are at one place
def _areas_of(
    roadway: tuple[Area, ...], crossings: tuple[Area, ...], junctions: tuple[Area, ...]
) -> tuple[Sides, Sides, Sides, Floats]:
    return sides_of(roadway), sides_of(roadway + crossings), sides_of(junctions), boxes_of(crossings)


@compiled
def moving_box(state: Floats, i: int) -> MovingBox[float]:
    """The body of an actor in a frame's state."""
    size = Size(state[LENGTH, i] / 2, state[WIDTH, i] / 2)
    return MovingBox(state[X, i], state[Y, i], state[HEADING, i], state[VX, i], state[VY, i], size)


@compiled
def conflict_in(ego: OnPath, state: Floats, i: int, vehicle: bool, link: int, street: Street, wary: bool) -> float:
    """Computes the time until the ego reaches a conflicting actor, s.

    It is inf without a conflict, 0 alongside.

    Args:
      ego: on its path.
      state: of a frame.
      i: the actor.
      vehicle: whether it is one.
      link: SUMO's letter of the signal ahead of it; 0: none.
      street: where it is.
      wary: whether the driver distrusts what hangs over beside it and what brakes.
    """
    other, speed, corridor = moving_box(state, i), ego.speed_mps, with_margin(ego.size)
    if not vehicle:
        if not soon_walked(street, other):
            return math.inf
        return time_to_meet(ego.path, ego.s, speed, corridor, other)
    seen = along(ego.path, ego.first, ego.s, speed, ego.size, other)
    if math.cos(seen.turn_rad) > SAME_WAY_COS:
        begins, _ = lane_conflict(seen, speed, state[OFFSET, i], state[ACCEL, i], street.lane_width_m, wary)
        if not begins:
            return math.inf
        return min(seen.ttc_s, max(seen.gap_m, 0.0) / max(speed, STANDING_MPS))
    other_mps = state[SPEED, i]
    yields = not wary and state[ACCEL, i] <= -BRAKES_MPS2
    braking_mps2 = FIRM_MPS2 if yields else YIELDING_MPS2
    entry_m, meets_m = _entry(ego, corridor, other, other_mps, braking_mps2)
    stops = not math.isfinite(entry_m)
    if stops and must_yield(link):
        return math.inf
    touch_s = time_to_touch(ego.path, ego.s, speed, corridor, other, HORIZON_S)
    if touch_s <= HORIZON_S:
        return touch_s
    if not stops and _both_come(entry_m, meets_m - ego.s, speed, ego.size, other, other_mps):
        return max(meets_m - ego.s, 0.0) / speed
    return math.inf


@compiled
def must_yield(link: int) -> bool:
    """Whether a vehicle at this signal is expected to stop or yield."""
    return link in (RED, UNCONTROLLED, YELLOW, GREEN_MINOR)


@compiled
def soon_walked(street: Street, other: MovingBox[float]) -> bool:
    """Whether a pedestrian is on carriageway or crossing, or within 1 s."""
    if len(street.roadway.sides) == 0:
        return True
    for k in range(KERB_STEPS + 1):
        t = k * KERB_S / KERB_STEPS
        if within(street.walked, other.x + t * other.vx, other.y + t * other.vy):
            return True
    return False


@compiled
def _entry(
    ego: OnPath, corridor: Size, other: MovingBox[float], other_mps: float, braking_mps2: float
) -> tuple[float, float]:
    """Returns `entry_distance` along the straight stopping distance; inf if it stops before."""
    stopping_m = other_mps**2 / (2 * braking_mps2)
    ahead = np.linspace(0.0, stopping_m, math.ceil(stopping_m / AHEAD_M) + 1)
    cos, sin = (other.vx / other_mps, other.vy / other_mps) if other_mps > STANDING_MPS else (0.0, 0.0)
    x, y, heading = other.x + ahead * cos, other.y + ahead * sin, np.full(len(ahead), other.heading)
    reach_s = ego.s + ego.speed_mps * HORIZON_S
    return entry_distance(ego.path, ego.first, reach_s, corridor, x, y, heading, other.size)


@compiled
def _both_come(
    entry_m: float, meets_m: float, speed: float, size: Size, other: MovingBox[float], other_speed: float
) -> bool:
    """Whether both meet within the horizon, passing less than 1 s apart."""
    if speed < STANDING_MPS or other_speed < STANDING_MPS:
        return False
    passing_m = 2 * (size.half_length + other.size.half_length)
    here_s, there_s = max(meets_m, 0.0) / speed, entry_m / other_speed
    return (
        here_s <= HORIZON_S
        and here_s <= there_s + passing_m / other_speed + NEAR_S
        and there_s <= here_s + passing_m / speed + NEAR_S
    )
