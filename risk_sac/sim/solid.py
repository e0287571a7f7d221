"""Commands of adversaries, kept clear of bodies other than the ego's."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from risk_sac.sim.paths import COS, SIN, STATION
from risk_sac.sim.paths import HEADING as PATH_HEADING
from risk_sac.world.geometry import Pose, Size, pose_of, size_of, touches
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, SPEED, STEP_S, VX, VY, WIDTH, Floats, X, Y


@dataclass(slots=True)
class Walker:
    """A pedestrian's state; the command of a step is its next state."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    accel_mps2: float = 0.0


class VehicleCommand(NamedTuple):
    """Speeds of an adversary vehicle during the next step."""

    speed_mps: float
    lateral_mps: float


@compiled
def taper(distance: float, rate: float) -> float:
    """Computes the largest value that can fall to 0 within a distance.

    It falls by at most `rate` per second, and its sum over steps stays within `distance`.

    With decrements of c = rate·dt and D = distance/dt, k full decrements fit, k(k+1)/2·c <= D, and the rest is
    spread over k + 1 steps. The continuous √(2·rate·distance) would overshoot by up to half a decrement.
    """
    if distance <= 0.0 or rate <= 0.0:
        return 0.0
    change, total = rate * STEP_S, distance / STEP_S
    full = int((math.sqrt(1.0 + 8.0 * total / change) - 1.0) / 2.0)
    return full * change / 2.0 + total / (full + 1)


@compiled
def clip(value: float, low: float, high: float) -> float:
    """The value, or the bound that it is beyond."""
    return low if value < low else high if value > high else value


MARGIN_M = 0.15  # margin on every side, since foreseen poses assume that a body follows its path exactly
WALKER_MARGIN_M = 0.05  # the same margin for a pedestrian
SAME_WAY_COS = 0.7  # headings less than 45 degrees apart
SAME_LANE_M = 0.5  # greatest offset of a follower
ACROSS_MPS = 0.05  # lateral speed from which a vehicle moves into what is beside it
REACTION_S = 0.5  # reaction time of vehicles behind
BUILD_UP_S = 0.5  # time in which a braking builds up, and a step
LONGEST_STEPS = 130  # most steps of a braking: from 43 m/s with ordinary 4 m/s² and what the jerk takes

Others = tuple[Floats, int]  # a frame's state, and the own column in it
ALONE: Others = np.zeros((WIDTH + 1, 1)), 0
CLEAR, AHEAD, LEFT, RIGHT = 0, 1, 2, 3
# Rows of what is foreseen of the others.
SPEED_MPS = 0  # speed; NaN of actors that need no look
BRAKES_S = 1  # time until it brakes; infinite if it keeps its velocity
ACROSS_M = 2  # distance to the left of the adversary


