"""Whether a driver is in a conflict with an actor right now.

The measures are those of `risk_sac.verdicts.conflict`; only what a record knows of the future is foreseen here: the
ego's path is given, and everything else goes on straight.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from risk_sac.scenario.layout import Area
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.verdicts.conflict import BRAKES_MPS2, FIRM_MPS2, KERB_S, SAME_WAY_COS
from risk_sac.verdicts.course import (
    HORIZON_S,
    NEAR_S,
    YIELDING_MPS2,
    MovingBox,
    Path,
    Sides,
    along,
    entry_distance,
    lane_conflict,
    sides_of,
    time_to_meet,
    time_to_touch,
    with_margin,
    within,
)
from risk_sac.verdicts.evidence import KERB_STEPS, Ground
from risk_sac.verdicts.unseen import boxes_of
from risk_sac.world.geometry import Size
from risk_sac.world.jit import compiled
from risk_sac.world.types import ACCEL, HEADING, LENGTH, OFFSET, SPEED, VX, VY, WIDTH, Floats, X, Y

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
def body_of(state: Floats, i: int) -> MovingBox[float]:
    """The body of an actor in a frame's state."""
    size = Size(state[LENGTH, i] / 2, state[WIDTH, i] / 2)
    return MovingBox(state[X, i], state[Y, i], state[HEADING, i], state[VX, i], state[VY, i], size)


@compiled
def conflict_in(ego: OnPath, state: Floats, i: int, vehicle: bool, link: int, street: Street, wary: bool) -> float:
    """Computes the time until the ego reaches a conflicting actor, s.

    It is inf without a conflict, and 0 where the two drive alongside.

    Args:
      ego: on its path.
      state: of a frame.
      i: the actor.
      vehicle: whether it is one.
      link: SUMO's letter of the signal ahead of it; 0: none.
      street: where it is.
      wary: whether the driver distrusts what hangs over beside it and what brakes.
    """
    other, speed, corridor = body_of(state, i), ego.speed_mps, with_margin(ego.size)
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
    """Whether a vehicle before this signal is expected to stop or to yield."""
    return link in (RED, UNCONTROLLED, YELLOW, GREEN_MINOR)


@compiled
def soon_walked(street: Street, other: MovingBox[float]) -> bool:
    """Whether a pedestrian is on the carriageway or a crossing, or comes there within 1 s."""
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
    """`entry_distance` of a straight course as long as stopping takes; inf if it can stop before."""
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
    """Whether both pass the place where their ways meet within the horizon, and less than 1 s apart."""
    if speed < STANDING_MPS or other_speed < STANDING_MPS:
        return False
    passing_m = 2 * (size.half_length + other.size.half_length)
    here_s, there_s = max(meets_m, 0.0) / speed, entry_m / other_speed
    return (
        here_s <= HORIZON_S
        and here_s <= there_s + passing_m / other_speed + NEAR_S
        and there_s <= here_s + passing_m / speed + NEAR_S
    )
