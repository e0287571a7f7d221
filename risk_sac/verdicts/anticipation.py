"""Puts the defensive driver in the ego's place.

It drives from when it would have been slower than the ego until 3 s after the contact.

It is followed along the ego's path while all others move as recorded. On the record it is asked in every frame since
the release how much it would allow itself; where that is less than what the ego did, the two part. It takes over at the
beginning of the last stretch of restraint, which must last until the contact: one that has been unrestrained for more
than 1 s has let the ego drive as it did. What counts is restraint by the striker, and by places that hide a pedestrian
where the striker is one: the driver prevents nothing because something else slows it down. Only on a path that the ego
did not take does it mind all others.

The conflict with the striker is the one that all reference drivers judge: from its beginning until the contact the
driver knows of it, and where it would end. The record tells that the striker did not stop or yield.

Choices: until the conflict begins it drives no faster than the ego did at the same time; having been slower, it speeds
up by 2 m/s² at most. From then on it may keep the ego's speed at that moment, or what the ego speeds up to: the ego's
braking in the conflict is not its own. It sees what no vehicle hides from it and has been in the ego's sight before.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.geometry import Size, touches
from risk_sac.jit import compiled
from risk_sac.types import VX, VY, Bools, Floats, Kind, X, Y
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.defensive import PRIORITY, PRIORITY_S, allowed_accel, nothing_remembered
from risk_sac.verdicts.drivers import JERK_MPS3
from risk_sac.verdicts.evidence import PER_ACTOR, Evidence
from risk_sac.verdicts.moment import Scene
from risk_sac.verdicts.path import Path, pose_at
from risk_sac.verdicts.present import OnPath, Street, body_of, street_of
from risk_sac.verdicts.recorded import recorded_size
from risk_sac.verdicts.rollout import FINE_S, Ending
from risk_sac.verdicts.unseen import Crossings, crossings_on, is_in_view, walls_of

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
    released = int(np.searchsorted(e.time_s, -e.step_s / 2))
    acts = _acts(task, released, latest, memory)
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
    """The frame from which the driver drives; `memory` is then what it remembers there."""
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
    """The acceleration that the driver allows itself in frame `t`, or after the last one."""
    frame = min(t, len(task.path.s) - 1)
    strikes_s = _strikes_s(task.path, ego.s, ego.speed_mps, t, task.began)
    scene = Scene(
        state,
        task.vehicle,
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
    """Time until the driver reaches the place of the contact, during the recorded conflict; else inf."""
    last = len(path.s) - 1
    if began <= frame < last and speed > 0.0:
        to_go_m: float = path.s[last] - s
        return max(to_go_m, 0.0) / speed
    return math.inf


@compiled
def _drive(task: Task, first: int, after: int, memory: Floats) -> Floats:
    """Metres along the path per frame, `after` frames beyond the last; the ego's own up to the `first`."""
    path, recorded_mps, last, step_s = task.path, task.speed_mps, len(task.path.s) - 1, task.step_s
    found = np.empty(last + 1 + after)
    found[: first + 1] = path.s[: first + 1]
    s, speed, point = path.s[first], recorded_mps[first], first
    before = (speed - recorded_mps[max(first - 1, 0)]) / step_s
    kept_mps = recorded_mps[min(max(task.began, first), last)]
    known = np.zeros(len(task.vehicle), dtype=np.bool_)
    for t in range(first):
        known |= task.known[t]
    bodies = task.vehicle.copy()
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
                seen[i] = is_in_view(walls, x, y, body_of(state, i))
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
def meets(path: Path, size: Size, track: Body[Floats], s: Floats, acts: int, step_s: float) -> Ending:
    """Whether what was driven along a path touches an actor, which goes on with its last velocity."""
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
            return Ending(True, speed, pose, other, lead, passing)
    return Ending(False, speed, pose, other, lead, passing)