@compiled
def drives_into(
    state: Floats,
    own: int,
    path: Floats,
    station_m: float,
    offset_m: float,
    motion: tuple[float, float, float],
    braking: tuple[float, float, float],
    hardest_mps2: float,
    statics: int = 0,
    room_m: float = 0.0,
) -> int:
    """Finds where a vehicle, stepping then braking, meets bodies except the ego's.

    A static body that it passes by moving on across at this speed is not in its way: it may leave the lane too late to
    stop. Others may move or brake, so it stays able to stop for them.

    Args:
      state: of a frame, `rows x n`.
      own: its column.
      path: the one it takes if it does not steer.
      station_m: of its front bumper on the path.
      offset_m: of its middle from the path, positive to the left.
      motion: speed, acceleration and lateral speed of the step.
      braking: how it stops: its braking, its jerk, and how fast its lateral speed falls.
      hardest_mps2: how hard others on its course may brake.
      statics: how many of the bodies, the last of the frame, never move.
      room_m: of the road on the side that it moves to.

    Returns:
      `CLEAR`; `AHEAD`; `LEFT` or `RIGHT` if what is beside or behind there runs into it because it moves across.
    """
    speed, accel, lateral = motion
    brake, jerk, lateral_accel = braking
    before, half_length = state[SPEED, own], state[LENGTH, own] / 2
    size = Size(half_length + MARGIN_M, state[WIDTH, own] / 2 + MARGIN_M)
    foreseen = _foresee(state, own, max(before, speed), brake)
    if foreseen.shape[1] == 0:
        return CLEAR
    segment = _segment(path, 0, station_m)
    tilt = state[HEADING, own] - path[PATH_HEADING, segment]
    side = RIGHT if lateral < -ACROSS_MPS else LEFT if lateral > ACROSS_MPS else CLEAR  # that it moves to
    near = foreseen[SPEED_MPS, state.shape[1] - statics :]
    if statics and side != CLEAR and not np.isnan(near).all():
        far_m, moving_m, swerving = offset_m + math.copysign(room_m, lateral), offset_m, foreseen.copy()
        passes_s = _passes_s(state, own, statics, speed)
        for step in range(1, min(math.ceil(passes_s / STEP_S), LONGEST_STEPS) + 1):
            moving_m += lateral * STEP_S
            moving_m = min(moving_m, far_m) if lateral > 0.0 else max(moving_m, far_m)
            pose = _pose_at(path, segment, station_m + step * speed * STEP_S, moving_m, half_length, tilt)
            if _meets(state, swerving, pose, size, step * STEP_S, hardest_mps2, side) != CLEAR:
                break
        else:
            near[:] = np.nan
    worst = CLEAR
    for step in range(1, LONGEST_STEPS):
        station_m += (before + speed) / 2 * STEP_S
        offset_m += lateral * STEP_S
        segment = _segment(path, segment, station_m)
        pose = _pose_at(path, segment, station_m, offset_m, half_length, tilt)
        where = _meets(state, foreseen, pose, size, step * STEP_S, hardest_mps2, side)
        if where == AHEAD:
            return AHEAD
        worst = max(worst, where)
        if speed <= 0.0:
            break
        accel = max(accel - jerk * STEP_S, -brake, -taper(speed, jerk))
        before, speed = speed, max(speed + accel * STEP_S, 0.0)
        lateral = math.copysign(max(abs(lateral) - lateral_accel * STEP_S, 0.0), lateral)
    return worst


@compiled
def walks_into(state: Floats, own: int, walk: tuple[float, ...], braking: tuple[float, float, float]) -> bool:
    """Whether a pedestrian, stepping then stopping, meets bodies except the ego's.

    Args:
      state: of a frame, `rows x n`.
      own: its column.
      walk: x, y, heading, speed, and acceleration along and across it after the step.
      braking: how it stops: its braking, its jerk, and the speed below which it turns no faster.
    """
    x, y, heading, speed, along, across = walk
    brake, jerk, slow = braking
    half = math.hypot(state[LENGTH, own], state[WIDTH, own]) / 2 + WALKER_MARGIN_M  # however it turns
    foreseen = _foresee(state, own, speed, brake)
    if foreseen.shape[1] == 0:
        return False
    for step in range(1, LONGEST_STEPS):
        if _meets(state, foreseen, (x, y, heading), Size(half, half), step * STEP_S, brake, CLEAR) == AHEAD:
            return True
        if speed <= 0.0:
            break
        change = min(brake, taper(speed, jerk)) + along
        share = min(jerk * STEP_S / max(math.hypot(change, across), jerk * STEP_S), 1.0)
        along, across = along - share * change, across - share * across
        after = max(speed + along * STEP_S, 0.0)
        turned = across / max(speed, after, slow) * STEP_S
        x += (speed + after) / 2 * STEP_S * math.cos(heading + turned / 2)
        y += (speed + after) / 2 * STEP_S * math.sin(heading + turned / 2)
        heading, speed = heading + turned, after
    return False


@compiled
def _segment(path: Floats, first: int, station_m: float) -> int:
    """Returns a path's segment at a station, searched from `first` on."""
    while first + 2 < path.shape[1] and path[STATION, first + 1] <= station_m:
        first += 1
    return first


@compiled
def _pose_at(path: Floats, first: int, station_m: float, offset_m: float, half_length: float, tilt: float) -> Pose:
    """Computes a vehicle's pose with its front at a path's station."""
    segment = _segment(path, first, station_m)
    ahead_m, cos, sin = station_m - path[STATION, segment], path[COS, segment], path[SIN, segment]
    heading = path[PATH_HEADING, segment] + tilt
    x = path[0, segment] + ahead_m * cos - offset_m * sin - half_length * math.cos(heading)
    y = path[1, segment] + ahead_m * sin + offset_m * cos - half_length * math.sin(heading)
    return x, y, heading


