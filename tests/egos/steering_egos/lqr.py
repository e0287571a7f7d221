"""Well-behaved ego: LQR steering along the path, IDM, and emergency braking."""

import math
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_discrete_are

from risk_sac.egos import Control, EpisodeStart, Perceived
from risk_sac.egos.driving import PATH_HEADING, STATION, Driver, needed_braking
from risk_sac.sim.lookout import project
from risk_sac.world.types import HEADING, SPEED, X, Y

HEADWAY_S = 1.5
EMERGENCY_MPS2 = 3.0  # braking that IDM alone would build up too late
PREVIEW_S, LEAST_PREVIEW_M = 0.5, 3.0
SLOWING_MPS2, WALK_MPS = -1.5, 2.0


class Lqr(Driver):
    """Follows by IDM, and steers by LQR."""

    version = "1.0"
    response_time_s = 0.3

    def reset(self, episode: EpisodeStart) -> None:
        super().reset(episode)
        self.step_s = episode.step_s

    def act(self, perceived: Perceived) -> Control:
        return Control(self.accel_mps2(perceived), self.steering_rad(perceived, self.aside_m(perceived)))

    def aside_m(self, perceived: Perceived) -> float:
        """How far left of the path to drive."""
        return 0.0

    def accel_mps2(self, perceived: Perceived) -> float:
        """IDM, and as much braking as it takes where that is much."""
        ahead = self.ahead(perceived)
        needed = needed_braking(float(perceived.state[SPEED, 0]), ahead)
        accel = self.follow(perceived, ahead, HEADWAY_S)
        return min(accel, -1.25 * needed) if needed > EMERGENCY_MPS2 else accel

    def steering_rad(self, perceived: Perceived, aside_m: float) -> float:
        """Returns the steering that takes the ego `aside_m` left of the path."""
        p, car, speed = perceived, self.vehicle, float(perceived.state[SPEED, 0])
        station, offset_m, way = project(p.path, p.state[X, 0], p.state[Y, 0])
        preview_m = max(PREVIEW_S * speed, LEAST_PREVIEW_M)
        here, ahead = np.interp([station, station + preview_m], p.path[STATION], np.unwrap(p.path[PATH_HEADING]))
        bend = math.atan(car.wheelbase_m * (ahead - here) / preview_m)
        gains = lqr_gains(max(round(speed), 1), car.wheelbase_m, self.step_s)
        steering = bend - gains @ (offset_m - aside_m, math.remainder(p.state[HEADING, 0] - way, math.tau))
        return float(np.clip(steering, -car.steering_rad, car.steering_rad))


@lru_cache
def lqr_gains(speed_mps: int, wheelbase_m: float, step_s: float) -> np.ndarray:
    """Returns gains on offset and heading errors of a kinematic bicycle."""
    a = np.array([[1.0, speed_mps * step_s], [0.0, 1.0]])
    b = np.array([[0.0], [speed_mps * step_s / wheelbase_m]])
    cost, effort = np.diag([1.0, 2.0]), np.array([[8.0]])
    p = solve_discrete_are(a, b, cost, effort)
    return np.linalg.solve(effort + b.T @ p @ b, b.T @ p @ a)[0]


class Crawler(Lqr):
    """Slows down to a walk."""

    version = "1.0"
    response_time_s = 0.3

    def accel_mps2(self, perceived: Perceived) -> float:
        ahead = super().accel_mps2(perceived)
        return min(ahead, SLOWING_MPS2 if perceived.state[SPEED, 0] > WALK_MPS else 0.0)
