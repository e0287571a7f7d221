"""From actions in [-1, 1] to commands that keep an adversary's kinematic limits.

Vehicles take (longitudinal acceleration, lateral velocity), pedestrians (acceleration, heading rate).
Each limit holds on the motion that is driven, not only on what was asked for: acceleration tapers before
standstill and top speed, and lateral speed before the road's edge, so that no clipping causes a jolt.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.families import Family
from risk_sac.scenario.limits import Limits
from risk_sac.sim.sumo import Room, SumoSimulation, VehicleCommand, Walker
from risk_sac.types import STEP_S, Floats, Frame


def _taper(distance: float, rate: float) -> float:
    """Largest value that falls to 0 by at most `rate` per second while its sum over steps stays within `distance`.

    With decrements of c = rate·dt and D = distance/dt, k full decrements fit, k(k+1)/2·c <= D, and the rest is
    spread over k + 1 steps. The continuous √(2·rate·distance) would overshoot by up to half a decrement.
    """
    if distance <= 0.0:
        return 0.0
    change, total = rate * STEP_S, distance / STEP_S
    full = int((math.sqrt(1.0 + 8.0 * total / change) - 1.0) / 2.0)
    return full * change / 2.0 + total / (full + 1)


def _clip(value: float, low: float, high: float) -> float:
    return low if value < low else high if value > high else value


@dataclass(slots=True)
class VehicleControl:
    """Turns actions into bounded speed and lateral speed; remembers what it last commanded."""

    limits: Limits
    speed_mps: float
    accel_mps2: float = 0.0
    lateral_mps: float = 0.0

    def step(self, drive: float, steer: float, room: Room) -> VehicleCommand:
        """One step of 0.1 s.

        Args:
          drive: longitudinal acceleration as a share of the limit, -1 (hardest braking) to 1.
          steer: lateral velocity as a share of the limit, -1 (right) to 1 (left).
          room: what is left of the road on both sides.
        """
        limits = self.limits
        wanted = drive * (limits.accel_mps2 if drive >= 0 else limits.brake_mps2)
        change = limits.jerk_mps3 * STEP_S
        low = max(-limits.brake_mps2, -_taper(self.speed_mps, limits.jerk_mps3))
        high = min(limits.accel_mps2, _taper(limits.speed_mps - self.speed_mps, limits.jerk_mps3))
        self.accel_mps2 = _clip(_clip(wanted, low, high), self.accel_mps2 - change, self.accel_mps2 + change)
        self.speed_mps = _clip(self.speed_mps + self.accel_mps2 * STEP_S, 0.0, limits.speed_mps)

        change = limits.lateral_accel_mps2 * STEP_S
        reach = min(limits.lateral_mps, limits.slip * self.speed_mps)  # a car cannot slide sideways
        left = min(reach, _taper(room.left_m, limits.lateral_accel_mps2))
        right = min(reach, _taper(room.right_m, limits.lateral_accel_mps2))
        wanted = _clip(steer * limits.lateral_mps, -right, left)
        self.lateral_mps = _clip(wanted, self.lateral_mps - change, self.lateral_mps + change)
        return VehicleCommand(self.speed_mps, self.lateral_mps)


@dataclass(slots=True)
class PedestrianControl:
    """Integrates a pedestrian's motion under bounded acceleration and heading rate."""

    limits: Limits
    state: Walker

    def step(self, drive: float, turn: float) -> Walker:
        """One step of 0.1 s.

        Args:
          drive: acceleration as a share of the limit, -1 to 1.
          turn: heading rate as a share of the limit, -1 (clockwise) to 1.
        """
        limits, state = self.limits, self.state
        wanted = drive * (limits.walk_accel_mps2 if drive >= 0 else limits.walk_brake_mps2)
        speed = _clip(state.speed_mps + wanted * STEP_S, 0.0, limits.walk_speed_mps)
        heading = state.heading_rad + turn * limits.heading_rate_radps * STEP_S
        distance = (state.speed_mps + speed) / 2 * STEP_S
        self.state = Walker(
            x_m=state.x_m + distance * math.cos(heading),
            y_m=state.y_m + distance * math.sin(heading),
            heading_rad=heading,
            speed_mps=speed,
            accel_mps2=(speed - state.speed_mps) / STEP_S,
        )
        return self.state


TOLERANCE = 0.02  # m/s² and m/s: SUMO's rounding, divided by the step


class Adversaries:
    """All adversaries of an episode: splits the joint action, and checks what was driven."""

    def __init__(self, family: Family, limits: Limits, frame: Frame) -> None:
        speed = dict(zip(frame.ids, frame.speed_mps.tolist(), strict=True))
        self._limits = limits
        self._vehicles = {id_: VehicleControl(limits, speed[id_]) for id_ in family.vehicles}
        self._pedestrians = {}
        for id_ in family.pedestrians:
            row = frame.ids.index(id_)
            walker = Walker(
                float(frame.x_m[row]), float(frame.y_m[row]), float(frame.heading_rad[row]), float(frame.speed_mps[row])
            )
            self._pedestrians[id_] = PedestrianControl(limits, walker)
        self._order = family.adversaries
        self._ids: tuple[str, ...] = ()

    def command(self, action: Sequence[float], sim: SumoSimulation) -> None:
        """Sends one joint action, two entries per adversary in the family's order."""
        first, second = action[::2], action[1::2]
        vehicles = {}
        for k, (id_, control) in enumerate(self._vehicles.items()):
            room = sim.room(id_)
            if room is not None:
                vehicles[id_] = control.step(first[k], second[k], room)
        k = len(self._vehicles)
        walkers = {
            id_: control.step(first[k + j], second[k + j]) for j, (id_, control) in enumerate(self._pedestrians.items())
        }
        sim.apply(vehicles, walkers)

    def rows(self, frame: Frame) -> NDArray[np.intp]:
        """Rows of the frame that hold adversaries."""
        if frame.ids is not self._ids:
            self._ids = frame.ids
            present = [id_ for id_ in self._order if id_ in frame.ids]
            self._rows = np.array([frame.ids.index(id_) for id_ in present], dtype=np.intp)
            self._driven = [(frame.ids.index(id_), self._vehicles[id_]) for id_ in present if id_ in self._vehicles]
            vehicle_limit = max(self._limits.accel_mps2, self._limits.brake_mps2)
            walker_limit = max(self._limits.walk_accel_mps2, self._limits.walk_brake_mps2)
            limits = [vehicle_limit if id_ in self._vehicles else walker_limit for id_ in present]
            self._accel_limits = np.array(limits)
        return self._rows

    def accel_limits(self, frame: Frame) -> Floats:
        """Greatest absolute acceleration of each actor in `rows`, m/s²."""
        self.rows(frame)
        return self._accel_limits

    def keep_limits(self, frame: Frame) -> bool:
        """Whether every adversary vehicle drove as commanded, and so inside its limits.

        Less lateral motion than commanded passes: SUMO pauses it for some steps where a vehicle enters a junction.
        Pedestrians move by our own dynamics and cannot deviate. The controls go on from what was driven.
        """
        self.rows(frame)
        kept = True
        for row, control in self._driven:
            speed, lateral = float(frame.speed_mps[row]), float(frame.lateral_mps[row])
            kept &= abs(speed - control.speed_mps) <= TOLERANCE and abs(lateral) <= abs(control.lateral_mps) + TOLERANCE
            control.speed_mps, control.lateral_mps = speed, lateral
        return kept
