"""Paths and bodies of a recorded episode, and the path of an ego that keeps its lane."""

import numpy as np

from risk_sac.geometry import Size
from risk_sac.types import Floats
from risk_sac.verdicts.along import WANDER_M, Along, along_series
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.path import Path, recorded_path

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


def front_moved_across(evidence: Evidence) -> Floats:
    """Sums the lateral motion of the ego's front bumper, `T`, m, positive to the left.

    The sum starts in the first frame and goes on across lanes.

    It is the front bumper's offset from the lane that SUMO has it on, without the jumps to the next lane; beside the
    road SUMO goes on with the last lane. Without recorded offsets it is the sum of the lateral speed, which drifts
    where lanes bend.
    """
    e = evidence
    lateral = e.lateral_mps[:, 0] * e.step_s
    offset, width = e.lane_offset_m[:, 0], e.ground.lane_width_m
    steps = np.diff(offset, prepend=offset[:1])
    steps -= width * np.round((steps - lateral) / width)
    jumps = ~(np.abs(steps - lateral) <= NO_JUMP_M)  # to a lane of another width; NaN without offsets
    moved: Floats = np.cumsum(np.where(jumps, lateral, steps))
    return moved


def keeps_lane(evidence: Evidence, first: int) -> bool:
    """Whether the ego kept its lane from frame `first` on.

    Choice: its front moved across by 0.375 m at most.
    """
    moved = front_moved_across(evidence)[first:]
    return bool(np.abs(moved - moved[0]).max() <= WANDER_M)


def lane_path(evidence: Evidence, first: int) -> Path:
    """Returns the path of the lane that the ego was in at frame `first`.

    It is the recorded path without what the ego moved across since; its place across the lane stays the same.
    """
    recorded, moved, lane = ego_path(evidence), front_moved_across(evidence), lane_heading(evidence)
    if not np.isnan(evidence.lane_offset_m[:, 0]).any():  # of its centre: less than its front, if it is turned aside
        moved = moved - evidence.length_m[0] / 2 * np.sin(evidence.heading_rad[:, 0] - lane)
    after = np.arange(len(moved)) > first
    moved = np.where(after, moved - moved[first], 0.0)
    x, y = recorded.x + moved * np.sin(lane), recorded.y - moved * np.cos(lane)
    return recorded_path(x, y, np.where(after, lane, recorded.heading))


def lane_heading(evidence: Evidence) -> Floats:
    """Heading of the ego's lane, `T`: from where it drove and how much of that was across.

    While the ego stands it is the heading before, in the first frame the ego's own.
    """
    x, y = evidence.x_m[:, 0], evidence.y_m[:, 0]
    dx, dy = np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1])
    driven = np.hypot(dx, dy)
    across = evidence.lateral_mps[:, 0] * evidence.step_s
    lane = np.arctan2(dy, dx) - np.arcsin(np.clip(across / np.maximum(driven, STANDING_M), -1.0, 1.0))
    lane[0] = evidence.heading_rad[0, 0]
    latest: Floats = lane[np.maximum.accumulate(np.where(driven > STANDING_M, np.arange(len(lane)), 0))]
    return latest


def seen_along(path: Path, evidence: Evidence, striker: int) -> Along[Floats]:
    """The striker along the ego's path, frame by frame."""
    size, motion = recorded_size(evidence, 0), recorded_motion(evidence, striker)
    return along_series(path, column(evidence.speed_mps, 0), size, motion)
