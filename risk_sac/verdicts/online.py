"""Finds conflicts of the present frame, for egos that drive and for scenes that begin.

The measures are those of `risk_sac.verdicts.conflict`; only what a record knows of the future is foreseen here: the
ego's path is given, and everybody else goes on straight.
"""

import math

import numpy as np

from risk_sac.geometry import Size
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.types import Bools, Frame, Kind
from risk_sac.verdicts.along import along, lane_conflict
from risk_sac.verdicts.conflict import BRAKES_MPS2, FIRM_MPS2, KERB_S, SAME_WAY_COS, YIELDING_MPS2
from risk_sac.verdicts.course import HORIZON_S, Body, entry_distance, time_to_touch, with_margin
from risk_sac.verdicts.drivers import R157_PERCEIVES_S, r157
from risk_sac.verdicts.evidence import Ground, soon_inside
from risk_sac.verdicts.path import Path

NEAR_S = 1.0  # two vehicles that pass a place no further apart in time are in each other's way
AHEAD_M = 0.5  # between two foreseen poses
STANDING_MPS = 0.1
OVER_S = 1.0  # a conflict that has been gone for so long is over
YIELDS = frozenset(b"ruyg")  # signals at which a driver is expected to stop, or to let others pass


def conflicts_now(frame: Frame, path: Path, known: Bools, ground: Ground, *, wary: bool = False) -> Bools:
    """Which of `frame.ids` a driver in the ego's place is in a conflict with.

    A crossing vehicle that has to stop or to yield, and still can at 3.4 m/s², is expected to: in a record the contact
    tells that it did not.

    `path` is the ego's path ahead, from its centre; `known` says whom the ego knows of, `n`. For a wary driver whoever
    hangs over beside the ego counts, if it comes nearer or not, and who brakes is not trusted.

    Returns:
      `n`; False for the ego.
    """
    found = np.zeros(len(frame.ids), dtype=np.bool_)
    apart_m = np.hypot(frame.x_m - frame.x_m[0], frame.y_m - frame.y_m[0]) - (frame.length_m + frame.length_m[0])
    within_reach = apart_m <= HORIZON_S * (frame.speed_mps + frame.ego_speed_mps)
    within_reach[0] = False
    for i in np.flatnonzero(known & within_reach):
        found[i] = _in_conflict(frame, path, int(i), ground, wary)
    return found


def _in_conflict(frame: Frame, path: Path, i: int, ground: Ground, wary: bool) -> bool:
    f = frame
    size, other_size = (Size(float(f.length_m[each]) / 2, float(f.width_m[each]) / 2) for each in (0, i))
    other = Body(f.x_m[i], f.y_m[i], f.heading_rad[i], f.vx_mps[i], f.vy_mps[i], other_size)
    speed, corridor = f.ego_speed_mps, with_margin(size)
    if f.kind[i] == Kind.PEDESTRIAN:
        here = slice(i, i + 1)
        areas = ground.roadway + ground.crossings
        if ground.roadway and not soon_inside(areas, f.x_m[here], f.y_m[here], f.vx_mps[here], f.vy_mps[here], KERB_S):
            return False
        return time_to_touch(path, path.s[0], speed, corridor, other, HORIZON_S) <= HORIZON_S
    seen = along(path, 0, float(path.s[0]), speed, size, other)
    if math.cos(seen.turn_rad) > SAME_WAY_COS:
        offset, accel = f.lane_offset_m[i], f.accel_mps2[i]
        begins, _ = lane_conflict(seen, speed, offset, accel, ground.lane_width_m, wary)
        return bool(begins)
    yields = not wary and f.accel_mps2[i] <= -BRAKES_MPS2
    braking_mps2 = FIRM_MPS2 if yields else YIELDING_MPS2
    entry_m, meets_m = _entry(path, speed, corridor, other, float(f.speed_mps[i]), braking_mps2)
    stops = not math.isfinite(entry_m)
    if stops and int(f.link[i]) in YIELDS:
        return False
    if time_to_touch(path, path.s[0], speed, corridor, other, HORIZON_S) <= HORIZON_S:
        return True
    return not stops and _both_come(entry_m, meets_m - path.s[0], speed, size, other, float(f.speed_mps[i]))


def _entry(
    path: Path, speed: float, corridor: Size, other: Body[float], other_speed: float, braking_mps2: float
) -> tuple[float, float]:
    """`entry_distance` of who goes on straight, as far as it needs to stop; infinite if it can stop before."""
    stopping_m = other_speed**2 / (2 * braking_mps2)
    ahead = np.linspace(0.0, stopping_m, math.ceil(stopping_m / AHEAD_M) + 1)
    cos, sin = (other.vx / other_speed, other.vy / other_speed) if other_speed > STANDING_MPS else (0.0, 0.0)
    x, y, heading = other.x + ahead * cos, other.y + ahead * sin, np.full(len(ahead), other.heading)
    return entry_distance(path, 0, path.s[0] + speed * HORIZON_S, corridor, x, y, heading, other.size)


def _both_come(
    entry_m: float, meets_m: float, speed: float, size: Size, other: Body[float], other_speed: float
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


class R157Reflex:
    """R157's driver in the closed loop; one for each episode.

    It drives as the ego does, and brakes as `r157` says from the moment it perceives a conflict, if that is harder.
    """

    def __init__(self, ground: Ground) -> None:
        self._ground = ground
        self._since_s: float | None = None
        self._last_s = 0.0

    def braking(self, frame: Frame, path: Path, seen: Bools) -> float:
        """How hard it brakes now, m/s²; 0 while it perceives no conflict. Arguments as of `conflicts_now`."""
        now = frame.time_s
        if conflicts_now(frame, path, seen, self._ground).any():
            self._since_s, self._last_s = (now if self._since_s is None else self._since_s), now
        elif self._since_s is not None and now - self._last_s > OVER_S:
            self._since_s = None
        if self._since_s is None or now - self._since_s < R157_PERCEIVES_S:
            return 0.0
        return r157(now - self._since_s - R157_PERCEIVES_S, self._ground.friction * GRAVITY_MPS2)
