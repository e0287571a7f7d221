"""From an action to a vehicle's command that keeps its kinematic limits.

Each limit holds on the motion that is driven, not only on what was asked for: acceleration tapers before standstill
and top speed, speed before a bend, and lateral speed before the road's edge, so that no clipping causes a jolt.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.scenario.layout import CAR_LENGTH_M
from risk_sac.scenario.limits import Limits
from risk_sac.sim.paths import HEADING, STATION, Along, Path
from risk_sac.sim.roads import LateralRoom
from risk_sac.sim.solid import AHEAD, ALONE, CLEAR, Others, VehicleCommand, clip, drives_into, taper
from risk_sac.world.jit import compiled
from risk_sac.world.types import LATERAL, SPEED, STEP_S, VX, VY, Floats

CORRECTION_PER_M = 0.05  # curvature left for steering in the tightest bend, and so before a road's edge
TURNING_BACK = 0.85  # share of the heading that leaves just enough room; a step of 0.1 s resolves no more
EDGE_M = 0.03  # width kept free at the road's edge, which a car overshoots that brakes while it straightens
SKID = 0.98  # a vehicle too fast for a curve keeps a fifth of its grip for braking, or it would never slow down
TOLERANCE_MPS = 0.02  # SUMO's rounding, divided by the step
LEAP_MPS = 4.0  # at a corner of a coarsely drawn lane, a body off its middle moves up to 0.3 m more or less in a step

GRID_M = 0.5
BODY_M = CAR_LENGTH_M  # SUMO turns a body while it passes a corner of the lane, over the body's own length
AHEAD_M = 5.0  # distance at which braking for a bend begins; more than BODY_M, or a bend is not seen whole as it begins
NO_BEND_PER_M = 1e-6
END_M = 2.0  # kept to the end of a lane, at which SUMO halts a vehicle at once

Braking = tuple[float, float, float]  # see `drives_into`

# Rows of the bends of a path.
HERE = 0  # absolute curvature, 1/m
SOON = 1  # largest curvature up to AHEAD_M ahead, 1/m
CAP = 2  # highest speed from which all bends ahead can be driven as planned, m/s


class Bounds(NamedTuple):
    """Fields of a vehicle's `Limits` for compiled code."""

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
        """The bounds of some limits."""
        preview_s = (limits.accel_mps2 + limits.approach_mps2) / limits.jerk_mps3
        return cls(**{name: getattr(limits, name) for name in cls._fields[:-1]}, preview_s=preview_s)


class VehicleControl:
    """Turns actions into bounded speed and lateral speed.

    The friction circle is shared in this order: the bend of the lane, a lane change, braking and accelerating.

    Attributes:
      motion: what it last commanded: speed, acceleration and lateral speed.
    """

    def __init__(self, limits: Limits, speed_mps: float, accel_mps2: float = 0.0, lateral_mps: float = 0.0) -> None:
        """Starts from a motion."""
        self.motion = np.array((speed_mps, accel_mps2, lateral_mps))
        self._limits = limits
        self._bounds = tuple(Bounds.of(limits))  # passing one by its name costs as much as a step
        straight = min(limits.brake_mps2, math.sqrt(limits.grip_mps2**2 - limits.lateral_accel_mps2**2))
        rest = limits.jerk_mps3, limits.lateral_accel_mps2
        self._stopping = (straight, *rest), (limits.approach_mps2, *rest), limits.others_brake_mps2
        self._path: Path | None = None
        self._bends: Floats  # of that path
        self._at_m = 0.0  # where on it
        self._behind_per_m = 0.0  # bend before that path, which the body has yet to leave

    def step(
        self,
        drive: float,
        steer: float,
        room: LateralRoom,
        along: Along,
        intended_mps2: float = 0.0,
        others: Others = ALONE,
        statics: int = 0,
    ) -> VehicleCommand:
        """One step of 0.1 s.

        Args:
          drive: longitudinal acceleration as a share of the limit, -1 (hardest braking) to 1.
          steer: lateral velocity as a share of the limit, -1 (right) to 1 (left).
          room: of the road on both sides of the vehicle.
          along: where it is on the path it takes if it does not steer.
          intended_mps2: acceleration that its driver would choose without a command.
          others: actors that it keeps clear of.
          statics: how many of them, the last, never move: it stops before these or goes round them.
        """
        path, station_m, offset_m, ends_m = along
        if path is not self._path:
            if self._path is not None:
                self._behind_per_m = float(self._bends[SOON, index(self._bends, self._at_m)])
            self._path, self._bends = path, bends(path, self._limits, ends_m)
        self._at_m = station_m
        course = self._bounds, self._bends, station_m, self._behind_per_m, self.motion
        wanted = float(drive), float(steer), float(intended_mps2)
        return VehicleCommand(
            *_drive_clear(*course, wanted, tuple(room), *others, path, offset_m, self._stopping, statics)
        )