@compiled
def _passes_s(state: Floats, own: int, statics: int, speed: float) -> float:
    """Computes the time to pass all static bodies straight ahead, s (choice)."""
    cos, sin, passes_m = math.cos(state[HEADING, own]), math.sin(state[HEADING, own]), 0.0
    for other in range(state.shape[1] - statics, state.shape[1]):
        ahead_m = (state[X, other] - state[X, own]) * cos + (state[Y, other] - state[Y, own]) * sin
        reach_m = (state[LENGTH, own] + state[LENGTH, other]) / 2 + 2 * MARGIN_M
        passes_m = max(passes_m, ahead_m + reach_m)
    return passes_m / max(speed, ACROSS_MPS)


@compiled
def _foresee(state: Floats, own: int, speed: float, brake_mps2: float) -> Floats:
    """Predicts the others' motion, `rows x n`.

    It is `rows x 0` if none can be met before the adversary has stopped.

    A body that the adversary is inside of is left out.
    """
    stops_s, cos, sin = speed / brake_mps2 + BUILD_UP_S, math.cos(state[HEADING, own]), math.sin(state[HEADING, own])
    foreseen = np.full((3, state.shape[1]), np.nan)
    near = 0
    for other in range(1, state.shape[1]):
        bodies_m = (state[LENGTH, own] + state[WIDTH, own] + state[LENGTH, other] + state[WIDTH, other]) / 2
        dx, dy = state[X, other] - state[X, own], state[Y, other] - state[Y, own]
        reach_m = bodies_m + 2 * MARGIN_M + (speed + state[SPEED, other]) * stops_s
        if other == own or dx * dx + dy * dy > reach_m * reach_m:
            continue
        if touches(pose_of(state, own), size_of(state, own), pose_of(state, other), size_of(state, other)):
            continue
        near += 1
        foreseen[SPEED_MPS, other] = math.hypot(state[VX, other], state[VY, other])
        foreseen[ACROSS_M, other] = dy * cos - dx * sin
        foreseen[BRAKES_S, other] = math.inf
        if math.cos(state[HEADING, other] - state[HEADING, own]) > SAME_WAY_COS:
            foreseen[BRAKES_S, other] = 0.0 if dx * cos + dy * sin > 0.0 else REACTION_S
    return foreseen if near else foreseen[:, :0]


@compiled
def _meets(
    state: Floats, foreseen: Floats, pose: Pose, size: Size, after_s: float, hardest_mps2: float, side: int
) -> int:
    """Finds where the adversary, at `pose` after `after_s`, meets others first.

    A vehicle that comes from behind keeps its own distance, unless it is on the side to which the adversary moves.
    """
    found = CLEAR
    for other in range(1, state.shape[1]):
        speed = foreseen[SPEED_MPS, other]
        if math.isnan(speed):
            continue
        braking_s = min(max(after_s - foreseen[BRAKES_S, other], 0.0), speed / hardest_mps2)
        gone_s = min(after_s, foreseen[BRAKES_S, other])
        if braking_s > 0.0:
            gone_s += braking_s * (1.0 - hardest_mps2 * braking_s / (2 * speed))
        x, y = state[X, other] + gone_s * state[VX, other], state[Y, other] + gone_s * state[VY, other]
        half = size_of(state, other)
        if not touches(pose, size, (x, y, state[HEADING, other]), half):
            continue
        # The point of the other body that is nearest to the adversary's centre.
        cos, sin = math.cos(state[HEADING, other]), math.sin(state[HEADING, other])
        along, beside = (pose[0] - x) * cos + (pose[1] - y) * sin, (pose[1] - y) * cos - (pose[0] - x) * sin
        along, beside = (
            clip(along, -half.half_length, half.half_length),
            clip(beside, -half.half_width, half.half_width),
        )
        x, y = x + along * cos - beside * sin, y + along * sin + beside * cos
        if (x - pose[0]) * math.cos(pose[2]) + (y - pose[1]) * math.sin(pose[2]) > 0.0:
            return AHEAD
        foreseen[SPEED_MPS, other] = math.nan  # how they meet first counts
        across_m = foreseen[ACROSS_M, other]
        if abs(across_m) > SAME_LANE_M and side == (LEFT if across_m > 0.0 else RIGHT):
            found = side
    return found
