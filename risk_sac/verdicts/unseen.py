"""Finds places that hide pedestrians: crossings on the path, behind other bodies."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from risk_sac.scenario.bodies import body_of
from risk_sac.scenario.layout import Area
from risk_sac.verdicts.course import CORRIDOR_M, MovingBox, Path, pose_at
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, WIDTH, Bools, Floats, X, Y

WAITING_M = 2.0  # of sidewalk at either end of a crossing, on which pedestrians wait
SPOT_M = 1.0  # between two places on a crossing that are looked at
LOOK_M = 0.5  # between two places on the path that may be on a crossing
CORNER = 0.99  # just inside the corner: a body does not hide itself
ALONG_COS = math.cos(math.radians(45.0))


class Crossings(NamedTuple):
    """Pedestrian crossings on a path."""

    entries: Floats  # k x 2: metres along the path at which it enters and leaves each
    spots: Floats  # m x 4: x, y, the crossing, and metres beside the corridor


def boxes_of(crossings: Sequence[Area]) -> Floats:
    """Computes the rectangles about crossings, `k x 6`.

    A row is: centre, direction of the longest side, half the size along it and across it.
    """
    found = np.empty((len(crossings), 6))
    for row, area in zip(found, crossings, strict=True):
        corners = np.array(_corners(area))
        sides = np.roll(corners, -1, axis=0) - corners
        direction = sides[np.hypot(*sides.T).argmax()]
        direction /= np.hypot(*direction)
        along, across = corners @ direction, corners @ (-direction[1], direction[0])
        middle, aside = (along.max() + along.min()) / 2, (across.max() + across.min()) / 2
        x, y = middle * direction[0] - aside * direction[1], middle * direction[1] + aside * direction[0]
        row[:] = x, y, *direction, (along.max() - along.min()) / 2, (across.max() - across.min()) / 2
    return found


def _corners(area: Area) -> list[tuple[float, float]]:
    """Computes the corners of an area."""
    found = []
    for (ax, ay, a), (bx, by, b) in zip(area.sides, (*area.sides[1:], area.sides[0]), strict=True):
        cross = ax * by - ay * bx
        if abs(cross) > 1e-9:
            found.append(((a * by - b * ay) / cross, (ax * b - bx * a) / cross))
    return found


@compiled
def crossings_on(path: Path, from_m: float, to_m: float, boxes: Floats, half_width_m: float) -> Crossings:
    """Finds the crossings on a path between two stations, and spots along each with its waiting areas."""
    entries, count = np.empty((len(boxes), 2)), 0
    spots, filled = np.empty((64 * len(boxes), 4)), 0
    for k in range(len(boxes)):
        x, y, ux, uy, half_u, half_v = boxes[k]
        enters, leaves, at = math.nan, math.nan, from_m
        while at <= to_m:
            px, py, _ = pose_at(path, at)
            dx, dy = px - x, py - y
            if abs(dx * ux + dy * uy) <= half_u and abs(dy * ux - dx * uy) <= half_v:
                if math.isnan(enters):
                    enters = at
                leaves = at
            elif not math.isnan(enters):
                break
            at += max(LOOK_M, math.hypot(dx, dy) - half_u - half_v)
        if math.isnan(enters):
            continue
        mx, my, heading = pose_at(path, (enters + leaves) / 2)
        cos, sin = math.cos(heading), math.sin(heading)
        wx, wy, half = ux, uy, half_u
        if abs(cos * ux + sin * uy) > ALONG_COS:  # the path leads along its longest side
            wx, wy, half = -uy, ux, half_v
        half += WAITING_M
        entries[count] = enters, leaves
        steps = min(math.ceil(2.0 * half / SPOT_M), 63)
        for j in range(steps + 1):
            along = -half + 2.0 * half * j / steps
            sx, sy = x + along * wx, y + along * wy
            aside = abs((sy - my) * cos - (sx - mx) * sin) - half_width_m - CORRIDOR_M
            spots[filled] = sx, sy, float(count), max(aside, 0.0)
            filled += 1
        count += 1
    return Crossings(entries[:count], spots[:filled])


def concealing(codes: Iterable[int]) -> Bools:
    """Tells which bodies hide what is behind them, by their codes in frames and recordings."""
    return np.array([body_of(int(code)).conceals for code in codes], dtype=np.bool_)


@compiled
def walls_of(state: Floats, hides: Bools) -> Floats:
    """Lists the bodies that hide what is behind them, `w x 6`.

    A row is: centre, cosine and sine of the heading, half the size.
    """
    found, count = np.empty((len(hides), 6)), 0
    for i in range(len(hides)):
        if hides[i] and not math.isnan(state[X, i]):  # it has left
            heading = state[HEADING, i]
            found[count, 0], found[count, 1] = state[X, i], state[Y, i]
            found[count, 2], found[count, 3] = math.cos(heading), math.sin(heading)
            found[count, 4], found[count, 5] = state[LENGTH, i] / 2, state[WIDTH, i] / 2
            count += 1
    return found[:count]


@compiled
def is_in_view(walls: Floats, eye_x: float, eye_y: float, body: MovingBox[float]) -> bool:
    """Whether a corner or the centre of a body can be seen, as `risk_sac.world.geometry.line_of_sight` asks it."""
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    for along, across in ((0.0, 0.0), (1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)):
        a, b = along * CORNER * body.size.half_length, across * CORNER * body.size.half_width
        if not is_hidden(walls, eye_x, eye_y, body.x + a * cos - b * sin, body.y + a * sin + b * cos):
            return True
    return False


@compiled
def is_hidden(walls: Floats, eye_x: float, eye_y: float, x: float, y: float) -> bool:
    """Tells whether a body lies between the eye and a place.

    A body that stands on the place hides nothing there.
    """
    for k in range(len(walls)):
        cos, sin, half_length, half_width = walls[k, 2], walls[k, 3], walls[k, 4], walls[k, 5]
        ex, ey = eye_x - walls[k, 0], eye_y - walls[k, 1]
        px, py = x - walls[k, 0], y - walls[k, 1]
        to_x, to_y = px * cos + py * sin, py * cos - px * sin
        if abs(to_x) <= half_length and abs(to_y) <= half_width:
            continue
        from_x, from_y = ex * cos + ey * sin, ey * cos - ex * sin
        enter, leave = 0.0, 1.0
        for start, end, half in ((from_x, to_x, half_length), (from_y, to_y, half_width)):
            step = end - start
            if abs(step) < 1e-9:
                if abs(start) > half:
                    enter = 2.0
                continue
            first, last = (-half - start) / step, (half - start) / step
            enter, leave = max(enter, min(first, last)), min(leave, max(first, last))
        if enter < leave:
            return True
    return False
