"""Path of the ego's centre by distance driven, extended straight beyond both ends."""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.geometry import Pose
from risk_sac.jit import compiled
from risk_sac.types import Floats

STANDING_M = 1e-6  # two points nearer than this are one


class Path(NamedTuple):
    """Path of `m` points, at least one."""

    x: Floats
    y: Floats
    heading: Floats  # of the body, without jumps of 2π
    s: Floats  # metres along the path, never falling


def recorded_path(x: Floats, y: Floats, heading: Floats) -> Path:
    """Builds a path through a body's positions, with its recorded headings."""
    steps = np.hypot(np.diff(x), np.diff(y))
    return Path(
        np.ascontiguousarray(x), np.ascontiguousarray(y), np.unwrap(heading), np.concatenate(([0.0], np.cumsum(steps)))
    )


def polyline(x: Floats, y: Floats, heading_rad: float = 0.0) -> Path:
    """Builds a path through points, with headings along it.

    Args:
      x: `m` points, the ego's centre first.
      y: the same for y.
      heading_rad: of a path of one point.
    """
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if len(x) < 2:
        return Path(x, y, np.array([heading_rad]), np.zeros(1))
    along = np.arctan2(np.diff(y), np.diff(x))
    return recorded_path(x, y, np.concatenate((along[:1], along)))


@compiled
def pose_at(path: Path, s: float) -> Pose:
    """Computes the body's pose after `s` metres: x, y, heading."""
    last = len(path.s) - 1
    if s >= path.s[last] or last == 0:
        beyond, h = s - path.s[last], path.heading[last]
        return path.x[last] + beyond * math.cos(h), path.y[last] + beyond * math.sin(h), h
    if s <= path.s[0]:
        beyond, h = s - path.s[0], path.heading[0]
        return path.x[0] + beyond * math.cos(h), path.y[0] + beyond * math.sin(h), h
    k = np.searchsorted(path.s, s, side="right")
    share = (s - path.s[k - 1]) / max(path.s[k] - path.s[k - 1], STANDING_M)
    return (
        path.x[k - 1] + share * (path.x[k] - path.x[k - 1]),
        path.y[k - 1] + share * (path.y[k] - path.y[k - 1]),
        path.heading[k - 1] + share * (path.heading[k] - path.heading[k - 1]),
    )


@compiled
def project(path: Path, first: int, x: float, y: float) -> tuple[float, float, float]:
    """Projects a position onto the path, from its `first` point on.

    Returns metres along, metres to the left and the heading there. The straight extensions count, also the one behind
    the `first` point.
    """
    last = len(path.s) - 1
    h = path.heading[first]
    along = (x - path.x[first]) * math.cos(h) + (y - path.y[first]) * math.sin(h)
    across = (y - path.y[first]) * math.cos(h) - (x - path.x[first]) * math.sin(h)
    best, s, d, heading = math.inf, path.s[first] + along, across, h
    if along <= 0.0:
        best = across * across
    h_end = path.heading[last]
    along = (x - path.x[last]) * math.cos(h_end) + (y - path.y[last]) * math.sin(h_end)
    across = (y - path.y[last]) * math.cos(h_end) - (x - path.x[last]) * math.sin(h_end)
    if along >= 0.0 and across * across < best:
        best, s, d, heading = across * across, path.s[last] + along, across, h_end
    for k in range(first, last):
        dx, dy = path.x[k + 1] - path.x[k], path.y[k + 1] - path.y[k]
        step = path.s[k + 1] - path.s[k]
        if step < STANDING_M:
            continue
        share = min(max(((x - path.x[k]) * dx + (y - path.y[k]) * dy) / (step * step), 0.0), 1.0)
        off_x, off_y = x - path.x[k] - share * dx, y - path.y[k] - share * dy
        squared = off_x * off_x + off_y * off_y
        if squared < best:
            best = squared
            s = path.s[k] + share * step
            side = dx * off_y - dy * off_x
            d = math.copysign(math.sqrt(squared), side)
            heading = path.heading[k] + share * (path.heading[k + 1] - path.heading[k])
    return s, d, heading
