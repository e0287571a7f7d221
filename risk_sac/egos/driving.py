"""Driving along a perceived path: lane keeping, leaders, IDM and braking."""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.egos.seam import Control, EpisodeStart, Perceived, Vehicle
from risk_sac.sim.lookout import project, targets
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, Bools, Floats, Kind, Lane, Signal, X, Y

# Rows of a path, as in `risk_sac.sim.paths`.
PATH_X, PATH_Y = 0, 1
STATION = 2  # length of the line up to each point, m
PATH_HEADING = 3  # heading of the segment that begins at the point, rad
LIMIT = 4  # highest speed at the point, m/s; low in bends

LOOKAHEAD_S, LEAST_LOOKAHEAD_M = 0.6, 5.0
BEND_M = 5.0
ASIDE_M = 0.3  # free width on each side of the ego's body; a vehicle within it is in the way


def lane_edges(lane: Lane) -> tuple[Floats, Floats]:
    """Returns a lane's left and right edge, `2 x p` each."""
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
    """Returns a path's place at a station; its ends continue straight."""
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
    """Returns pure pursuit's steering of the rear axle to a point, rad.

    Source: Coulter 1992, "Implementation of the Pure Pursuit Path Tracking Algorithm".
    """
    cos, sin = math.cos(heading_rad), math.sin(heading_rad)
    dx, dy = aim_x_m - (x_m - wheelbase_m / 2 * cos), aim_y_m - (y_m - wheelbase_m / 2 * sin)
    across, distance2 = dy * cos - dx * sin, dx * dx + dy * dy
    return math.atan2(2.0 * wheelbase_m * across, max(distance2, 1e-6))


def lane_keeping(perceived: Perceived, vehicle: Vehicle) -> float:
    """Returns the steering that keeps the ego mid-lane, rad."""
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
    """Returns the fastest speed for limits and bends here and ahead, m/s."""
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
    """Returns the vehicles in the ego's way along its path now.

    Returns:
      `leaders x 3`: column, distance from the front bumper to the body, m, and speed along the path, m/s.
    """
    rows, count = np.empty((len(vehicle), 3)), 0
    for i in range(1, len(vehicle)):
        station, across, way = project(path, state[X, i], state[Y, i])
        cos, sin = abs(math.cos(state[HEADING, i] - way)), abs(math.sin(state[HEADING, i] - way))
        half_length, half_width = state[LENGTH, i] / 2, state[WIDTH, i] / 2
        reach = state[WIDTH, 0] / 2 + ASIDE_M + half_length * sin + half_width * cos
        if not vehicle[i] or station < station_m or abs(across - offset_m) > reach:
            continue
        gap = max(station - half_length * cos - half_width * sin - station_m, 0.0)
        along = state[VX, i] * math.cos(way) + state[VY, i] * math.sin(way)
        rows[count, 0], rows[count, 1], rows[count, 2] = i, gap, max(along, 0.0)
        count += 1
    return rows[:count]


VEHICLE = int(Kind.VEHICLE)
COMFORT_MPS2 = 2.0  # comfortable braking
SIDEWAYS_MPS2 = 3.0  # lateral acceleration in a bend
STANDSTILL_M = 2.5
SETTLE_S = 0.5
STOP_LINE_M = 1.0  # distance from the stop line at which to stop
LAST_STOP_MPS2 = 4.5  # a yellow signal that takes more braking than this is passed


class Ahead(NamedTuple):
    """Something to follow or to stop for."""

    gap_m: float  # from the front bumper
    speed_mps: float  # at which it leads, 0 for what stands or crosses
    braking_mps2: float = 0.0  # with which it has slowed down since the frame before


