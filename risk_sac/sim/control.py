"""From actions in [-1, 1] to commands that keep an adversary's kinematic limits.

Vehicles take (longitudinal acceleration, lateral velocity), pedestrians (acceleration, heading rate).
Each limit holds on the motion that is driven, not only on what was asked for: acceleration tapers before
standstill and top speed, speed before a bend, and lateral speed before the road's edge, so that no clipping
causes a jolt.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.jit import compiled
from risk_sac.scenario.family import Family
from risk_sac.scenario.limits import Limits
from risk_sac.sim.bends import BODY_M, CAP, HERE, SOON, bends, index
from risk_sac.sim.commands import VehicleCommand, Walker
from risk_sac.sim.paths import Along, Path
from risk_sac.sim.roads import Room
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.types import STEP_S, Floats, Frame

CORRECTION_PER_M = 0.05  # curvature that is left for steering in the tightest bend, and so before a road's edge
EDGE_M = 0.03  # of the road that is kept free: what a car overshoots by that brakes while it straightens
SKID = 0.98  # who is too fast for a curve keeps a fifth of its grip for braking, or it would never slow down


@compiled
def _taper(distance: float, rate: float) -> float:
    """Largest value that falls to 0 by at most `rate` per second while its sum over steps stays within `distance`.

    With decrements of c = rate·dt and D = distance/dt, k full decrements fit, k(k+1)/2·c <= D, and the rest is
    spread over k + 1 steps. The continuous √(2·rate·distance) would overshoot by up to half a decrement.
    """
    if distance <= 0.0 or rate <= 0.0:
        return 0.0
    change, total = rate * STEP_S, distance / STEP_S
    full = int((math.sqrt(1.0 + 8.0 * total / change) - 1.0) / 2.0)
    return full * change / 2.0 + total / (full + 1)


@compiled
def _clip(value: float, low: float, high: float) -> float:
    return low if value < low else high if value > high else value


class Bounds(NamedTuple):
    """What compiled code knows of a vehicle's `Limits`; named as there."""

    speed_mps: float
    accel_mps2: float
    brake_mps2: float
    grip_mps2: float
    jerk_mps3: float
    lateral_mps: float
    lateral_accel_mps2: float
    curvature_per_m: float
    cornering_mps2: float
    slip: float
    preview_s: float  # as long as it takes to get from full acceleration to the braking that bends are approached with

    @classmethod
    def of(cls, limits: Limits) -> "Bounds":
        """Those of some limits."""
        preview_s = (limits.accel_mps2 + limits.approach_mps2) / limits.jerk_mps3
        return cls(**{name: getattr(limits, name) for name in cls._fields[:-1]}, preview_s=preview_s)


@dataclass(slots=True)
class VehicleControl:
    """Turns actions into bounded speed and lateral speed; remembers what it last commanded.

    The friction circle is shared in this order: the bend of the lane, a lane change, braking and accelerating.
    """

    limits: Limits
    speed_mps: float
    accel_mps2: float = 0.0
    lateral_mps: float = 0.0
    _bounds: Floats = field(init=False)
    _path: Path | None = field(init=False, default=None)
    _bends: Floats = field(init=False)  # of that path
    _at_m: float = field(init=False, default=0.0)  # where on it
    _behind_per_m: float = field(init=False, default=0.0)  # bend before that path, which the body has yet to leave

    def __post_init__(self) -> None:
        self._bounds = np.array(Bounds.of(self.limits))

    def step(self, drive: float, steer: float, room: Room, along: Along, intended_mps2: float = 0.0) -> VehicleCommand:
        """One step of 0.1 s.

        Args:
          drive: longitudinal acceleration as a share of the limit, -1 (hardest braking) to 1.
          steer: lateral velocity as a share of the limit, -1 (right) to 1 (left).
          room: what is left of the road on both sides.
          along: where it is on the path it takes if it does not steer.
          intended_mps2: what its driver would do if nobody commanded it.
        """
        if along.path is not self._path:
            if self._path is not None:
                self._behind_per_m = float(self._bends[SOON, index(self._bends, self._at_m)])
            self._path, self._bends = along.path, bends(along.path, self.limits)
        self._at_m = along.station_m
        self.speed_mps, self.accel_mps2, self.lateral_mps = _drive(
            self._bounds,
            self._bends,
            along.station_m,
            self._behind_per_m,
            self.speed_mps,
            self.accel_mps2,
            self.lateral_mps,
            drive,
            steer,
            room.left_m,
            room.right_m,
            intended_mps2,
        )
        return VehicleCommand(self.speed_mps, self.lateral_mps)


