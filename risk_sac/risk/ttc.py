"""Time to encounter: a time to collision that also counts near misses.

TTC (`risk_sac.geometry.time_to_contact`) is infinite until the courses meet, so it does not show a collision course
that is about to begin. In the time to encounter a gap that would be left counts as the time in which unforeseen motion
closes it.

Source: Eggert 2014, "Predictive risk estimation for intelligent ADAS functions" (time to and distance at the closest
encounter); Wachenfeld et al. 2016, "The worst-time-to-collision metric for situation identification" (what others may
do beside keeping their course).
"""

import math

import numpy as np

from risk_sac.geometry import RelativeView, along_axes
from risk_sac.jit import compiled
from risk_sac.types import Bools, Floats

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
    """Time to encounter of the ego with each other actor, `n`, s; 0 where the bodies touch.

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
    """Computes min_{t ≥ 0} [ t + max_l (start_l + slope_l t) ] over lines.

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
