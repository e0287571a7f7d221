"""A planner under RSS's proper response: drive as you like, but where both distances are too small, brake."""

import math

from risk_sac.egos.driving import Driver
from risk_sac.egos.seam import Control, Episode, Perceived
from risk_sac.risk.rss import lateral, opposite_direction, same_direction
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.sim.lookout import BEHIND_M, BEYOND_M, project, stretch
from risk_sac.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, X, Y

RSS = RssParameters(response_s=0.3, brake_min_mps2=6.0, brake_max_mps2=8.0)
REACH_M = 80.0
HEADWAY_S = 1.0


class RssResponder(Driver):
    """Follows by IDM, and brakes by 6 m/s² from 0.3 s after a distance became unsafe by RSS until it is safe again."""

    version = "1.0"
    response_time_s = 0.3

    def reset(self, episode: Episode) -> None:
        """Begins an episode, in safety."""
        super().reset(episode)
        self._since_s: float | None = None

    def act(self, perceived: Perceived) -> Control:
        """Follows, or responds."""
        p = perceived
        if any(dangerous(p, column) for column in range(1, len(p.ids))):
            self._since_s = p.time_s if self._since_s is None else self._since_s
        else:
            self._since_s = None
        accel = self.follow(p, self.ahead(p), HEADWAY_S)
        if self._since_s is not None and p.time_s - self._since_s >= RSS.response_s - 1e-6:
            accel = min(accel, -RSS.brake_min_mps2)
        return self.keeping_lane(p, accel)


def dangerous(perceived: Perceived, column: int) -> bool:
    """Whether the distances to somebody ahead, along the path and across it, are both smaller than RSS's."""
    p, state = perceived, perceived.state
    near = stretch(p.path, p.station_m - BEHIND_M, p.station_m + REACH_M + BEYOND_M)
    station, across, way = project(near, state[X, column], state[Y, column])
    cos, sin = abs(math.cos(state[HEADING, column] - way)), abs(math.sin(state[HEADING, column] - way))
    half_length, half_width = state[LENGTH, column] / 2, state[WIDTH, column] / 2
    gap_m = station - half_length * cos - half_width * sin - p.station_m
    if station < p.station_m - state[LENGTH, 0] or gap_m > REACH_M:
        return False  # who is behind keeps the distance itself
    vx, vy, speed = state[VX, column], state[VY, column], state[SPEED, 0]
    along = vx * math.cos(way) + vy * math.sin(way)
    aside = vy * math.cos(way) - vx * math.sin(way)
    wanted_m = opposite_direction(speed, -along, RSS) if along < 0.0 else same_direction(speed, along, RSS)
    side = 1.0 if across > p.offset_m else -1.0
    clear_m = abs(across - p.offset_m) - state[WIDTH, 0] / 2 - half_length * sin - half_width * cos
    return bool(gap_m < wanted_m and clear_m < lateral(0.0, -side * aside, RSS))
