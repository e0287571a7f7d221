"""Reference drivers in an episode of any outcome: in place of an ego that keeps its lane and its first speed.

So the boundary of what a competent driver avoids runs through scenes that the ego itself passes. The others move as
they did in the recording, in which they may have reacted to the ego.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from risk_sac.verdicts.conflict import find_conflict
from risk_sac.verdicts.course import Path, at, pose_at, recorded_path
from risk_sac.verdicts.evidence import Evidence, lane_path, recorded_motion, recorded_size
from risk_sac.verdicts.reference import from_behind, reference_outcomes
from risk_sac.world.geometry import touches
from risk_sac.world.types import Floats

COMPETENT = ("r157", "fsm")  # UN R157's performance models 1 and 2
BEYOND_S = 4.0  # that the others go on after the recording, with their last velocities: the drivers' look-ahead


def avoided_by(evidence: Evidence, way: Path) -> Mapping[str, bool]:
    """Driver of `COMPETENT` → whether it avoids the first contact of an ego that keeps lane and speed.

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
    outcomes = reference_outcomes(until, striker, find_conflict(until, striker))
    return {name: outcomes[name].avoids for name in COMPETENT}


def keeping_on(evidence: Evidence, way: Path) -> Evidence:
    """The episode with an ego that keeps its lane and its speed from the release on, and `BEYOND_S` more."""
    first, more = evidence.released, round(BEYOND_S / evidence.step_s)
    e = _prolonged(evidence, more)
    driven = _way_from(evidence, first)
    path = driven if driven.s[-1] >= way.s[-1] else way
    speed = float(evidence.speed_mps[first, 0])
    poses = np.array([pose_at(path, speed * t * e.step_s) for t in range(len(e.time_s) - first)])
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


def first_contact(evidence: Evidence) -> tuple[int, int] | None:
    """The first frame from the release on in which an actor touches the ego, but not at its rear; and its column."""
    own, size, contacts = recorded_motion(evidence, 0), recorded_size(evidence, 0), []
    for other in range(1, len(evidence.ids)):
        motion = recorded_motion(evidence, other)
        apart = np.hypot(motion.x - own.x, motion.y - own.y)
        reach = size.half_length + size.half_width + motion.size.half_length + motion.size.half_width
        for t in np.flatnonzero(apart <= reach):
            pose, box = (own.x[t], own.y[t], own.heading[t]), at(motion, int(t))
            if t > evidence.released and touches(pose, size, (box.x, box.y, box.heading), motion.size):
                if not from_behind(pose, (box.x, box.y, box.heading), size, motion.size):
                    contacts.append((int(t), other))
                break
    return min(contacts, default=None)


def _way_from(evidence: Evidence, first: int) -> Path:
    """The lane that the ego drove along from a frame on."""
    lane = lane_path(evidence, first)
    return recorded_path(lane.x[first:], lane.y[first:], lane.heading[first:])


def _with_ego(values: Floats, own: Floats, first: int) -> Floats:
    """Values `T x n` with another ego from a frame on."""
    changed = values.copy()
    changed[first:, 0] = own
    return changed


def _prolonged(evidence: Evidence, steps: int) -> Evidence:
    """The evidence and some more frames, in which all go on with their last velocity."""
    e, after_s = evidence, np.arange(1, steps + 1) * evidence.step_s
    names = ("heading_rad", "vx_mps", "vy_mps", "speed_mps", "lane_offset_m", "link", "known")
    changed: dict[str, Any] = {
        name: np.concatenate((getattr(e, name), np.repeat(getattr(e, name)[-1:], steps, axis=0))) for name in names
    }
    for name, speed in (("x_m", e.vx_mps), ("y_m", e.vy_mps)):
        further = getattr(e, name)[-1] + after_s[:, None] * speed[-1]
        changed[name] = np.concatenate((getattr(e, name), further))
    for name in ("lateral_mps", "accel_mps2"):
        changed[name] = np.concatenate((getattr(e, name), np.zeros((steps, len(e.ids)))))
    return replace(e, time_s=np.concatenate((e.time_s, e.time_s[-1] + after_s)), **changed)
