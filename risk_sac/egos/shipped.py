"""Shipped egos: IDM with emergency braking, UN R157, RSS, and broken."""

import math
from collections import deque

import numpy as np

from risk_sac.egos.driving import Driver, idm, needed_braking, stop_at_signal, time_to_collision
from risk_sac.egos.seam import Control, EpisodeStart, Perceived
from risk_sac.risk.rss import lateral, opposite_direction, same_direction
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.sim.lookout import BEHIND_M, BEYOND_M, project, stretch
from risk_sac.verdicts.course import HORIZON_S, LEADER_BRAKES_MPS2
from risk_sac.verdicts.drivers import R157_DELAY_S, R157_PERCEIVES_S, r157
from risk_sac.world.types import HEADING, LENGTH, SPEED, VX, VY, WIDTH, X, Y

CRUISE_MPS2 = 3.5  # what ISO 15622 lets a cruise control brake with
IDM_HEADWAY_S = 1.5
WARNING_S = 0.8  # the regulation's warning before the emergency braking,
WARN_TTC_S, WARN_MPS2 = 2.6, 3.0
AT_ONCE_MPS2 = 5.0  # which is left out where the danger could not be seen coming
AEB_MPS2 = 7.0  # Choice: the regulation asks for 5 or more; cars on sale do about 7


class IdmAeb(Driver):
    """Follows by IDM with a cruise control's braking; in an emergency it warns for 0.8 s, then brakes by 7 m/s².

    What it could not warn of it brakes for at once.
    """

    version = "1.0"
    response_time_s = 0.8

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode, without a warning."""
        super().reset(episode)
        self._warned_s: float | None = None

    def act(self, perceived: Perceived) -> Control:
        """Follows, warns, brakes."""
        speed, now = float(perceived.state[SPEED, 0]), perceived.time_s
        ahead = self.ahead(perceived)
        needed_mps2 = needed_braking(speed, ahead)
        if time_to_collision(speed, ahead) < WARN_TTC_S or needed_mps2 > WARN_MPS2:
            self._warned_s = now if self._warned_s is None else self._warned_s
        else:
            self._warned_s = None
        accel = max(self.follow(perceived, ahead, IDM_HEADWAY_S), -CRUISE_MPS2)
        warned = self._warned_s is not None and now - self._warned_s >= WARNING_S
        if needed_mps2 > AT_ONCE_MPS2 or (warned and needed_mps2 > WARN_MPS2):
            accel = min(accel, -AEB_MPS2)
        return self.keeping_lane(perceived, accel)


R157_HEADWAY_S = 2.0  # which the regulation's driver keeps
RISK_TTC_S = 2.0  # below which the regulation's driver perceives a risk
RISK_BRAKING_MPS2 = 3.4  # Choice: or where a gentle braking no longer does
OVER_S = 1.0  # a risk that has been gone for so long is over


class R157(Driver):
    """Follows by IDM and brakes as UN R157's human driver."""

    version = "1.0"
    response_time_s = 1.15

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode, without a risk."""
        super().reset(episode)
        self._since_s: float | None = None
        self._last_s = 0.0

    def act(self, perceived: Perceived) -> Control:
        """Follows, and brakes for what it has perceived as a risk long enough ago."""
        speed, now = float(perceived.state[SPEED, 0]), perceived.time_s
        ahead = self.ahead(perceived)
        if (
            time_to_collision(speed, ahead) <= RISK_TTC_S
            or needed_braking(speed, ahead) > RISK_BRAKING_MPS2
            or any(each.braking_mps2 > LEADER_BRAKES_MPS2 and each.gap_m < HORIZON_S * speed for each in ahead)
        ):
            self._since_s, self._last_s = (now if self._since_s is None else self._since_s), now
        elif self._since_s is not None and now - self._last_s > OVER_S:
            self._since_s = None
        accel = self.follow(perceived, ahead, R157_HEADWAY_S)
        if self._since_s is not None:
            # Until it has perceived the risk, it drives on; what it then does is the regulation's.
            braked_s = now - self._since_s - R157_PERCEIVES_S
            reflex = r157(braked_s, self.vehicle.brake_mps2) if braked_s >= 0.0 else 0.0
            accel = min(max(accel, -RISK_BRAKING_MPS2), -reflex) if braked_s < R157_DELAY_S else min(accel, -reflex)
        return self.keeping_lane(perceived, accel)


RSS = RssParameters(response_s=0.3, brake_min_mps2=6.0, brake_max_mps2=8.0)
REACH_M = 80.0
RSS_HEADWAY_S = 1.0


class RssResponder(Driver):
    """Follows by IDM, and brakes by 6 m/s² while a distance is unsafe by RSS."""

    version = "1.0"
    response_time_s = 0.3

    def reset(self, episode: EpisodeStart) -> None:
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
        accel = self.follow(p, self.ahead(p), RSS_HEADWAY_S)
        if self._since_s is not None and p.time_s - self._since_s >= RSS.response_s - 1e-6:
            accel = min(accel, -RSS.brake_min_mps2)
        return self.keeping_lane(p, accel)


def dangerous(perceived: Perceived, column: int) -> bool:
    """Whether the distances to a body ahead, along the path and across it, are both smaller than RSS's."""
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


LATE_STEPS = 10  # it acts on what it perceived a second ago
SIGHT_M = 20.0
BROKEN_HEADWAY_S = 1.0


class Broken(Driver):
    """Acts on what it perceived a second ago, and perceives nothing beyond 20 m: wrong on purpose."""

    version = "1.0"
    response_time_s = 1.0

    def reset(self, episode: EpisodeStart) -> None:
        """Begins an episode."""
        super().reset(episode)
        self._decided: deque[float] = deque([0.0] * LATE_STEPS)

    def act(self, perceived: Perceived) -> Control:
        """Does what it decided a second ago, but steers in time."""
        p = perceived
        near = np.hypot(p.state[X] - p.state[X, 0], p.state[Y] - p.state[Y, 0]) < SIGHT_M
        seen = p._replace(
            ids=tuple(id_ for id_, is_near in zip(p.ids, near, strict=True) if is_near),
            kind=p.kind[near],
            state=np.compress(near, p.state, axis=1),
        )
        signal = stop_at_signal(p) if p.stop_line_m < SIGHT_M else []
        self._decided.append(idm(seen, self.vehicle, [*self.ahead(seen), *signal], BROKEN_HEADWAY_S))
        return self.keeping_lane(p, self._decided.popleft())
