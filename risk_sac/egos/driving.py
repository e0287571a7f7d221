"""Shared by the shipped egos: what to look out for, how fast to go, when to stop at a signal."""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.egos.road import cruise_speed, lane_keeping, leaders
from risk_sac.egos.seam import Control, Episode, Perceived, Vehicle
from risk_sac.sim.lookout import targets
from risk_sac.types import SPEED, Kind, Signal

VEHICLE = int(Kind.VEHICLE)
COMFORT_MPS2 = 2.0  # comfortable braking
SIDEWAYS_MPS2 = 3.0  # in a bend
STANDSTILL_M = 2.5
SETTLE_S = 0.5
STOP_LINE_M = 1.0  # how far before it to stop
LAST_STOP_MPS2 = 4.5  # a yellow signal that takes more braking than that is passed


class Ahead(NamedTuple):
    """Something to follow or to stop for."""

    gap_m: float  # from the front bumper
    speed_mps: float  # at which it leads, 0 for what stands or crosses
    braking_mps2: float = 0.0  # with which it has slowed down since the frame before


class Driver:
    """Base of egos in Python: looks out for others, and for how hard they brake."""

    vehicle: Vehicle

    def reset(self, episode: Episode) -> None:
        """Begins an episode."""
        self.vehicle, self._step_s = episode.vehicle, episode.step_s
        self._speeds: dict[str, float] = {}

    def close(self) -> None:
        """Releases nothing."""

    def ahead(self, perceived: Perceived) -> list[Ahead]:
        """Returns what is on a collision course at constant velocity, see `risk_sac.sim.lookout`, and what leads."""
        p, everybody = perceived, np.ones(len(perceived.ids), dtype=np.bool_)
        found = targets(
            p.path, p.station_m, p.offset_m, 0, self.vehicle.accel_mps2, p.state, p.kind == VEHICLE, everybody
        )
        before, self._speeds = self._speeds, dict(zip(p.ids, p.state[SPEED].tolist(), strict=True))
        everything = (*found.tolist(), *leaders(p.path, p.station_m, p.offset_m, p.state, p.kind == VEHICLE).tolist())
        return [Ahead(gap_m, lead_mps, self._braking(before, p.ids[int(i)])) for i, gap_m, lead_mps in everything]

    def _braking(self, before: dict[str, float], id_: str) -> float:
        now = self._speeds[id_]
        return max(before.get(id_, now) - now, 0.0) / self._step_s

    def follow(self, perceived: Perceived, ahead: list[Ahead], headway_s: float) -> float:
        """Returns the acceleration of `idm` behind those ahead and before a signal, m/s²."""
        return idm(perceived, self.vehicle, [*ahead, *stop_at_signal(perceived)], headway_s)

    def keeping_lane(self, perceived: Perceived, accel_mps2: float) -> Control:
        """Returns a command that keeps the lane."""
        return Control(accel_mps2, lane_keeping(perceived, self.vehicle))


def stop_at_signal(perceived: Perceived) -> list[Ahead]:
    """Returns the stop line of a red signal, or of a yellow one before which it can still stop."""
    p = perceived
    gap_m = p.stop_line_m - STOP_LINE_M
    if not math.isfinite(gap_m) or p.stop_line_m < 0.0 or p.signal not in (Signal.RED, Signal.YELLOW):
        return []
    speed = float(p.state[SPEED, 0])
    if p.signal is Signal.YELLOW and speed * speed > 2.0 * LAST_STOP_MPS2 * max(p.stop_line_m, 0.01):
        return []
    return [Ahead(max(gap_m, 0.0), 0.0)]


def idm(perceived: Perceived, vehicle: Vehicle, ahead: list[Ahead], headway_s: float) -> float:
    """Returns the acceleration of the intelligent driver model behind the nearest of those ahead, m/s².

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
    """Returns the time until the first of those ahead is reached at the present speeds, s; inf if none is."""
    closing = ((each.gap_m, speed_mps - each.speed_mps) for each in ahead)
    return min((gap_m / closing_mps for gap_m, closing_mps in closing if closing_mps > 1e-6), default=math.inf)


def needed_braking(speed_mps: float, ahead: list[Ahead]) -> float:
    """Returns the braking that just avoids all of those ahead, if they go on as they do, m/s²."""
    return max((_needed(speed_mps, each) for each in ahead), default=0.0)


def _needed(speed_mps: float, ahead: Ahead) -> float:
    gap_m, lead_mps, lead_braking = max(ahead.gap_m, 0.01), ahead.speed_mps, ahead.braking_mps2
    needed = max(speed_mps - lead_mps, 0.0) ** 2 / (2.0 * gap_m)
    if lead_braking > COMFORT_MPS2:  # it stops, and so does the ego behind it
        needed = max(needed, speed_mps**2 / (2.0 * (gap_m + lead_mps**2 / (2.0 * lead_braking))))
    return needed