@compiled
def _drive_clear(
    bounds: tuple[float, ...],
    bends: Floats,
    station_m: float,
    behind_per_m: float,
    motion: Floats,
    wanted: tuple[float, float, float],
    room: tuple[float, ...],
    state: Floats,
    own: int,
    path: Path,
    offset_m: float,
    stopping: tuple[Braking, Braking, float],
    statics: int,
) -> tuple[float, float]:
    """Drives as `_drive`, but gives up steering, then driving, to avoid contact.

    The arguments up to `room` are those of `_drive`, but `motion` becomes that of the next step; `state`, `own`, `path`
    and `offset_m` are those of `drives_into`; `stopping` is how it brakes on a straight and in a bend, and how hard
    others brake.

    Returns:
      Speed and lateral speed of the next step.
    """
    before = motion[0], motion[1], motion[2]
    drive, _, intended = wanted
    straight, bent, others_brake_mps2 = stopping
    in_bend = station_m < BODY_M or bends[SOON, index(bends, station_m)] > NO_BEND_PER_M
    braking, lateral = bent if in_bend else straight, before[2]
    choices = (wanted, (drive, 0.0, intended), (0.0, math.copysign(1.0, lateral), 0.0), (-1.0, 0.0, 0.0))
    after = before
    for k, choice in enumerate(choices):
        if k == 2 and (statics == 0 or lateral == 0.0):  # else it may be too late to stop
            continue
        after = _drive(bounds, bends, station_m, behind_per_m, before, choice, room)
        room_m = room[0] if after[2] > 0.0 else room[1]
        met = drives_into(state, own, path, station_m, offset_m, after, braking, others_brake_mps2, statics, room_m)
        if met == CLEAR or (met != AHEAD and choice[1] == 0.0):
            break
    motion[0], motion[1], motion[2] = after
    return after[0], after[2]


@compiled
def drove_as_commanded(state: Floats, rows: NDArray[np.intp], motions: Floats) -> bool:
    """Whether vehicles drove as commanded (`Adversaries.keep_limits`); updates their motions.

    Args:
      state: of a frame, `rows x n`.
      rows: `vehicles`; their columns in `state`, 0 of those that left the net.
      motions: `vehicles x 3`; what was commanded, then what was driven.
    """
    kept = True
    for row, motion in zip(rows, motions):  # noqa: B905  # compiled code knows no strict
        if row > 0:
            speed, lateral = state[SPEED, row], state[LATERAL, row]
            leap = math.hypot(state[VX, row], state[VY, row]) - math.hypot(speed, lateral)
            kept = kept and abs(speed - motion[0]) <= TOLERANCE_MPS and abs(leap) <= LEAP_MPS
            kept = kept and abs(lateral) <= abs(motion[2]) + TOLERANCE_MPS
            motion[0], motion[2] = speed, lateral
    return kept


@compiled
def _drive(
    bounds: tuple[float, ...],
    bends: Floats,
    station_m: float,
    behind_per_m: float,
    motion: tuple[float, float, float],
    wanted: tuple[float, float, float],
    room: tuple[float, ...],
) -> tuple[float, float, float]:
    """Computes next speed, acceleration and lateral speed; arguments as of `step`."""
    (speed, accel, lateral), (drive, steer, intended) = motion, wanted
    limits = Bounds(*bounds)
    at, soon = index(bends, station_m), index(bends, station_m + speed * limits.preview_s)
    behind = behind_per_m if station_m < BODY_M else 0.0
    curvature, ahead = max(bends[HERE, at], behind), max(bends[SOON, at], behind)
    cap = min(bends[CAP, at], bends[CAP, soon])
    accel = _accelerate(limits, speed, accel, drive, intended, curvature, ahead, cap)
    after = clip(speed + accel * STEP_S, 0.0, limits.speed_mps)
    left_over = max(limits.curvature_per_m - curvature, CORRECTION_PER_M)
    room_m = max((room[0] if steer >= 0 else room[1]) - EDGE_M, 0.0)
    return after, accel, _steer(limits, speed, after, lateral, steer, room_m, left_over)


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
    # Choice: the less a command says, the more the driver's own intention counts. Without a command it drives on as
    # traffic does, and stops behind others and at a red light.
    wanted = drive * (limits.accel_mps2 if drive >= 0 else limits.brake_mps2) + (1.0 - abs(drive)) * intended
    bend = max(curvature * speed**2, min(ahead * speed**2, limits.cornering_mps2))
    across = min(bend + limits.lateral_accel_mps2, SKID * limits.grip_mps2)
    grip = math.sqrt(limits.grip_mps2**2 - across**2)
    low = max(-limits.brake_mps2, -grip, -taper(speed, limits.jerk_mps3))
    high = min(limits.accel_mps2, grip, taper(limits.speed_mps - speed, limits.jerk_mps3))
    high = max(min(high, (cap_mps - speed) / limits.preview_s), low)
    change = limits.jerk_mps3 * STEP_S
    return clip(clip(wanted, low, high), accel - change, accel + change)


