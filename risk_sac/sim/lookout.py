"""Finds actors on a collision course with a vehicle's corridor.

Its driver has to stop for them or to follow them.

SUMO's drivers see pedestrians on crossings from one side only, none inside a junction or beside a crossing, and take a
tilted car for a straight one: `MSPModel_Striping` derives the walking direction of a person that is moved by command
from its route, not from its motion. So SUMO knows no person at all, and one rule applies, the same from both sides.

Choice: others keep their velocity. The driver asks whether it would touch one of them if it kept its speed, or drove as
fast as it may. So a driver that has stopped for a pedestrian does not start before the pedestrian has left its path.
"""

import math

import numpy as np

from risk_sac.sim import paths
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, Bools, Floats, X, Y

LOOK_S = 4.0  # time ahead within which a collision course counts
CUT_IN_LOOK_S = 2.0  # the same for vehicles of the same direction, whose sideways motion is soon over
TICK_S = 0.1
MARGIN_M = 0.375  # free width on either side of the body, in which a lane keeper wanders (UN R157)
YIELDING_MPS2 = 2.5  # braking with which crossing traffic yields; SUMO's drivers never need more
SAME_WAY_COS = 0.5
MOVING_MPS = 0.5
BEHIND_M, BEYOND_M = 60.0, 10.0  # path before and beyond the driven stretch on which others are looked for
NEAR_M = 40.0  # distance beyond which no vehicle in a town has to brake yet for a pedestrian or a static body
NEAR_S, NEAR_MPS2 = 0.5, 4.5  # the same at speed: what it drives before and while it brakes


@compiled
def near_outsiders(state: Floats, outside: Bools) -> Bools:
    """Returns which of `n` actors are near one that SUMO lacks.

    Those have themselves.
    """
    x, y, n = state[X], state[Y], len(outside)
    near = np.zeros(n, dtype=np.bool_)
    for k in range(n):
        if outside[k]:
            for i in range(n):
                speed = state[SPEED, i]
                reach_m = max(NEAR_M, NEAR_S * speed + speed * speed / (2 * NEAR_MPS2))
                near[i] |= math.hypot(x[i] - x[k], y[i] - y[k]) < reach_m
    return near


@compiled
def project(points: Floats, x: float, y: float) -> tuple[float, float, float]:
    """Projects a place onto a path: station, offset to the left, heading.

    The path's ends go on straight.
    """
    path_x, path_y, path_station = points[paths.X], points[paths.Y], points[paths.STATION]
    path_cos, path_sin = points[paths.COS], points[paths.SIN]
    best, nearest, station, offset = math.inf, 0, 0.0, 0.0
    last = points.shape[1] - 2
    for i in range(last + 1):
        cos, sin = path_cos[i], path_sin[i]
        dx, dy = x - path_x[i], y - path_y[i]
        along, across = dx * cos + dy * sin, dy * cos - dx * sin
        length = path_station[i + 1] - path_station[i]
        beyond = 0.0
        if along < 0.0 and i > 0:
            beyond = -along
        elif along > length and i < last:
            beyond = along - length
        if max(beyond, abs(across)) >= best:
            continue
        distance = math.hypot(beyond, across)
        if distance < best:
            best, nearest = distance, i
            if i > 0:
                along = max(along, 0.0)
            if i < last:
                along = min(along, length)
            station = path_station[i] + along
            offset = across
    return station, offset, points[paths.HEADING, nearest]


@compiled
def stretch(points: Floats, first_m: float, last_m: float) -> Floats:
    """Selects the segments of a path between two stations.

    The rest may come back beside them, as behind a roundabout.
    """
    stations, first, last = points[paths.STATION], 0, points.shape[1] - 1
    while first + 1 < last and stations[first + 1] <= first_m:
        first += 1
    while last - 1 > first and stations[last - 1] >= last_m:
        last -= 1
    return points[:, first : last + 1]


