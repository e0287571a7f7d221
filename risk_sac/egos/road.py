"""Rows of a perceived path, a driver's way of staying on it, and the edges of lanes."""

import math

import numpy as np

from risk_sac.egos.seam import Perceived, Vehicle
from risk_sac.jit import compiled
from risk_sac.sim.lookout import project
from risk_sac.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, Bools, Floats, Lane, X, Y

# Rows of a path, as in `risk_sac.sim.paths`.
PATH_X, PATH_Y = 0, 1
STATION = 2  # length of the line up to each point, m
PATH_HEADING = 3  # of the segment that begins at the point, rad
LIMIT = 4  # the fastest to take it, m/s; bends are slow

LOOKAHEAD_S, LEAST_LOOKAHEAD_M = 0.6, 5.0
BEND_M = 5.0
ASIDE_M = 0.3  # beside the ego's body: who is in there is in its way


def lane_edges(lane: Lane) -> tuple[Floats, Floats]:
    """Returns the left and the right edge of a lane, `2 x p` each: a point beside each of its middle."""
    step = np.diff(lane.line, axis=1)
    ahead = step / np.maximum(np.hypot(*step), 1e-9)
    along = np.concatenate((ahead[:, :1], ahead[:, :-1] + ahead[:, 1:], ahead[:, -1:]), axis=1)
    # In a bend a mitre: as far from either segment.
    length = np.maximum(np.hypot(*along), 1e-9)
    side = np.array((-along[1], along[0])) / length
    side[:, 1:-1] *= 2.0 / np.maximum(length[1:-1], 1.0)
    return lane.line + lane.width_m / 2 * side, lane.line - lane.width_m / 2 * side


@compiled
def point_at(path: Floats, station_m: float) -> tuple[float, float]:
    """Returns the place on a path at a station; its ends go on straight."""
    stations = path[STATION]
    i = 0
    while i < len(stations) - 2 and stations[i + 1] <= station_m:
        i += 1
    ahead_m, heading = station_m - stations[i], path[PATH_HEADING, i]
    return path[PATH_X, i] + ahead_m * math.cos(heading), path[PATH_Y, i] + ahead_m * math.sin(heading)


@compiled
def steering_towards(
    x_m: float, y_m: float, heading_rad: float, wheelbase_m: float, aim_x_m: float, aim_y_m: float
) -> float:
    """Returns the steering of the arc that takes the rear axle to a point (pure pursuit), rad.

    Source: Coulter 1992, "Implementation of the Pure Pursuit Path Tracking Algorithm".
    """
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    dx, dy = aim_x_m - (x_m - wheelbase_m / 2 * cos), aim_y_m - (y_m - wheelbase_m / 2 * sin)
    across, distance2 = dy * cos - dx * sin, dx * dx + dy * dy
    return math.atan2(2.0 * wheelbase_m * across, max(distance2, 1e-6))


def lane_keeping(perceived: Perceived, vehicle: Vehicle) -> float:
    """Returns the steering that keeps the ego in the middle of its lane, rad."""
    p = perceived
    return _lane_keeping(p.path, p.station_m - vehicle.length_m / 2, p.state, vehicle.wheelbase_m)


@compiled
def _lane_keeping(path: Floats, middle_m: float, state: Floats, wheelbase_m: float) -> float:
    lookahead_m = max(LOOKAHEAD_S * state[SPEED, 0], LEAST_LOOKAHEAD_M)
    aim_x_m, aim_y_m = point_at(path, middle_m + lookahead_m)
    return steering_towards(state[X, 0], state[Y, 0], state[HEADING, 0], wheelbase_m, aim_x_m, aim_y_m)


@compiled
def bend(path: Floats, point: int) -> float:
    """Returns the curvature of the path around a point, over `BEND_M`, 1/m."""
    stations, headings, last = path[STATION], path[PATH_HEADING], path.shape[1] - 1
    first = point
    while first > 0 and stations[point] - stations[first] < BEND_M / 2:
        first -= 1
    turned = 0.0
    for i in range(first + 1, last + 1):
        if stations[i] - stations[point] > BEND_M / 2:
            break
        change = headings[i] - headings[i - 1]
        turned += math.atan2(math.sin(change), math.cos(change))
    return abs(turned) / BEND_M


@compiled
def cruise_speed(path: Floats, station_m: float, comfort_mps2: float, sideways_mps2: float) -> float:
    """Returns the fastest that limits and bends, here and ahead of the front bumper, allow, m/s."""
    stations, limits = path[STATION], path[LIMIT]
    fastest = math.inf
    for i in range(len(stations)):
        if i + 1 < len(stations) and stations[i + 1] <= station_m - BEND_M:  # the rear axle is behind
            continue
        ahead_m = max(stations[i] - station_m, 0.0)
        here = min(limits[i], math.sqrt(sideways_mps2 / max(bend(path, i), 1e-6)))
        fastest = min(fastest, math.sqrt(here * here + 2.0 * comfort_mps2 * ahead_m))
    return fastest


@compiled
def leaders(path: Floats, station_m: float, offset_m: float, state: Floats, vehicle: Bools) -> Floats:
    """Returns the vehicles that are in the ego's way along its path now.

    Returns:
      `leaders x 3`: column, distance from the front bumper to the body, m, and speed along the path, m/s.
    """
    found, count = np.empty((len(vehicle), 3)), 0
    for i in range(1, len(vehicle)):
        station, across, way = project(path, state[X, i], state[Y, i])
        cos, sin = abs(math.cos(state[HEADING, i] - way)), abs(math.sin(state[HEADING, i] - way))
        half_length, half_width = state[LENGTH, i] / 2, state[WIDTH, i] / 2
        reach = state[WIDTH, 0] / 2 + ASIDE_M + half_length * sin + half_width * cos
        if not vehicle[i] or station < station_m or abs(across - offset_m) > reach:
            continue
        gap = max(station - half_length * cos - half_width * sin - station_m, 0.0)
        along = state[VX, i] * math.cos(way) + state[VY, i] * math.sin(way)
        found[count, 0], found[count, 1], found[count, 2] = i, gap, max(along, 0.0)
        count += 1
    return found[:count]
