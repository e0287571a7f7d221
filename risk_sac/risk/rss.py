"""Responsibility-Sensitive Safety margins and times to encounter, for each actor.

Choice: RSS gives two distances along a lane; here they are taken along the ego's axes, whatever the other's heading.
Braking and acceleration are blended by the angle between the bodies: cross traffic stops by its brakes.

Deviation: the lateral distance follows the paper's words, not its formula; see `lateral`.

Source: Shalev-Shwartz, Shammah, Shashua 2017, "On a Formal Model of Safe and Scalable Self-driving
Cars", arXiv 1708.06374, Definitions 1 (same direction), 2 (opposite directions) and 6 (lateral).
"""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.world.geometry import RelativeView, along_axes
from risk_sac.world.jit import compiled
from risk_sac.world.types import Bools, Floats

LONGITUDINAL_CAP_M = LATERAL_CAP_M = 50.0

# Choice: the margins that undisturbed traffic leaves, so that the scaled margin is about 1 in it: along a course the
# time by which the ego could respond later, across it the metres to a car in the next lane.
LONGITUDINAL_SCALE_S = 0.85
SLOW_MPS = 3.0  # lower speeds count as this one: at standstill any margin would be endless in time
LATERAL_SCALE_M = 1.1
SCALED_LOW, SCALED_HIGH = -3.0, 2.0


@compiled
def stopping(speed_mps: float, response_s: float, accel_mps2: float, brake_mps2: float) -> float:
    """Computes the way until standstill, m; negative if it moves away.

    (v + v_ρ) ρ/2 + v_ρ |v_ρ| / (2 b) with v_ρ = v + ρ a.

    v is towards the other; it accelerates with a in the response time ρ and brakes with b thereafter.
    """
    after = speed_mps + response_s * accel_mps2
    return (speed_mps + after) * (response_s / 2) + after * abs(after) / (2 * brake_mps2)


@compiled
def same_direction(rear_mps: float, front_mps: float, parameters: RssParameters) -> float:
    """Computes the safe longitudinal distance behind a vehicle, m (Def. 1).

    d_min = [v_r ρ + a ρ²/2 + (v_r + ρ a)² / (2 b_min) − v_f² / (2 b_max)]_+
    """
    p = parameters
    way = stopping(rear_mps, p.response_s, p.accel_mps2, p.brake_min_mps2)
    return behind(way, front_mps, p)


@compiled
def behind(way_m: float, front_mps: float, parameters: RssParameters) -> float:
    """Def. 1 for a vehicle that needs `way_m` to stop."""
    return max(way_m - front_mps * front_mps / (2 * parameters.brake_max_mps2), 0.0)


@compiled
def opposite_direction(ego_mps: float, other_mps: float, parameters: RssParameters) -> float:
    """Computes d_min, m, of oncoming actors; speeds are magnitudes (Def. 2).

    Both respond after ρ and brake with b_min.
    """
    p = parameters
    return stopping(ego_mps, p.response_s, p.accel_mps2, p.brake_min_mps2) + stopping(
        other_mps, p.response_s, p.accel_mps2, p.brake_min_mps2
    )


@compiled
def lateral(closing_ego_mps: float, closing_other_mps: float, parameters: RssParameters) -> float:
    """Computes the safe lateral distance, m (Def. 6).

    d_min = μ + [Σ_i (v_i + v_i,ρ) ρ/2 + v_i,ρ |v_i,ρ| / (2 b_lat)]_+

    Deviation: the paper's formula has v_i,ρ² for v_i,ρ |v_i,ρ|. The two differ for a vehicle that moves away after ρ.
    It goes on doing so while it brakes, as Def. 6 says in words; v² would count that way as closing in.

    Each speed is towards the other vehicle, negative when it moves away.
    """
    p = parameters
    braked = p.lateral_accel_mps2, p.lateral_brake_mps2
    return _lateral(closing_ego_mps, braked, closing_other_mps, braked, p)


