"""Rolls out a reference driver in the ego's place.

The motion of the striker and the path of the ego are kept; the speed is the driver's.

The recorded ego is followed until the driver perceives the conflict; from then on the driver's own profile counts,
even where the ego was braking harder.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.verdicts.course import MovingBox, Path, along, pose_at
from risk_sac.verdicts.defensive import PRIORITY, PRIORITY_S, SceneAhead, allowed_accel, nothing_remembered
from risk_sac.verdicts.drivers import (
    FUZZY_DELAY_S,
    HARDEST_MPS2,
    JERK_MPS3,
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
from risk_sac.verdicts.evidence import PER_ACTOR, Evidence, recorded_size
from risk_sac.verdicts.present import (
    Crossings,
    OnPath,
    Street,
    concealing,
    crossings_on,
    is_in_view,
    moving_box,
    street_of,
    walls_of,
)
from risk_sac.world.geometry import Pose, Size, touches
from risk_sac.world.jit import compiled
from risk_sac.world.types import VX, VY, Bools, Floats, Kind, X, Y

R157, FULL_BRAKING, FUZZY, RSS, DEFENSIVE = range(5)
FINE_S = 0.01  # between two box tests; at 30 m/s of closing 0.3 m
LOOK = 10  # fine steps, 0.1 s, between two looks of a driver that goes by what it sees
HORIZON_S = 8.0  # from the beginning of the conflict
STANDING_MPS = 0.1


class RolloutEnd(NamedTuple):
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
    track: MovingBox[Floats],
    first: int,
    speed: float,
    grip: float,
    horizon_s: float,
    step_s: float,
    driven: Floats,
) -> RolloutEnd:
    """Brakes for the striker until standstill, touch or the horizon's end.

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
            striker = MovingBox(other[0], other[1], other[2], vx, vy, track.size)
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
            return RolloutEnd(True, speed, pose, other, lead, passing)
    return RolloutEnd(False, speed, pose, other, lead, passing)


@compiled
def _wanted(
    driver: int, path: Path, s: float, speed: float, braking: float, size: Size, other: MovingBox[float]
) -> float:
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
    """Returns the distance in which a driver perceives, reacts and stops, m.

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


LOOKS_M = 60.0  # beyond the path's end, for crossings
AFTER_S = 3.0
BRIDGE_S = 1.0
SLOWER_MPS2 = 0.3  # Choice: less is no difference between two drivers
SPEEDS_UP_MPS2 = 2.0
RESTRAINED_MPS2 = 2.0  # one that may speed up by more is not


class Task(NamedTuple):
    """Episode of `T` frames and `n` actors, as compiled code needs it."""

    path: Path
    size: Size
    speed_mps: Floats  # T, of the recorded ego
    states: Floats  # T x rows x n
    vehicle: Bools
    conceals: Bools
    link: NDArray[np.uint8]  # T x n
    known: Bools  # T x n
    priority: Bools  # T
    street: Street
    crossings: Crossings
    minds: Bools  # n, see `Scene`
    places: bool
    striker: int
    began: int  # the frame in which the conflict with it begins
    step_s: float


def driven(evidence: Evidence, path: Path, striker: int | None, conflict_frame: int, latest: int) -> tuple[Floats, int]:
    """Drives the defensive driver along a path.

    Args:
      evidence: of the episode.
      path: with a point per frame.
      striker: its column; None: whatever restrains the driver counts.
      conflict_frame: in which the conflict begins.
      latest: the frame from which it drives in any case; on another path than the ego's, where they part.

    Returns:
      Metres along the path per frame, until 3 s after the last, and the frame from which it drives; the last one if it
      does as the ego did, and then nothing is driven after it.
    """
    e, last = evidence, len(path.s) - 1
    task, memory = _task(e, path, striker, conflict_frame), nothing_remembered(len(e.ids))
    acts = _acts(task, e.released, latest, memory)
    if acts == last:
        return path.s.copy(), acts
    if latest < last:
        task = task._replace(minds=np.ones(len(e.ids), dtype=np.bool_), places=True)
    return _drive(task, acts, round(AFTER_S / e.step_s), memory), acts


def _task(e: Evidence, path: Path, striker: int | None, conflict_frame: int) -> Task:
    sizes = (np.broadcast_to(each, e.x_m.shape) for each in (e.length_m, e.width_m))
    link = np.nan_to_num(e.link).astype(np.uint8)
    ahead, vehicle, size = link[:, 0], e.kind == int(Kind.VEHICLE), recorded_size(e, 0)
    latest = np.maximum.accumulate(np.where(ahead == PRIORITY, e.time_s, -np.inf))
    street = street_of(e.ground)
    everything = np.ones(len(e.ids), dtype=np.bool_)
    return Task(
        path=path,
        size=size,
        speed_mps=np.ascontiguousarray(e.speed_mps[:, 0]),
        states=np.stack([*(getattr(e, name) for name in PER_ACTOR), *sizes], axis=1),
        vehicle=vehicle,
        conceals=concealing(e.body),
        link=link,
        known=np.ascontiguousarray(e.known),
        priority=((ahead == 0) | (ahead == PRIORITY)) & (e.time_s - latest <= PRIORITY_S),
        street=street,
        crossings=crossings_on(path, float(path.s[0]), float(path.s[-1]) + LOOKS_M, street.boxes, size.half_width),
        minds=everything if striker is None else np.arange(len(e.ids)) == striker,
        places=striker is None or not vehicle[striker],
        striker=striker or 0,
        began=len(path.s) if striker is None else conflict_frame,
        step_s=e.step_s,
    )


@compiled
def _acts(task: Task, released: int, latest: int, memory: Floats) -> int:
    """Finds the driver's first frame; sets `memory` to its state there."""
    path, speed, last, step_s = task.path, task.speed_mps, len(task.path.s) - 1, task.step_s
    slower, free = np.zeros(last, dtype=np.bool_), np.ones(last, dtype=np.bool_)
    remembered = np.empty((last, memory.shape[0], memory.shape[1]))
    for t in range(released, last):
        remembered[t] = memory
        ego = OnPath(path, t, path.s[t], speed[t], task.size)
        accel = _asked(task, t, ego, task.states[t], task.known[t], memory)
        free[t] = accel > RESTRAINED_MPS2
        possible = max(speed[t] + accel * step_s, 0.0) if accel < math.inf else math.inf
        slower[t] = possible < speed[t + 1] - SLOWER_MPS2 * step_s
    found, unrestrained = last, 0
    for t in range(last - 1, released - 1, -1):
        unrestrained = unrestrained + 1 if free[t] else 0
        if unrestrained * step_s > BRIDGE_S + 1e-6:
            break
        if slower[t]:
            found = t
    found = min(found, max(latest, released))
    if found < last:
        memory[:] = remembered[found]
    return found


