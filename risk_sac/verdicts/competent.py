"""Plays competent drivers in any episode, for an ego that keeps on.

So the boundary of what a competent driver avoids runs through scenes that the ego itself passes, and is the same for
all egos. The others move as they did in the recording, in which they may have reacted to the ego. A story may wait for
a distance from the ego, so until the first of them acts the ego is where it was recorded.

Source: UN Regulation 157, Annex 4, Appendix 3 (00 series): a cut-in is perceived once the vehicle is more than 0.375 m
off its lane's centre. Its risk is evaluated for 0.4 s. It is a danger if the time to collision is then 2 s at most, and
braking begins 0.75 s later. Compared with the JRC's implementation (github.com/ec-jrc/JRC-FSM) and esmini's.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from risk_sac.records import ConflictType
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.course import (
    DANGER_TTC_S,
    HORIZON_S,
    LEADER_BRAKES_MPS2,
    WANDER_M,
    Path,
    at,
    pose_at,
    recorded_path,
    towards,
)
from risk_sac.verdicts.drivers import R157_PERCEIVES_S
from risk_sac.verdicts.evidence import Evidence, lane_path, lanes_of, recorded_motion, recorded_size, seen_along
from risk_sac.verdicts.reference import from_behind, reference_outcomes
from risk_sac.verdicts.rollout import FUZZY, R157, STANDING_MPS, drive
from risk_sac.world.geometry import touches
from risk_sac.world.types import Floats, Kind

COMPETENT = ("r157", "fsm")  # UN R157's performance models 1 and 2
BEYOND_S = 4.0  # that the others go on after the recording, with their last velocities; the drivers' look-ahead
LOOKS_S = 7.0  # before the contact, from when on the FSM looks out; choice
MOVES_MPS, BRAKES_MPS2 = 0.2, 1.0  # at which another actor acts; choice
FOLLOWED_S = 20.0  # that a driver is followed for: beyond it all have stopped
SAME_WAY = (ConflictType.CUT_IN, ConflictType.LEADER)


def avoided_by(evidence: Evidence, way: Path) -> Mapping[str, bool]:
    """Driver of `COMPETENT` → whether it avoids a steady ego's first contact.

    Without such a contact there is nothing to avoid, and both do. A contact at the ego's rear is none of its own.

    Args:
      evidence: of the whole episode.
      way: the ego's way ahead at the release, its centre first.
    """
    steady = keeping_on(evidence, way)
    met = first_contact(steady)
    if met is None:
        return dict.fromkeys(COMPETENT, True)
    frame, striker = met
    until = steady.until(frame)
    conflict = find_conflict(until, striker)
    if conflict.type not in SAME_WAY:  # the regulation's model knows none, so the judge's reading of it decides
        outcomes = reference_outcomes(until, striker, conflict)
        return {name: outcomes[name].avoids for name in COMPETENT}
    dangerous = becomes_dangerous(steady, striker, frame)
    perceived = 0 if dangerous is None else dangerous + round(R157_PERCEIVES_S / steady.step_s)
    looks = max(steady.released, frame - round(LOOKS_S / steady.step_s))
    return {
        "r157": dangerous is None or _avoids(steady, striker, R157, perceived),
        "fsm": _avoids(steady, striker, FUZZY, looks),
    }


def becomes_dangerous(evidence: Evidence, striker: int, contact: int) -> int | None:
    """Finds when a vehicle becomes dangerous by the regulation, or None.

    It does where it comes into the ego's way, or into sight, and the time to collision is 2 s at most after the 0.4 s
    of evaluation. It also does where it brakes harder than 5 m/s² in the ego's lane. Choice: with what is further
    off then the driver keeps its distance, as behind any vehicle ahead.
    """
    e, seen = evidence, seen_along(evidence.ego_path, evidence, striker)
    width, offset = lanes_of(e, 0).width_m, e.lane_offset_m[:, striker]
    in_lane = np.abs(seen.across_m) <= width / 2
    off = [towards(*each) for each in zip(seen.across_m.tolist(), offset.tolist(), width.tolist(), strict=True)]
    in_the_way = (in_lane | (np.array(off) > WANDER_M)) & e.known[:, striker]
    out_of_it = np.flatnonzero(~in_the_way[e.released : contact])
    enters = e.released + (int(out_of_it[-1]) + 1 if len(out_of_it) else 0)
    evaluated = min(enters + round(R157_PERCEIVES_S / e.step_s), contact)
    if seen.gap_m[evaluated] <= 0.0 or seen.ttc_s[evaluated] <= DANGER_TTC_S:
        return enters
    near = seen.gap_m <= HORIZON_S * e.speed_mps[:, 0]
    braking = np.flatnonzero((e.accel_mps2[:, striker] < -LEADER_BRAKES_MPS2) & in_lane & near)
    return next((int(frame) for frame in braking if enters <= frame < contact), None)


def keeping_on(evidence: Evidence, way: Path) -> Evidence:
    """Returns the episode with an ego that keeps lane and first speed."""
    first, more = first_act(evidence), round(BEYOND_S / evidence.step_s)
    e = _prolonged(evidence, more)
    lane = lane_path(evidence, evidence.released)
    driven = recorded_path(*(values[evidence.released :] for values in lane[:3]))
    path = driven if driven.s[-1] >= way.s[-1] else way
    begins_m, speed = float(driven.s[first - evidence.released]), float(evidence.speed_mps[evidence.released, 0])
    poses = np.array([pose_at(path, begins_m + speed * t * e.step_s) for t in range(len(e.time_s) - first)])
    x, y, heading = poses.T
    moved = {
        "x_m": x,
        "y_m": y,
        "heading_rad": heading,
        "vx_mps": speed * np.cos(heading),
        "vy_mps": speed * np.sin(heading),
        "speed_mps": np.full(len(x), speed),
        "lateral_mps": np.zeros(len(x)),
        "accel_mps2": np.zeros(len(x)),
        "lane_offset_m": np.full(len(x), evidence.lane_offset_m[first, 0]),
    }
    changed: dict[str, Any] = {name: _with_ego(getattr(e, name), own, first) for name, own in moved.items()}
    return replace(e, **changed)


def first_act(evidence: Evidence) -> int:
    """Returns when another actor first appears, moves sideways, brakes or starts."""
    e, since = evidence, slice(evidence.released, None)
    walks, stood = e.kind[1:] == Kind.PEDESTRIAN, e.speed_mps[e.released, 1:] < MOVES_MPS
    acts = (np.abs(e.lateral_mps[since, 1:]) > MOVES_MPS) & ~walks
    acts |= (e.accel_mps2[since, 1:] < -BRAKES_MPS2) | ((e.speed_mps[since, 1:] > MOVES_MPS) & stood)
    acts |= e.known[since, 1:] & ~e.known[e.released, 1:]
    frames = np.flatnonzero(acts.any(axis=1))
    return e.released + (int(frames[0]) if len(frames) else 0)


def first_contact(evidence: Evidence) -> tuple[int, int] | None:
    """Returns frame and column of the first contact not at the rear."""
    own, size, contacts = recorded_motion(evidence, 0), recorded_size(evidence, 0), []
    for other in range(1, len(evidence.ids)):
        motion = recorded_motion(evidence, other)
        apart = np.hypot(motion.x - own.x, motion.y - own.y)
        reach = size.half_length + size.half_width + motion.size.half_length + motion.size.half_width
        for t in np.flatnonzero(apart <= reach).tolist():
            pose, box = (own.x[t], own.y[t], own.heading[t]), at(motion, t)
            there = box.x, box.y, box.heading
            if t > evidence.released and touches(pose, size, there, motion.size):
                if not from_behind(pose, there, size, motion.size):
                    contacts.append((t, other))
                break
    return min(contacts, default=None)


def _avoids(evidence: Evidence, striker: int, driver: int, first: int) -> bool:
    """Whether a driver that perceives from a frame on avoids a vehicle."""
    e, size = evidence, recorded_size(evidence, 0)
    if first >= len(e.time_s) - 1:
        return False
    motion = recorded_motion(e, striker)
    track = motion._replace(heading=np.unwrap(motion.heading))
    speed, grip = float(e.speed_mps[first, 0]), e.ground.friction * GRAVITY_MPS2
    end = drive(driver, e.ego_path, size, track, first, speed, grip, FOLLOWED_S, e.step_s, np.empty(0))
    return bool(not end.touched or end.speed_mps <= STANDING_MPS or from_behind(end.pose, end.other, size, track.size))


def _with_ego(values: Floats, own: Floats, first: int) -> Floats:
    """Values `T x n` with another ego from a frame on."""
    changed = values.copy()
    changed[first:, 0] = own
    return changed


def _prolonged(evidence: Evidence, steps: int) -> Evidence:
    """Prolongs the evidence by `steps` frames at the last velocities.

    Choice: a vehicle that comes over to the ego's line stays on it, as one does that changes lanes.
    """
    e, after_s = evidence, np.arange(1, steps + 1) * evidence.step_s
    heading = float(e.heading_rad[-1, 0])
    left = np.array([-math.sin(heading), math.cos(heading)])
    across_m = left @ np.array([e.x_m[-1] - e.x_m[-1, 0], e.y_m[-1] - e.y_m[-1, 0]])
    across_mps = left @ np.array([e.vx_mps[-1], e.vy_mps[-1]])
    comes = (across_m * across_mps < 0.0) & (e.kind != Kind.PEDESTRIAN)
    arrives_s = np.where(comes, np.abs(across_m) / np.maximum(np.abs(across_mps), MOVES_MPS), np.inf)
    too_far_m = across_mps * np.maximum(after_s[:, None] - arrives_s, 0.0)
    names = ("heading_rad", "vx_mps", "vy_mps", "speed_mps", "lane_offset_m", "link", "known")
    changed: dict[str, Any] = {}
    for name in names:
        last = getattr(e, name)[-1:]
        changed[name] = np.concatenate((getattr(e, name), np.repeat(last, steps, axis=0)))
    for name, speed, part in (("x_m", e.vx_mps, left[0]), ("y_m", e.vy_mps, left[1])):
        further = getattr(e, name)[-1] + after_s[:, None] * speed[-1] - part * too_far_m
        changed[name] = np.concatenate((getattr(e, name), further))
    for name in ("lateral_mps", "accel_mps2"):
        changed[name] = np.concatenate((getattr(e, name), np.zeros((steps, len(e.ids)))))
    return replace(e, time_s=np.concatenate((e.time_s, e.time_s[-1] + after_s)), **changed)
