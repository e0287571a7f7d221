"""Rolls out a reference driver in the ego's place.

The motion of the striker and the path of the ego are kept; the speed is the driver's.

The recorded ego is followed until the driver perceives the conflict; from then on the driver's own profile counts,
even where the ego was braking harder.
"""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.geometry import Pose, Size, touches
from risk_sac.jit import compiled
from risk_sac.types import Floats
from risk_sac.verdicts.along import along
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.drivers import (
    FUZZY_DELAY_S,
    R157_PERCEIVES_S,
    RSS_BRAKES_MPS2,
    RSS_DELAY_S,
    Situation,
    full_braking,
    fuzzy,
    r157,
    rss,
    towards_command,
)
from risk_sac.verdicts.fuzzy import HARDEST_MPS2
from risk_sac.verdicts.path import Path, pose_at

R157, FULL_BRAKING, FUZZY, RSS, DEFENSIVE = range(5)
FINE_S = 0.01  # between two box tests; at 30 m/s of closing 0.3 m
LOOK = 10  # fine steps, 0.1 s, between two looks of a driver that goes by what it sees
HORIZON_S = 8.0  # from the beginning of the conflict
STANDING_MPS = 0.1


class Ending(NamedTuple):
    """Ending of a rollout; the poses are those of the contact."""

    touched: bool
    speed_mps: float
    pose: Pose
    other: Pose
    lead_m: float  # how much further along the path it was than the recorded ego, as long as that is recorded
    passing_mps: float  # its speed at that time


@compiled
def drive(
    driver: int,
    path: Path,
    size: Size,
    track: Body[Floats],
    first: int,
    speed: float,
    grip: float,
    horizon_s: float,
    step_s: float,
    driven: Floats,
) -> Ending:
    """Lets a driver brake for the striker until it stands, touches it, or the horizon is over.

    Args:
      driver: R157, FULL_BRAKING, FUZZY or RSS.
      path: the recorded ego's, a point per frame.
      size: of the ego.
      track: the striker's recorded motion, its heading without jumps of 2π; it goes on with its last velocity.
      first: the frame from which the driver drives; for FUZZY and RSS from which it looks out.
      speed: of the ego then.
      grip: the most braking the road bears, m/s².
      horizon_s: how long it is followed.
      step_s: between two recorded frames.
      driven: takes the metres along the path at the frames after `first`, as many as it holds and are driven.
    """
    s, braking, wanted, danger_s = path.s[first], 0.0, 0.0, math.inf
    lead, passing = 0.0, speed
    last = len(track.x) - 1
    frames = Path(
        track.x, track.y, track.heading, np.arange(last + 1).astype(np.float64)
    )  # the striker's poses over the frames
    pose, other = pose_at(path, s), pose_at(frames, float(first))
    looks, per_frame = driver in (FUZZY, RSS), round(step_s / FINE_S)
    for step in range(1, round(horizon_s / FINE_S) + 1):
        since = (step - 1) * FINE_S
        frame = first + since / step_s
        if looks and (step - 1) % LOOK == 0:
            vx, vy = track.vx[last], track.vy[last]
            if frame < last:
                k = int(frame)
                vx, vy = (track.x[k + 1] - track.x[k]) / step_s, (track.y[k + 1] - track.y[k]) / step_s
            striker = Body(other[0], other[1], other[2], vx, vy, track.size)
            wanted = _wanted(driver, path, s, speed, braking, size, striker)
            if wanted > 0.0:
                danger_s = min(danger_s, since)
        if driver == R157:
            braking = r157(since + FINE_S / 2, grip)
        elif driver == FULL_BRAKING:
            braking = full_braking(grip)
        else:
            delay = FUZZY_DELAY_S if driver == FUZZY else RSS_DELAY_S
            if since >= danger_s + delay:
                braking = towards_command(braking, wanted, grip, FINE_S)
        own_frame = first + (since + FINE_S) / step_s
        k = min(int(own_frame), last - 1)
        recorded_s = path.s[k] + (own_frame - k) * (path.s[k + 1] - path.s[k])
        if looks and danger_s == math.inf and own_frame < last:  # nothing to perceive yet: the recorded ego drives on
            speed, s = (recorded_s - s) / FINE_S, recorded_s
        else:
            slower = max(speed - braking * FINE_S, 0.0)
            s += (speed + slower) / 2 * FINE_S
            speed = slower
        if own_frame <= last:
            lead, passing = s - recorded_s, speed
        if step % per_frame == 0 and step // per_frame <= len(driven):
            driven[step // per_frame - 1] = s
        if speed <= STANDING_MPS and braking > 0.0:
            if own_frame < last:  # it stays, while the recorded ego may come past
                lead = s - path.s[last]
            break
        pose, other = pose_at(path, s), pose_at(frames, min(own_frame, last))
        if own_frame > last:
            beyond_s = (own_frame - last) * step_s
            other = other[0] + beyond_s * track.vx[last], other[1] + beyond_s * track.vy[last], other[2]
        if touches(pose, size, other, track.size):
            return Ending(True, speed, pose, other, lead, passing)
    return Ending(False, speed, pose, other, lead, passing)


@compiled
def _wanted(driver: int, path: Path, s: float, speed: float, braking: float, size: Size, other: Body[float]) -> float:
    """Computes the braking that a driver wants for what it sees now."""
    first = max(int(np.searchsorted(path.s, s, side="right")) - 1, 0)
    seen = along(path, first, s, speed, size, other)
    direction = other.heading - seen.turn_rad
    across = other.vy * math.cos(direction) - other.vx * math.sin(direction)
    reach = abs(math.sin(seen.turn_rad)) * other.size.half_length + abs(math.cos(seen.turn_rad)) * other.size.half_width
    situation = Situation(seen, speed, braking, size.half_width, reach, across)
    return fuzzy(situation) if driver == FUZZY else rss(situation)


@compiled
def stopping_distance(driver: int, speed: float, grip: float) -> float:
    """Metres in which a driver stops for what it has to perceive first, m.

    Its reaction and braking are those of its reference model; R157 perceives before it reacts. DEFENSIVE brakes as
    hard if it has to.
    """
    gone, braking, since = 0.0, 0.0, 0.0
    while speed > STANDING_MPS:
        since += FINE_S
        if driver in (R157, DEFENSIVE):
            braking = r157(since - R157_PERCEIVES_S, grip)
        elif driver == FULL_BRAKING:
            braking = full_braking(grip)
        elif since > (FUZZY_DELAY_S if driver == FUZZY else RSS_DELAY_S):
            braking = towards_command(braking, HARDEST_MPS2 if driver == FUZZY else RSS_BRAKES_MPS2, grip, FINE_S)
        speed -= braking * FINE_S
        gone += speed * FINE_S
    return gone
