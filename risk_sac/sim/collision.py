"""Collision oracle: box test swept over the step, contact place and time.

Between two frames positions and headings are interpolated, so bodies that cross and part within a step are found, and
the step length does not matter. SUMO's list is only a cross-check.
"""

import math
from dataclasses import dataclass

import numpy as np

from risk_sac.world.geometry import (
    NO_MOTION,
    RelativeView,
    along_axes,
    contact_point,
    frame_view,
    relative_view,
    zone,
)
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, VX, VY, WIDTH, Floats, Frame, X, Y

TOUCHING_M = 1e-5  # bodies no farther apart along any separating axis touch


@dataclass(frozen=True, slots=True)
class Contact:
    """Two bodies when they first touch; geometry in the ego's frame."""

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
    closing_normal_mps: float  # along the normal of the contact, the axis of least penetration; positive if they close
    closing_normal_ego_mps: float  # the ego's own part of it


def find_contact(before: Frame | None, frame: Frame, view: RelativeView | None = None) -> Contact | None:
    """Finds the ego's first contact in the step from `before` to `frame`.

    Without a frame before, bodies that overlap touch at the frame's time; `view` is `relative_view(frame)`, if known.
    """
    if before is None:
        touching = np.flatnonzero((view or relative_view(frame)).overlap)
        if not len(touching):
            return None
        first = int(touching[0]) + 1
        return _describe(frame.state[:, [0, first]], first, frame.time_s)
    state = before.state
    if before.ids != frame.ids:  # actors have left
        state = np.ascontiguousarray(state[:, [before.ids.index(id_) for id_ in frame.ids]])
    share, other = _first_contact(state, frame.state)
    if not other:
        return None
    touch_s = frame.time_s - (1.0 - share) * (frame.time_s - before.time_s)
    return _describe(_between(state, frame.state, other, share), other, touch_s)


def contact_with(before: Floats, now: Floats, other: int, time_s: float, step_s: float) -> Contact:
    """Describes the contact with one actor in a step ending at `time_s`.

    Bodies that do not touch in it are described at its end.
    """
    share = min(_first_touch(before, now, other), 1.0)
    return _describe(_between(before, now, other, share), other, time_s - (1.0 - share) * step_s)


@compiled
def _first_contact(before: Floats, now: Floats) -> tuple[float, int]:
    """Finds the ego's first contact: the step's share, and column or 0."""
    share, found = math.inf, 0
    for other in range(1, now.shape[1]):
        dx, dy = now[X, other] - now[X, 0], now[Y, other] - now[Y, 0]
        way_x, way_y = dx - (before[X, other] - before[X, 0]), dy - (before[Y, other] - before[Y, 0])
        reach = (now[LENGTH, 0] + now[WIDTH, 0] + now[LENGTH, other] + now[WIDTH, other]) / 2
        if math.hypot(dx, dy) <= reach + math.hypot(way_x, way_y):
            touches = _first_touch(before, now, other)
            if touches < share:
                share, found = touches, other
    return share, found


@compiled
def _first_touch(before: Floats, now: Floats, other: int) -> float:
    """Computes the step's share, in [0, 1], until the ego touches `other`.

    It is inf if the ego does not.

    Conservative advancement: bodies that are clear along an axis do not touch before they could close in along it.
    Source: Mirtich 1996, "Impulse-based dynamic simulation of rigid body systems", sec. 2.3.
    """
    turning = 0.0  # the most that a body's extent grows along an axis in a whole step
    for actor in (0, other):
        turn = now[HEADING, actor] - before[HEADING, actor]
        turn -= math.tau * round(turn / math.tau)
        turning += abs(turn) * math.hypot(now[LENGTH, actor], now[WIDTH, actor]) / 2
    share = 0.0
    while share <= 1.0:
        pair = _between(before, now, other, share)
        for row, position in ((VX, X), (VY, Y)):  # metres per step
            pair[row, 0], pair[row, 1] = (
                now[position, 0] - before[position, 0],
                now[position, other] - before[position, other],
            )
        view = frame_view(pair)
        ways = along_axes(view.vx[0], view.vy[0], view.cos[0], view.sin[0])
        wait = 0.0
        for axis in range(4):
            clear = abs(view.separation[axis, 0]) - view.reach[axis, 0]
            if clear > TOUCHING_M:
                closing = -math.copysign(1.0, view.separation[axis, 0]) * ways[axis]
                wait = max(wait, clear / max(max(closing, 0.0) + turning, NO_MOTION))
        if wait == 0.0:
            return share
        share += wait
    return math.inf


@compiled
def _between(before: Floats, now: Floats, other: int, share: float) -> Floats:
    """Interpolates the state of the ego and `other` between two frames.

    `share` is the part of the way; the velocities are those of now.
    """
    pair = np.empty((WIDTH + 1, 2))
    for column, actor in enumerate((0, other)):
        turn = now[HEADING, actor] - before[HEADING, actor]
        turn -= math.tau * round(turn / math.tau)
        pair[:, column] = now[:, actor]
        pair[X, column] = before[X, actor] + share * (now[X, actor] - before[X, actor])
        pair[Y, column] = before[Y, actor] + share * (now[Y, actor] - before[Y, actor])
        pair[HEADING, column] = before[HEADING, actor] + share * turn
    return pair


def _describe(pair: Floats, other: int, time_s: float) -> Contact:
    """Describes the ego's contact with actor `other`, the second column of `pair`."""
    view = frame_view(pair)
    x, y = contact_point(view)
    cos, sin = float(view.cos[0]), float(view.sin[0])
    dx, dy = x - float(view.x[0]), y - float(view.y[0])
    other_lateral = view.ego_vy + float(view.vy[0])
    side = math.copysign(1.0, float(view.y[0]))
    normal = int((np.abs(view.separation[:, 0]) - view.reach[:, 0]).argmax())  # the axis of least penetration
    towards = math.copysign(1.0, float(view.separation[normal, 0]))
    return Contact(
        other=other,
        time_s=time_s,
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
        closing_normal_mps=-towards * along_axes(float(view.vx[0]), float(view.vy[0]), cos, sin)[normal],
        closing_normal_ego_mps=towards * along_axes(view.ego_vx, view.ego_vy, cos, sin)[normal],
    )