@compiled
def _drive(
    bounds: Floats,
    bends: Floats,
    station_m: float,
    behind_per_m: float,
    speed: float,
    accel: float,
    lateral: float,
    drive: float,
    steer: float,
    left_m: float,
    right_m: float,
    intended: float,
) -> tuple[float, float, float]:
    """Speed, acceleration and lateral speed of the next step."""
    b = bounds
    limits = Bounds(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10])
    at, soon = index(bends, station_m), index(bends, station_m + speed * limits.preview_s)
    behind = behind_per_m if station_m < BODY_M else 0.0
    curvature, ahead = max(bends[HERE, at], behind), max(bends[SOON, at], behind)
    cap = min(bends[CAP, at], bends[CAP, soon])
    accel = _accelerate(limits, speed, accel, drive, intended, curvature, ahead, cap)
    after = _clip(speed + accel * STEP_S, 0.0, limits.speed_mps)
    left_over = max(limits.curvature_per_m - curvature, CORRECTION_PER_M)
    return after, accel, _steer(limits, speed, after, lateral, steer, left_m, right_m, left_over)


@compiled
def _accelerate(
    limits: Bounds,
    speed: float,
    accel: float,
    drive: float,
    intended: float,
    curvature: float,
    ahead: float,
    cap_mps: float,
) -> float:
    # Choice: the less a command says, the more the driver's own intention counts. Doing nothing is then to drive on
    # as anybody would, and not to run into whoever stands ahead or over a red light.
    wanted = drive * (limits.accel_mps2 if drive >= 0 else limits.brake_mps2) + (1.0 - abs(drive)) * intended
    bend = max(curvature * speed**2, min(ahead * speed**2, limits.cornering_mps2))
    across = min(bend + limits.lateral_accel_mps2, SKID * limits.grip_mps2)
    grip = math.sqrt(limits.grip_mps2**2 - across**2)
    low = max(-limits.brake_mps2, -grip, -_taper(speed, limits.jerk_mps3))
    high = min(limits.accel_mps2, grip, _taper(limits.speed_mps - speed, limits.jerk_mps3))
    high = max(min(high, (cap_mps - speed) / limits.preview_s), low)
    change = limits.jerk_mps3 * STEP_S
    return _clip(_clip(wanted, low, high), accel - change, accel + change)


@compiled
def _steer(
    limits: Bounds,
    before: float,
    speed: float,
    lateral: float,
    steer: float,
    left_m: float,
    right_m: float,
    curvature: float,
) -> float:
    """Moves across the lane as a car can: on a path whose curvature is bounded, so not at a standstill.

    Keeping its heading, a car that brakes loses lateral speed with the longitudinal; `limits.slip` is such that
    this alone is within the limit on lateral acceleration, and both bounds below always leave something.
    """
    rate = min(limits.lateral_accel_mps2, CORRECTION_PER_M * speed**2)
    room_m = (left_m if steer >= 0 else right_m) - EDGE_M
    reach = min(limits.lateral_mps, limits.slip * speed, _taper(room_m, rate))
    wanted = _clip(steer * limits.lateral_mps, -reach, reach)
    same_heading = lateral * speed / before if before > 0.0 else 0.0
    turn, change = curvature * speed**2 * STEP_S, limits.lateral_accel_mps2 * STEP_S
    wanted = _clip(wanted, same_heading - turn, same_heading + turn)
    return _clip(wanted, lateral - change, lateral + change)