class Driver:
    """Base of egos in Python: looks out for others and their braking."""

    vehicle: Vehicle

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode."""
        self.vehicle, self._step_s = episode.vehicle, episode.step_s
        self._speeds: dict[str, float] = {}

    def close(self) -> None:
        """Releases nothing."""

    def ahead(self, perceived: Perceived) -> list[Ahead]:
        """Returns leaders and others on a collision course, see `risk_sac.sim.lookout`."""
        p, everybody = perceived, np.ones(len(perceived.ids), dtype=np.bool_)
        conflicts = targets(
            p.path, p.station_m, p.offset_m, 0, self.vehicle.accel_mps2, p.state, p.kind == VEHICLE, everybody
        )
        before, self._speeds = self._speeds, dict(zip(p.ids, p.state[SPEED].tolist(), strict=True))
        everything = (
            *conflicts.tolist(),
            *leaders(p.path, p.station_m, p.offset_m, p.state, p.kind == VEHICLE).tolist(),
        )
        return [Ahead(gap_m, lead_mps, self._braking(before, p.ids[int(i)])) for i, gap_m, lead_mps in everything]

    def _braking(self, before: dict[str, float], id_: str) -> float:
        now = self._speeds[id_]
        return max(before.get(id_, now) - now, 0.0) / self._step_s

    def follow(self, perceived: Perceived, ahead: list[Ahead], headway_s: float) -> float:
        """Returns `idm`'s acceleration behind those ahead and before a signal, m/s²."""
        return idm(perceived, self.vehicle, [*ahead, *stop_at_signal(perceived)], headway_s)

    def keeping_lane(self, perceived: Perceived, accel_mps2: float) -> Control:
        """Returns a command that keeps the lane."""
        return Control(accel_mps2, lane_keeping(perceived, self.vehicle))


def stop_at_signal(perceived: Perceived) -> list[Ahead]:
    """Returns the stop line of a red or a stoppable yellow signal."""
    p = perceived
    gap_m = p.stop_line_m - STOP_LINE_M
    if not math.isfinite(gap_m) or p.stop_line_m < 0.0 or p.signal not in (Signal.RED, Signal.YELLOW):
        return []
    speed = float(p.state[SPEED, 0])
    if p.signal is Signal.YELLOW and speed * speed > 2.0 * LAST_STOP_MPS2 * max(p.stop_line_m, 0.01):
        return []
    return [Ahead(max(gap_m, 0.0), 0.0)]


def idm(perceived: Perceived, vehicle: Vehicle, ahead: list[Ahead], headway_s: float) -> float:
    """Returns the intelligent driver model's acceleration for the vehicles ahead, m/s².

    a = a_max [1 − (v / v₀)⁴ − (s* / s)²],  s* = s₀ + v T + v Δv / (2 √(a_max b))

    Choice: an ego that is too fast slows down within `SETTLE_S`; the model's own way is too slow for junctions' bends.

    Source: Treiber, Hennecke, Helbing 2000, "Congested traffic states in empirical observations and microscopic
    simulations".
    """
    speed = float(perceived.state[SPEED, 0])
    wanted = max(float(cruise_speed(perceived.path, perceived.station_m, COMFORT_MPS2, SIDEWAYS_MPS2)), 0.1)
    closest = 0.0
    for gap_m, lead_mps, _ in ahead:
        closing = speed * (speed - lead_mps) / (2.0 * math.sqrt(vehicle.accel_mps2 * COMFORT_MPS2))
        distance = STANDSTILL_M + max(speed * headway_s + closing, 0.0)
        closest = max(closest, distance / max(gap_m, 0.1))
    free = 1.0 - (speed / wanted) ** 4 if speed <= wanted else (wanted - speed) / SETTLE_S / vehicle.accel_mps2
    return max(vehicle.accel_mps2 * (free - closest**2), -vehicle.brake_mps2)


def time_to_collision(speed_mps: float, ahead: list[Ahead]) -> float:
    """Returns the time to reach the first of `ahead`, s; else inf."""
    closing = ((each.gap_m, speed_mps - each.speed_mps) for each in ahead)
    return min((gap_m / closing_mps for gap_m, closing_mps in closing if closing_mps > 1e-6), default=math.inf)


def needed_braking(speed_mps: float, ahead: list[Ahead]) -> float:
    """Returns the least braking that avoids all of `ahead`, m/s²."""
    return max((_needed(speed_mps, each) for each in ahead), default=0.0)


def _needed(speed_mps: float, ahead: Ahead) -> float:
    gap_m, lead_mps, lead_braking = max(ahead.gap_m, 0.01), ahead.speed_mps, ahead.braking_mps2
    needed = max(speed_mps - lead_mps, 0.0) ** 2 / (2.0 * gap_m)
    if lead_braking > COMFORT_MPS2:  # it stops, and so does the ego behind it
        needed = max(needed, speed_mps**2 / (2.0 * (gap_m + lead_mps**2 / (2.0 * lead_braking))))
    return needed