@compiled
def _lateral(
    ego_mps: float, ego: tuple[float, float], other_mps: float, other: tuple[float, float], p: RssParameters
) -> float:
    """`lateral` for two that accelerate and brake differently."""
    ways = stopping(ego_mps, p.response_s, ego[0], ego[1]) + stopping(other_mps, p.response_s, other[0], other[1])
    return p.fluctuation_m + max(ways, 0.0)


class Margins(NamedTuple):
    """RSS margins to each of the `n` others."""

    longitudinal_m: Floats  # negative where violated
    lateral_m: Floats
    scaled: Floats  # the larger of the two, each in its scale; negative where the situation is dangerous


@compiled
def margins(view: RelativeView, walks: Bools, parameters: RssParameters) -> Margins:
    """RSS margins to each other actor.

    A margin is the distance between the bodies along an axis minus the RSS distance along it; bodies that overlap along
    the axis have a negative distance. The situation is dangerous where both margins, and so the larger, are negative.

    Choice: the lateral margin is the larger of that across the ego's course and that across the other's, for bodies
    that stay clear along any direction do not touch; an oncoming car that passes a turning ego is no danger. A
    pedestrian has no course to rely on.

    Choice: a margin is divided by what undisturbed traffic leaves, or by the RSS distance where that is more, so it
    falls to -1 as the bodies meet. In metres it would rise before a contact: an ego that brakes hard, but too late,
    wins back more RSS distance than it loses room.

    Choice: the lateral scale grows to the longitudinal one with the angle between the courses.

    `walks` says which of the `n` others are pedestrians.
    """
    p = parameters
    n = len(view.x)
    longitudinal, sideways, scaled = np.empty(n), np.empty(n), np.empty(n)
    ego = max(view.ego_vx, 0.0)
    own = p.lateral_accel_mps2, p.lateral_brake_mps2
    ego_way = stopping(ego, p.response_s, p.accel_mps2, p.brake_min_mps2)
    for i in range(n):
        along, across = view.vx[i] + view.ego_vx, view.vy[i] + view.ego_vy  # the other's velocity in the ego's axes
        cos, sin = abs(view.cos[i]), abs(view.sin[i])
        lengthwise = LONGITUDINAL_SCALE_S * max(ego + max(-along, 0.0), SLOW_MPS)
        crosswise = LONGITUDINAL_SCALE_S * max(ego, abs(across), SLOW_MPS) * sin + LATERAL_SCALE_M * cos
        accel_x = p.accel_mps2 * cos + p.lateral_accel_mps2 * sin
        brake_x = p.brake_min_mps2 * cos + p.lateral_brake_mps2 * sin
        accel_y = p.accel_mps2 * sin + p.lateral_accel_mps2 * cos
        brake_y = p.brake_min_mps2 * sin + p.lateral_brake_mps2 * cos
        if walks[i]:
            accel_x = accel_y = p.walk_accel_mps2
            brake_x = brake_y = p.walk_brake_mps2
            crosswise = LATERAL_SCALE_M

        if view.x[i] < 0.0:
            way = stopping(max(along, 0.0), p.response_s, accel_x, brake_x)
            distance = behind(way, ego, p)
        elif along < 0.0:
            distance = ego_way + stopping(-along, p.response_s, accel_x, brake_x)
        else:
            distance = behind(ego_way, along, p)
        clear = abs(view.x[i]) - view.reach[0, i] - distance
        longitudinal[i] = min(max(clear, -LONGITUDINAL_CAP_M), LONGITUDINAL_CAP_M)
        larger = longitudinal[i] / max(lengthwise, distance)

        side = 1.0 if view.y[i] >= 0.0 else -1.0
        distance = _lateral(side * view.ego_vy, own, -side * across, (accel_y, brake_y), p)
        clear = abs(view.y[i]) - view.reach[1, i] - distance
        larger = max(larger, clear / max(crosswise, distance))
        if not walks[i]:
            side = 1.0 if view.separation[3, i] >= 0.0 else -1.0
            ego_closing = side * (view.ego_vy * view.cos[i] - view.ego_vx * view.sin[i])
            closing = side * (along * view.sin[i] - across * view.cos[i])
            distance = _lateral(ego_closing, (accel_y, brake_y), closing, own, p)
            other_clear = abs(view.separation[3, i]) - view.reach[3, i] - distance
            larger = max(larger, other_clear / max(crosswise, distance))
            clear = max(clear, other_clear)
        sideways[i] = min(max(clear, -LATERAL_CAP_M), LATERAL_CAP_M)
        scaled[i] = min(max(larger, SCALED_LOW), SCALED_HIGH)
    return Margins(longitudinal, sideways, scaled)