@dataclass(slots=True)
class PedestrianControl:
    """Integrates a pedestrian's motion; along and across its heading it accelerates on a disc.

    Source: that heading rate falls with about 1/speed, Wang et al., A kinematic constraint on pedestrian walking
    (arXiv 2506.15321).
    """

    limits: Limits
    state: Walker
    across_mps2: float = 0.0

    def step(self, drive: float, turn: float) -> Walker:
        """One step of 0.1 s.

        Args:
          drive: acceleration as a share of the limit, -1 to 1.
          turn: heading rate as a share of what the speed allows, -1 (clockwise) to 1.
        """
        limits, state = self.limits, self.state
        accel, self.across_mps2 = self._accelerate(drive, turn)
        speed = _clip(state.speed_mps + accel * STEP_S, 0.0, limits.walk_speed_mps)
        disc = limits.walk_disc_mps2
        rate = self.across_mps2 / max(state.speed_mps, speed, disc / limits.heading_rate_radps)
        turned = rate * STEP_S
        distance, middle = (state.speed_mps + speed) / 2 * STEP_S, state.heading_rad + turned / 2
        self.state = Walker(
            x_m=state.x_m + distance * math.cos(middle),
            y_m=state.y_m + distance * math.sin(middle),
            heading_rad=state.heading_rad + turned,
            speed_mps=speed,
            accel_mps2=(speed - state.speed_mps) / STEP_S,
        )
        return self.state

    def _accelerate(self, drive: float, turn: float) -> tuple[float, float]:
        """Acceleration along and across: towards what is wanted on the disc, by at most the jerk."""
        limits, along, across = self.limits, self.state.accel_mps2, self.across_mps2
        jerk = limits.walk_jerk_mps3
        low = -_taper(self.state.speed_mps, jerk)
        high = _taper(limits.walk_speed_mps - self.state.speed_mps, jerk)
        wanted = drive * (limits.walk_accel_mps2 if drive >= 0 else limits.walk_brake_mps2)
        to_along, to_across = _clip(wanted, low, high), turn * limits.walk_disc_mps2
        too_much = max(math.hypot(to_along, to_across) / limits.walk_disc_mps2, 1.0)
        to_along, to_across = to_along / too_much - along, to_across / too_much - across
        share = min(jerk * STEP_S / max(math.hypot(to_along, to_across), 1e-9), 1.0)
        # The disc is convex, and the taper only takes acceleration away: nothing leads out of it.
        return _clip(along + share * to_along, low, high), across + share * to_across


TOLERANCE_MPS = 0.02  # SUMO's rounding, divided by the step
LEAP_MPS = (
    4.0  # at a corner of a coarsely drawn lane, a body off its middle moves by up to 0.3 m more or less in a step
)


class Adversaries:
    """All adversaries of an episode: splits the joint action, and checks what was driven."""

    def __init__(self, family: Family, limits: Limits, frame: Frame) -> None:
        """The controls go on from the motion in `frame`."""
        f, rows = frame, {id_: row for row, id_ in enumerate(frame.ids)}
        self._limits = limits
        self._vehicles = {
            id_: VehicleControl(limits, *(float(a[rows[id_]]) for a in (f.speed_mps, f.accel_mps2, f.lateral_mps)))
            for id_ in family.vehicles
        }
        self._pedestrians = {}
        for id_ in family.pedestrians:
            walker = Walker(*(float(a[rows[id_]]) for a in (f.x_m, f.y_m, f.heading_rad, f.speed_mps)))
            self._pedestrians[id_] = PedestrianControl(limits, walker)
        self._order = family.adversaries
        self._ids: tuple[str, ...] = ()

    def command(self, action: Sequence[float], sim: SumoSimulation) -> None:
        """Sends one joint action, two entries per adversary in the family's order."""
        first, second = action[::2], action[1::2]
        intended = sim.intended_accel()
        vehicles = {}
        for k, (id_, control) in enumerate(self._vehicles.items()):
            place = sim.place(id_)
            if place is not None:
                vehicles[id_] = control.step(first[k], second[k], *place, intended[id_])
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
        """Whether every adversary vehicle drove as commanded, and so inside its limits, and was nowhere else.

        Less lateral motion than commanded passes: SUMO pauses it for some steps where a vehicle enters a junction.
        Pedestrians move by our own dynamics and cannot deviate. The controls go on from what was driven: who is too
        fast for a bend when it is released is commanded to brake, and keeps its limits if it does.
        """
        self.rows(frame)
        kept = True
        for row, control in self._driven:
            speed, lateral = float(frame.speed_mps[row]), float(frame.lateral_mps[row])
            kept &= abs(speed - control.speed_mps) <= TOLERANCE_MPS
            kept &= abs(lateral) <= abs(control.lateral_mps) + TOLERANCE_MPS
            moved = math.hypot(float(frame.vx_mps[row]), float(frame.vy_mps[row]))
            kept &= abs(moved - math.hypot(speed, lateral)) <= LEAP_MPS
            control.speed_mps, control.lateral_mps = speed, lateral
        return kept
