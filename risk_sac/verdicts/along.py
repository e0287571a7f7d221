"""Locates another body along the ego's path; detects conflicts with same-direction vehicles.

Source: UN Regulation 157, Annex 3 (guidance on traffic disturbance critical scenarios): a cut-in is perceived 0.375 m
off the lane's centre, a leader's braking from 5 m/s² on, and both are a danger below 2 s to collision. One beside the
ego has no time to collision along the lane.
"""

import math
from typing import Generic, NamedTuple

import numpy as np

from risk_sac.geometry import Size
from risk_sac.jit import compiled
from risk_sac.types import Bools, Floats
from risk_sac.verdicts.course import HORIZON_S, Body, F, at
from risk_sac.verdicts.path import Path, project

WANDER_M = 0.375  # what a vehicle strays from its lane's centre without meaning anything
DANGER_TTC_S = 2.0
LEADER_BRAKES_MPS2 = 5.0


class Along(NamedTuple, Generic[F]):
    """Another body as seen along the ego's path: now, or in each of `T` frames."""

    gap_m: F  # from the ego's front to the other's rear, below 0 alongside and behind
    behind_m: F  # from the other's front to the ego's rear
    ttc_s: F  # along the path; inf if it is not ahead, or the ego does not close in
    across_m: F  # of its centre from the ego's path, positive to the left
    turn_rad: F  # its heading relative to the path, full turns not taken off
    speed_mps: F  # along the path
    aside_s: F  # until the sides touch, as the two move across now; inf if they do not come nearer


@compiled
def along(path: Path, first: int, s: float, speed: float, size: Size, other: Body[float]) -> Along[float]:
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
    beside = size.half_width + cos * half_width + sin * half_length
    room = max(abs(across) - beside, 0.0)
    coming = math.copysign(1.0, across) * (other.vx * math.sin(heading) - other.vy * math.cos(heading))
    aside = room / coming if coming > 0.0 else math.inf
    return Along(gap, behind, ttc, across, turn, speed_along, aside)


def along_series(path: Path, speed: Floats, size: Size, other: Body[Floats]) -> Along[Floats]:
    """Places a body along the ego's path frame by frame; the path has a point per frame."""
    return Along(*_along_rows(path, speed, size, other))


@compiled
def _along_rows(path: Path, speed: Floats, size: Size, other: Body[Floats]) -> Floats:
    rows = np.empty((7, len(speed)))
    for t in range(len(speed)):
        for row, value in enumerate(along(path, t, path.s[t], speed[t], size, at(other, t))):
            rows[row, t] = value
    return rows


@compiled
def towards(across_m: float, offset_m: float, lane_width_m: float) -> float:
    """Computes a vehicle's offset from its lane's centre towards the ego, m.

    SUMO's offset jumps by a lane's width when the vehicle passes to the next lane; where it stands across the ego's
    path tells which lane's centre is meant. Without a recorded offset (NaN) that place alone decides.

    `across_m` is its centre's distance from the ego's path, positive to the left, `offset_m` that from its lane's
    centre.
    """
    seen = lane_width_m - abs(across_m)
    if math.isnan(offset_m):
        return seen
    recorded = -offset_m if across_m > 0.0 else offset_m
    return recorded + lane_width_m * round((seen - recorded) / lane_width_m)


@compiled
def lane_conflict(
    other: Along[float], speed_mps: float, offset_m: float, accel_mps2: float, lane_width_m: float, wary: bool
) -> tuple[bool, bool]:
    """Detects the beginning and the continuation of a conflict with a same-direction vehicle.

    A cut-in begins when the vehicle is more than 0.375 m off its lane's centre towards the ego, and less than 2 s
    ahead, or alongside and coming nearer; a conflict with a leader when it brakes harder than 5 m/s², or is less than
    2 s ahead.
    Choices: braking counts within 4 s of the ego's way; a conflict goes on while the ego closes in within 4 s; one
    alongside comes nearer if the sides would touch within 4 s, or it is half in the ego's lane. One that merely hangs
    over the line does not.

    `speed_mps` is the ego's, `accel_mps2` the vehicle's. For a wary driver a vehicle alongside counts if it comes
    nearer or not.
    """
    in_lane = abs(other.across_m) <= lane_width_m / 2
    coming = in_lane or towards(other.across_m, offset_m, lane_width_m) > WANDER_M
    alongside = other.gap_m <= 0.0 and other.behind_m <= 0.0 and (wary or in_lane or other.aside_s < HORIZON_S)
    near = 0.0 < other.gap_m <= HORIZON_S * speed_mps
    brakes = in_lane and near and accel_mps2 < -LEADER_BRAKES_MPS2
    begins = brakes or (coming and (alongside or other.ttc_s < DANGER_TTC_S))
    return begins, begins or (coming and other.ttc_s < HORIZON_S)


@compiled
def lane_conflicts(
    others: Along[Floats], speed_mps: Floats, offset_m: Floats, accel_mps2: Floats, lane_width_m: float, wary: bool
) -> tuple[Bools, Bools]:
    """`lane_conflict` in each of `T` frames."""
    begins, lasts = np.empty(len(speed_mps), dtype=np.bool_), np.empty(len(speed_mps), dtype=np.bool_)
    for t in range(len(speed_mps)):
        o = others
        other = Along(o.gap_m[t], o.behind_m[t], o.ttc_s[t], o.across_m[t], o.turn_rad[t], o.speed_mps[t], o.aside_s[t])
        begins[t], lasts[t] = lane_conflict(other, speed_mps[t], offset_m[t], accel_mps2[t], lane_width_m, wary)
    return begins, lasts