@compiled
def _asked(task: Task, t: int, ego: OnPath, state: Floats, seen: Bools, memory: Floats) -> float:
    """Returns the driver's allowed acceleration in frame `t`, or after the last."""
    frame = min(t, len(task.path.s) - 1)
    strikes_s = _strikes_s(task.path, ego.s, ego.speed_mps, t, task.began)
    scene = SceneAhead(
        state,
        task.vehicle,
        task.conceals,
        task.link[frame],
        seen,
        task.priority[frame],
        task.minds,
        task.places,
        task.striker,
        strikes_s,
    )
    return allowed_accel(ego, scene, task.street, task.crossings, memory, task.step_s)


@compiled
def _strikes_s(path: Path, s: float, speed: float, frame: int, began: int) -> float:
    """Returns the time to the contact's place during the conflict; else inf."""
    last = len(path.s) - 1
    if began <= frame < last and speed > 0.0:
        to_go_m: float = path.s[last] - s
        return max(to_go_m, 0.0) / speed
    return math.inf


@compiled
def _drive(task: Task, first: int, after: int, memory: Floats) -> Floats:
    """Returns path metres for all frames and `after` more, recorded until `first`."""
    path, recorded_mps, last, step_s = task.path, task.speed_mps, len(task.path.s) - 1, task.step_s
    found = np.empty(last + 1 + after)
    found[: first + 1] = path.s[: first + 1]
    s, speed, point = path.s[first], recorded_mps[first], first
    before = (speed - recorded_mps[max(first - 1, 0)]) / step_s
    kept_mps = recorded_mps[min(max(task.began, first), last)]
    known = np.zeros(len(task.vehicle), dtype=np.bool_)
    for t in range(first):
        known |= task.known[t]
    bodies = task.conceals.copy()
    bodies[0] = False
    for t in range(first, last + after):
        frame = min(t, last)
        state = task.states[frame].copy()
        known |= task.known[frame]
        beyond_s = (t - frame) * step_s
        for i in range(1, state.shape[1]):
            state[X, i] += beyond_s * state[VX, i]
            state[Y, i] += beyond_s * state[VY, i]
        x, y, _ = pose_at(path, s)
        state[X, 0], state[Y, 0] = x, y
        seen, walls = known.copy(), walls_of(state, bodies)
        for i in range(1, len(seen)):
            if seen[i] and task.minds[i]:
                seen[i] = is_in_view(walls, x, y, moving_box(state, i))
        while point < last and path.s[point + 1] <= s:
            point += 1
        accel = _asked(task, t, OnPath(path, point, s, speed, task.size), state, seen, memory)
        wanted = recorded_mps[min(t + 1, last)]
        if t + 1 > task.began:
            wanted = max(wanted, kept_mps)
        accel = min(accel, (wanted - speed) / step_s, SPEEDS_UP_MPS2)
        accel = max(accel, min(before, 0.0) - JERK_MPS3 * step_s)
        slower = max(speed + accel * step_s, 0.0)
        s += (speed + slower) / 2 * step_s
        speed, before = slower, accel
        found[t + 1] = s
        if speed == 0.0 and t >= last:
            found[t + 2 :] = s
            break
    return found


@compiled
def meets(path: Path, size: Size, track: MovingBox[Floats], s: Floats, acts: int, step_s: float) -> RolloutEnd:
    """Tells whether driving `s` touches an actor that keeps its last velocity."""
    last = len(track.x) - 1
    frames = Path(track.x, track.y, track.heading, np.arange(last + 1).astype(np.float64))
    lead, passing = 0.0, 0.0
    pose, other, speed = pose_at(path, s[acts]), pose_at(frames, float(acts)), 0.0
    fine = round(step_s / FINE_S)
    for step in range(1, (len(s) - 1 - acts) * fine + 1):
        frame = acts + step / fine
        k = min(int(frame), len(s) - 2)
        at = s[k] + (frame - k) * (s[k + 1] - s[k])
        speed = (s[k + 1] - s[k]) / step_s
        if frame <= last:
            r = min(k, last - 1)
            lead, passing = at - path.s[r] - (frame - r) * (path.s[r + 1] - path.s[r]), speed
        pose, other = pose_at(path, at), pose_at(frames, min(frame, float(last)))
        if frame > last:
            beyond_s = (frame - last) * step_s
            other = other[0] + beyond_s * track.vx[last], other[1] + beyond_s * track.vy[last], other[2]
        if touches(pose, size, other, track.size):
            return RolloutEnd(True, speed, pose, other, lead, passing)
    return RolloutEnd(False, speed, pose, other, lead, passing)
