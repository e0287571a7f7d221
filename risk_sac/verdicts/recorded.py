"""Paths and bodies of a recorded episode, and the path of an ego that keeps its lane."""

import numpy as np

from risk_sac.geometry import Size
from risk_sac.types import Floats
from risk_sac.verdicts.along import Along, along_series
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.path import Path, recorded_path

IN_PLACE_M = 0.75  # what an ego moves across that keeps its lane; round a tight turn its centre moves in by 0.5 m
NO_JUMP_M = 0.5  # what the offset may differ in a step from what the ego moved across
STANDING_M = 0.01  # driven in a step; below it the direction of motion is noise


def column(values: Floats, actor: int) -> Floats:
    """One actor's values, contiguous as compiled code needs them."""
    return np.ascontiguousarray(values[:, actor])


def recorded_size(evidence: Evidence, actor: int) -> Size:
    """The size of an actor."""
    return Size(float(evidence.length_m[actor]) / 2, float(evidence.width_m[actor]) / 2)


def recorded_motion(evidence: Evidence, actor: int) -> Body[Floats]:
    """The body of an actor in every frame."""
    e = evidence
    x, y, heading, vx, vy = (column(each, actor) for each in (e.x_m, e.y_m, e.heading_rad, e.vx_mps, e.vy_mps))
    return Body(x, y, heading, vx, vy, recorded_size(e, actor))


def ego_path(evidence: Evidence) -> Path:
    """The ego's recorded path."""
    return recorded_path(evidence.x_m[:, 0], evidence.y_m[:, 0], evidence.heading_rad[:, 0])


def moved_across(evidence: Evidence) -> Floats:
    """How far the ego's centre has moved across its lanes since the first frame, `T`, m, positive to the left.

    It is the offset of its front bumper from the lane that SUMO has it on, without the jumps to the next lane and what
    the front is turned aside. SUMO goes on with the last lane beside the road. Without recorded offsets it is the sum
    of the lateral speed, which drifts where lanes bend.
    """
    e = evidence
    lateral = e.lateral_mps[:, 0] * e.step_s
    offset, width = e.lane_offset_m[:, 0], e.ground.lane_width_m
    if np.isnan(offset).any():
        summed: Floats = np.cumsum(lateral)
        return summed
    steps = np.diff(offset, prepend=offset[:1])
    steps -= width * np.round((steps - lateral) / width)
    steps = np.where(np.abs(steps - lateral) > NO_JUMP_M, lateral, steps)  # to a lane of another width
    aside = e.length_m[0] / 2 * np.sin(e.heading_rad[:, 0] - lane_heading(e, ego_path(e), 0))
    moved: Floats = np.cumsum(steps) - aside
    return moved


def lane_path(evidence: Evidence, first: int) -> Path | None:
    """The ego's path if it had kept its lane from frame `first` on; None if it did.

    It is the recorded path without what the ego moved across: the lane is the one that it was in at `first`, and its
    place across that lane stays the same. Choice: an ego that moved across by no more than 0.75 m kept its lane.
    """
    recorded = ego_path(evidence)
    moved = moved_across(evidence)
    moved = np.where(np.arange(len(moved)) > first, moved - moved[first], 0.0)
    if np.abs(moved).max() <= IN_PLACE_M:
        return None
    heading = lane_heading(evidence, recorded, first)
    x, y = recorded.x + moved * np.sin(heading), recorded.y - moved * np.cos(heading)
    return recorded_path(x, y, heading)


def lane_heading(evidence: Evidence, recorded: Path, first: int) -> Floats:
    """Heading of the lane beside the ego after frame `first`, `T`; of the ego's body up to it."""
    dx, dy = (np.diff(each, prepend=each[:1]) for each in (recorded.x, recorded.y))
    driven = np.hypot(dx, dy)
    across = evidence.lateral_mps[:, 0] * evidence.step_s
    lane = np.arctan2(dy, dx) - np.arcsin(np.clip(across / np.maximum(driven, STANDING_M), -1.0, 1.0))
    frames = np.arange(len(driven))
    lane = np.where(frames > first, lane, recorded.heading)
    latest: Floats = lane[np.maximum.accumulate(np.where((driven > STANDING_M) | (frames <= first), frames, 0))]
    return latest


def seen_along(path: Path, evidence: Evidence, striker: int) -> Along[Floats]:
    """The striker along the ego's path, frame by frame."""
    size, motion = recorded_size(evidence, 0), recorded_motion(evidence, striker)
    return along_series(path, column(evidence.speed_mps, 0), size, motion)
