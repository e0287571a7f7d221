"""Oriented boxes seen from the ego: overlap, gap, sweep and line of sight.

Everything the risk measures need is expressed once per frame in the ego's frame (`relative_view`):
x ahead of the ego's centre, y to its left. There the ego is an axis-aligned box at the origin, which
makes the separating-axis test (Gottschalk et al. 1996) four rows of one array.
"""

from dataclasses import dataclass

import numpy as np

from risk_sac.types import Bools, Floats, Frame

NO_MOTION = 1e-9  # m/s; keeps the sweep's divisions finite, far below any motion that matters


@dataclass(frozen=True, slots=True)
class RelativeView:
    """The `n` other actors in the ego's frame; the ego is the box |x| <= ego_half_length, |y| <= ego_half_width."""

    x: Floats
    y: Floats
    vx: Floats  # relative velocity: the other's minus the ego's
    vy: Floats
    cos: Floats  # of the heading relative to the ego's
    sin: Floats
    half_length: Floats
    half_width: Floats
    ego_vx: float  # the ego's own velocity along its axes
    ego_vy: float
    ego_half_length: float
    ego_half_width: float
    separation: Floats  # `4 x n`: signed distance of the centres along each separating axis
    reach: Floats  # `4 x n`: sum of both boxes' half extents along that axis

    @property
    def gap(self) -> Floats:
        """Distance between the bodies, `n`, 0 when they touch.

        Exact for parallel and perpendicular bodies, else a lower bound: the larger of the distances to
        each body's bounding box in the other's frame.
        """
        clear: Floats = np.maximum(np.abs(self.separation) - self.reach, 0.0)
        squared = clear * clear
        gap: Floats = np.sqrt(np.maximum(squared[0] + squared[1], squared[2] + squared[3]))
        return gap

    @property
    def overlap(self) -> Bools:
        """Whether the bodies touch or overlap, `n` (separating-axis theorem, exact)."""
        touching: Bools = np.logical_and.reduce(np.abs(self.separation) <= self.reach)
        return touching


def relative_view(frame: Frame) -> RelativeView:
    """Expresses every other actor of `frame` in the ego's frame."""
    cos_ego, sin_ego = np.cos(frame.heading_rad[0]), np.sin(frame.heading_rad[0])
    dx, dy = frame.x_m[1:] - frame.x_m[0], frame.y_m[1:] - frame.y_m[0]
    heading = frame.heading_rad[1:] - frame.heading_rad[0]
    cos, sin = np.cos(heading), np.sin(heading)
    ego_vx, ego_vy = frame.vx_mps[0], frame.vy_mps[0]
    dvx, dvy = frame.vx_mps[1:] - ego_vx, frame.vy_mps[1:] - ego_vy
    return box_view(
        x=dx * cos_ego + dy * sin_ego,
        y=dy * cos_ego - dx * sin_ego,
        vx=dvx * cos_ego + dvy * sin_ego,
        vy=dvy * cos_ego - dvx * sin_ego,
        cos=cos,
        sin=sin,
        half_length=frame.length_m[1:] / 2,
        half_width=frame.width_m[1:] / 2,
        ego_vx=float(ego_vx * cos_ego + ego_vy * sin_ego),
        ego_vy=float(ego_vy * cos_ego - ego_vx * sin_ego),
        ego_half_length=float(frame.length_m[0]) / 2,
        ego_half_width=float(frame.width_m[0]) / 2,
    )


