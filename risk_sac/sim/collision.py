"""The collision oracle: our own box test, and the contact's place and time.

A contact between two frames is located by bisection on the interpolated poses, so the step length does not
matter. SUMO's list is only a cross-check.
"""

import math
from dataclasses import dataclass

import numpy as np

from risk_sac.geometry import RelativeView, contact_point, frame_view, zone
from risk_sac.jit import compiled
from risk_sac.types import HEADING, WIDTH, Floats, Frame, X, Y

BISECTIONS = 10  # of 0.1 s: locates the contact to 0.1 ms


@dataclass(frozen=True, slots=True)
class Contact:
    """Two bodies at the instant they first touch; geometry in the ego's frame."""

    other: int  # index in the frame, >= 1
    time_s: float
    x_m: float
    y_m: float
    ego_zone: str
    other_zone: str
    lateral_offset_m: float
    heading_sin: float  # of the other's heading relative to the ego's
    closing_lateral_ego_mps: float  # the ego's own speed across its axis towards the other
    closing_lateral_other_mps: float
    relative_speed_mps: float


def find_contact(before: Frame | None, frame: Frame, view: RelativeView) -> Contact | None:
    """The ego's first contact in the step from `before` to `frame`, or None; `view` is `relative_view(frame)`."""
    if not view.overlap.any():
        return None
    touching = np.flatnonzero(view.overlap)
    if before is None or before.ids != frame.ids:
        return _describe(frame, int(touching[0]) + 1, frame, 1.0)
    share, other = min((_first_touch(before.state, frame.state, int(i) + 1), int(i) + 1) for i in touching)
    return _describe(before, other, frame, share)


@compiled
def _first_touch(before: Floats, now: Floats, other: int) -> float:
    """Share of the step, in (0, 1], after which the ego first touches `other`."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if frame_view(_between(before, now, other, middle)).overlap[0]:
            high = middle
        else:
            low = middle
    return high


@compiled
def _between(before: Floats, now: Floats, other: int, share: float) -> Floats:
    """State of the ego and `other` alone, `share` of the way between two frames; the velocities are those of now."""
    pair = np.empty((WIDTH + 1, 2))
    for column, actor in enumerate((0, other)):
        turn = now[HEADING, actor] - before[HEADING, actor]
        turn -= math.tau * round(turn / math.tau)
        pair[:, column] = now[:, actor]
        pair[X, column] = before[X, actor] + share * (now[X, actor] - before[X, actor])
        pair[Y, column] = before[Y, actor] + share * (now[Y, actor] - before[Y, actor])
        pair[HEADING, column] = before[HEADING, actor] + share * turn
    return pair


def _describe(before: Frame, other: int, frame: Frame, share: float) -> Contact:
    view = frame_view(_between(before.state, frame.state, other, share))
    x, y = contact_point(view)
    cos, sin = float(view.cos[0]), float(view.sin[0])
    dx, dy = x - float(view.x[0]), y - float(view.y[0])
    other_lateral = view.ego_vy + float(view.vy[0])
    side = math.copysign(1.0, float(view.y[0]))
    return Contact(
        other=other,
        time_s=frame.time_s - (1.0 - share) * (frame.time_s - before.time_s),
        x_m=x,
        y_m=y,
        ego_zone=zone(x, y, view.ego_half_length, view.ego_half_width),
        other_zone=zone(
            dx * cos + dy * sin, dy * cos - dx * sin, float(view.half_length[0]), float(view.half_width[0])
        ),
        lateral_offset_m=float(view.y[0]),
        heading_sin=sin,
        closing_lateral_ego_mps=side * view.ego_vy,
        closing_lateral_other_mps=-side * other_lateral,
        relative_speed_mps=float(math.hypot(view.vx[0], view.vy[0])),
    )