@compiled
def _steer(
    limits: Bounds,
    before: float,
    speed: float,
    lateral: float,
    steer: float,
    room_m: float,
    curvature: float,
) -> float:
    """Moves across the lane on a path of bounded curvature.

    So a car cannot move across at a standstill.

    Keeping its heading, a car that brakes loses lateral speed with the longitudinal; `limits.slip` is such that
    this alone is within the limit on lateral acceleration, and both bounds below always leave something.
    """
    # The heading θ that leaves room to turn back at curvature κ after the d metres of a full braking, in which a tight
    # bend may leave nothing for turning: θ d + θ² / 2κ = room.
    stopping_m = speed**2 / (2 * limits.brake_mps2)
    heading = CORRECTION_PER_M * (math.sqrt(stopping_m**2 + 2 * room_m / CORRECTION_PER_M) - stopping_m)
    slip = min(limits.slip, TURNING_BACK * heading)
    reach = min(limits.lateral_mps, slip * speed, taper(room_m, limits.lateral_accel_mps2))
    wanted = clip(steer * limits.lateral_mps, -reach, reach)
    same_heading = lateral * speed / before if before > 0.0 else 0.0
    turn, change = curvature * speed**2 * STEP_S, limits.lateral_accel_mps2 * STEP_S
    wanted = clip(wanted, same_heading - turn, same_heading + turn)
    return clip(wanted, lateral - change, lateral + change)


def bends(path: Path, limits: Limits, ends_m: float = math.inf) -> Floats:
    """Computes a path's bends, and speeds to approach them; `3 x stations`.

    The stations are 0, GRID_M, 2·GRID_M …

    v(s)² = min over s' ≥ s of  a / κ(s') + 2 b (s' - s),   a the planned cornering, b the braking left beside it

    From `END_M` before `ends_m` on, where the lane ends, the speed is 0.
    """
    return _profile(path[STATION], path[HEADING], limits.cornering_mps2, limits.approach_mps2, ends_m - END_M)


@compiled
def index(bends: Floats, station_m: float) -> int:
    """Column of a station; beyond the path's ends, that of its ends."""
    column: int = min(max(int(station_m / GRID_M), 0), bends.shape[1] - 1)
    return column


@compiled
def _profile(station: Floats, heading: Floats, cornering: float, braking: float, stop_m: float) -> Floats:
    n = int(station[-1] / GRID_M) + 1
    profile = np.zeros((3, n))
    curvature, ahead, cap = profile[HERE], profile[SOON], profile[CAP]
    for i in range(1, len(station)):
        turn = (heading[i] - heading[i - 1] + math.pi) % (2 * math.pi) - math.pi
        for k in range(math.ceil(station[i] / GRID_M), min(math.ceil((station[i] + BODY_M) / GRID_M), n)):
            curvature[k] += turn / BODY_M
    curvature[:] = np.abs(curvature)
    reachable = np.inf  # square of the speed from which the next station's cap can be braked to
    for k in range(n - 1, -1, -1):
        ahead[k] = curvature[k : k + int(AHEAD_M / GRID_M) + 1].max()
        square = min(cornering / max(ahead[k], NO_BEND_PER_M), reachable) if k * GRID_M < stop_m else 0.0
        cap[k] = math.sqrt(square)
        reachable = square + 2 * braking * GRID_M
    return profile