def box_view(
    *,
    x: Floats,
    y: Floats,
    vx: Floats,
    vy: Floats,
    cos: Floats,
    sin: Floats,
    half_length: Floats,
    half_width: Floats,
    ego_vx: float,
    ego_vy: float,
    ego_half_length: float,
    ego_half_width: float,
) -> RelativeView:
    """Adds the separating axes: the ego's x and y, then the other's long and cross axis."""
    n = len(x)
    abs_cos, abs_sin = np.abs(cos), np.abs(sin)
    separation, reach = np.empty((4, n)), np.empty((4, n))
    separation[0] = x
    separation[1] = y
    separation[2] = x * cos + y * sin
    separation[3] = y * cos - x * sin
    reach[0] = ego_half_length + half_length * abs_cos + half_width * abs_sin
    reach[1] = ego_half_width + half_length * abs_sin + half_width * abs_cos
    reach[2] = half_length + ego_half_length * abs_cos + ego_half_width * abs_sin
    reach[3] = half_width + ego_half_length * abs_sin + ego_half_width * abs_cos
    return RelativeView(
        x,
        y,
        vx,
        vy,
        cos,
        sin,
        half_length,
        half_width,
        ego_vx,
        ego_vy,
        ego_half_length,
        ego_half_width,
        separation,
        reach,
    )


def time_to_contact(view: RelativeView) -> Floats:
    """Time until the bodies touch if both keep their velocity and heading, `n`, s; inf if they never do.

    On each separating axis the overlap lasts from t_in to t_out; bodies touch from the largest t_in on,
    provided it is no later than the smallest t_out.
    """
    speed = np.empty_like(view.separation)
    speed[0] = view.vx
    speed[1] = view.vy
    speed[2] = view.vx * view.cos + view.vy * view.sin
    speed[3] = view.vy * view.cos - view.vx * view.sin
    speed[np.abs(speed) < NO_MOTION] = NO_MOTION
    centre = -view.separation / speed
    half = view.reach / np.abs(speed)
    enter = (centre - half).max(axis=0)
    leave = (centre + half).min(axis=0)
    never = (enter > leave) | (leave < 0.0)
    ttc: Floats = np.maximum(enter, 0.0)
    ttc[never] = np.inf
    return ttc


def corners(view: RelativeView) -> tuple[Floats, Floats]:
    """Corners of the others in the ego's frame, two arrays `4 x n`, counter-clockwise from the front left."""
    along = np.outer((1.0, -1.0, -1.0, 1.0), view.half_length)
    across = np.outer((1.0, 1.0, -1.0, -1.0), view.half_width)
    return view.x + along * view.cos - across * view.sin, view.y + along * view.sin + across * view.cos


def line_of_sight(view: RelativeView, occludes: Bools) -> Bools:
    """Whether any of a body's corners or its centre can be seen from the ego's centre, `n`.

    Args:
      view: the scene.
      occludes: `n`; which bodies block the view. A body never hides itself.
    """
    n = len(view.x)
    walls = np.flatnonzero(occludes)
    if n == 0 or len(walls) == 0:
        return np.ones(n, dtype=np.bool_)
    corner_x, corner_y = corners(view)
    # Targets `5 x n x 1` against walls `w`: the ray from the origin to each target in each wall's own axes.
    px = np.concatenate((view.x[None], corner_x))[:, :, None]
    py = np.concatenate((view.y[None], corner_y))[:, :, None]
    cos, sin = view.cos[walls], view.sin[walls]
    start_x, start_y = -view.separation[2, walls], -view.separation[3, walls]
    ray_x, ray_y = px * cos + py * sin, py * cos - px * sin
    ray_x[np.abs(ray_x) < NO_MOTION] = NO_MOTION
    ray_y[np.abs(ray_y) < NO_MOTION] = NO_MOTION
    middle_x, half_x = -start_x / ray_x, view.half_length[walls] / np.abs(ray_x)
    middle_y, half_y = -start_y / ray_y, view.half_width[walls] / np.abs(ray_y)
    enter = np.maximum(middle_x - half_x, middle_y - half_y)
    leave = np.minimum(middle_x + half_x, middle_y + half_y)
    blocked = (enter < leave) & (enter < 1.0) & (leave > 0.0)
    blocked[:, walls, np.arange(len(walls))] = False
    seen: Bools = ~blocked.any(axis=2).all(axis=0)
    return seen