@compiled
def foreseen(points: Floats, front_m: float, speed_mps: float, accel_mps2: float) -> Floats:
    """Predicts a front bumper's stations at each tick of LOOK_S, `ticks`.

    It speeds up by `accel_mps2` and is slow in bends.
    """
    ticks = round(LOOK_S / TICK_S) + 1
    front = np.empty(ticks)
    stations, limit_mps = points[paths.STATION], points[paths.LIMIT]
    station, speed, point, last = front_m, speed_mps, 0, len(stations) - 1
    for k in range(ticks):
        front[k] = station
        while point < last and stations[point + 1] <= station:
            point += 1
        speed = min(speed, limit_mps[point])
        faster = min(speed + accel_mps2 * TICK_S, limit_mps[point])
        station += (speed + faster) / 2 * TICK_S
        speed = faster
    return front


@compiled
def _turned(angle: float) -> tuple[float, float]:
    """Computes a turned unit-length body's extent, along and across."""
    return abs(math.cos(angle)), abs(math.sin(angle))


@compiled
def targets(
    points: Floats,
    front_m: float,
    offset_m: float,
    own: int,
    accel_mps2: float,
    state: Floats,
    vehicle: Bools,
    candidate: Bools,
) -> Floats:
    """Finds the actors that a driver stops for or follows.

    Args:
      points: of the path that it will drive.
      front_m: station of its front bumper on the path.
      offset_m: of its middle from the path.
      own: its column among the actors.
      accel_mps2: the most it accelerates.
      state: of all `n` actors of a frame.
      vehicle: `n`; which are vehicles, the rest are pedestrians.
      candidate: `n`; which the driver knows of and looks out for.

    Returns:
      `targets x 3`: column of the actor; distance from the front bumper to the body, m; and the speed at which it
      leads, m/s, 0 for those that the driver has to stop for.
    """
    x, y, heading, vx, vy = state[X], state[Y], state[HEADING], state[VX], state[VY]
    n = len(x)
    rows, count = np.empty((n, 3)), 0
    speed_mps, length_m, width_m = state[SPEED, own], state[LENGTH, own], state[WIDTH, own]
    corridor = width_m / 2 + MARGIN_M
    kept, fastest = foreseen(points, front_m, speed_mps, 0.0), foreseen(points, front_m, speed_mps, accel_mps2)
    reach = fastest[-1] - front_m + length_m
    near = stretch(points, front_m - BEHIND_M, fastest[-1] + BEYOND_M)
    for i in range(n):
        if i == own or not candidate[i]:
            continue
        speed, half_length, half_width = math.hypot(vx[i], vy[i]), state[LENGTH, i] / 2, state[WIDTH, i] / 2
        s_now, _, way = project(near, x[i], y[i])
        if abs(s_now - front_m) > reach + speed * LOOK_S:
            continue
        v_along = vx[i] * math.cos(way) + vy[i] * math.sin(way)
        same_way = vehicle[i] and v_along > MOVING_MPS and abs(math.cos(heading[i] - way)) > SAME_WAY_COS
        if same_way and s_now < front_m - length_m / 2:
            continue  # a vehicle from behind, or one that is overtaken, keeps the distance itself
        look = CUT_IN_LOOK_S if same_way else LOOK_S
        inside_since, nearest = -1.0, math.inf
        cos, sin = _turned(heading[i] - way)
        for k in range(round(look / TICK_S) + 1):
            t = k * TICK_S
            s, d, way_then = project(near, x[i] + vx[i] * t, y[i] + vy[i] * t)
            if way_then != way:
                way = way_then
                cos, sin = _turned(heading[i] - way)
            if abs(d - offset_m) > corridor + half_length * sin + half_width * cos:
                if inside_since >= 0.0:
                    break
                continue
            if inside_since < 0.0:
                inside_since = t
                if vehicle[i] and not same_way and t > speed / (2.0 * YIELDING_MPS2):
                    break  # it can still stop before the corridor: t · v is more than v² / 2b
            extent = half_length * cos + half_width * sin
            if s + extent >= kept[k] - length_m and s - extent <= fastest[k] and s + extent > front_m:
                nearest = min(nearest, s - extent)
        if nearest == math.inf:
            continue
        gap, lead = max(nearest - front_m, 0.0), 0.0
        if same_way:
            extent = half_length * cos + half_width * sin
            gap, lead = max(s_now - extent - front_m, 0.0), v_along
        rows[count, 0], rows[count, 1], rows[count, 2] = i, gap, lead
        count += 1
    return rows[:count]