TTC_CAP_S = 10.0  # longer times carry no risk and would only stretch the scale
ENCOUNTER_CAP_S = 8.0  # longer times carry no risk

# Choice: unforeseen motion.
SPEED_SHARE = 0.2  # along its course, so much faster or slower than now
DRIFT_MPS = 0.3  # in any direction: two vehicles that drift in their lanes
WALK_MPS = 0.6  # in any direction, if one of the two is a pedestrian: half a walking pace
BEHIND_S_PER_M = 2.0  # for each metre that the other's centre is behind the ego's rear bumper
LINES = 9  # both sides of each of the 4 separating axes, and zero


@compiled
def time_to_encounter(view: RelativeView, walks: Bools) -> Floats:
    """Computes times to encounter with other actors, `n`, s; 0 on contact.

    τ = min_{t ≥ 0} [ t + max_k (|s_k + v_k t| − r_k)₊ / c_k ],   c_k = c + δ (u_e |n_k · h_e| + u_o |n_k · h_o|)

    Both keep their velocity until t. Along a separating axis n_k a gap remains then (distance s_k of the
    centres, relative velocity v_k, reach r_k of the bodies). Unforeseen motion closes it at a speed c_k: a share δ of
    the speeds u along the headings h, and c. On a collision course τ ≤ TTC. Every term is convex in t, so the minimum
    is where the lines that fall by more than 1 a second meet the others, or at t = 0.

    Choice: an actor from behind has to keep the distance, so it fades out behind the ego's rear bumper. `walks` says
    which of the `n` are pedestrians.
    """
    n = len(view.x)
    encounter = np.empty(n)
    slope, start = np.zeros(LINES), np.zeros(LINES)  # of each line over t; the last one is zero
    ego = math.hypot(view.ego_vx, view.ego_vy)
    for i in range(n):
        along, across = abs(view.cos[i]), abs(view.sin[i])
        anywhere, other = DRIFT_MPS, math.hypot(view.vx[i] + view.ego_vx, view.vy[i] + view.ego_vy)
        if walks[i]:
            anywhere, other = WALK_MPS, 0.0  # it turns as it likes, and has no course
        courses = ego + other * along, other * across, other + ego * along, ego * across  # speeds along the axes
        speeds = along_axes(view.vx[i], view.vy[i], view.cos[i], view.sin[i])
        for axis in range(4):
            closing = anywhere + SPEED_SHARE * courses[axis]
            for side in range(2):
                sign = 1.0 - 2.0 * side
                slope[2 * axis + side] = sign * speeds[axis] / closing
                start[2 * axis + side] = (sign * view.separation[axis, i] - view.reach[axis, i]) / closing
        behind_m = max(-view.ego_half_length - view.x[i], 0.0)
        encounter[i] = _least(slope, start) + BEHIND_S_PER_M * behind_m
    return encounter


@compiled
def _least(slope: Floats, start: Floats) -> float:
    """Computes min_{t ≥ 0} [t + max_l (start_l + slope_l t)].

    Every steepest line has a rising opposite.
    """
    time = 0.0
    for steep in range(len(slope)):
        if slope[steep] < -1.0:
            meets = np.inf
            for flat in range(len(slope)):
                if slope[flat] >= -1.0:
                    meets = min(meets, (start[steep] - start[flat]) / (slope[flat] - slope[steep]))
            time = max(time, meets)
    highest = -np.inf
    for line in range(len(slope)):
        highest = max(highest, start[line] + slope[line] * time)
    return float(time + highest)
