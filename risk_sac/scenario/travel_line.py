"""Lines that actors travel along: points with headings and, where they are timed, times."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from risk_sac.world.types import Floats

SAME_M = 1e-9
NEAR_RAD = 0.05  # a heading that differs less from a piece is that of the curve that the piece stands for


class Pose(NamedTuple):
    """Point and heading, m, m, rad."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, eq=False)
class TravelLine:
    """Line of straight pieces, along which an actor travels.

    A corner is two points at one place, with the headings before and after it.
    """

    points: Floats  # `n x 2`, m; n >= 2
    heading: Floats  # `n`, rad, of the actor's body
    station_m: Floats  # `n`, length of the line up to each point
    times_s: Floats | None = None  # `n`, when the points are passed

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return float(self.station_m[-1])

    def pose(self, station_m: float, left_m: float = 0.0) -> Pose:
        """Returns the pose at a station; before its begin and beyond its end the line goes straight on.

        Args:
          station_m: along the line.
          left_m: of the line, at right angles to its direction of travel.
        """
        i = self._piece(station_m)
        (x0, y0), (x1, y1) = self.points[i], self.points[i + 1]
        length = self.station_m[i + 1] - self.station_m[i]
        share = (station_m - self.station_m[i]) / length
        cos, sin = (x1 - x0) / length, (y1 - y0) / length
        turned = math.remainder(self.heading[i + 1] - self.heading[i], math.tau)
        heading = self.heading[i] + min(max(share, 0.0), 1.0) * turned
        x, y = x0 + share * (x1 - x0) - sin * left_m, y0 + share * (y1 - y0) + cos * left_m
        return Pose(float(x), float(y), float(heading))

    def project(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Returns the station of a point and how far left of the line it is.

        Its begin and its end go straight on, so that a station may be negative or more than the length.
        """
        begins, steps = self.points[:-1], np.diff(self.points, axis=0)
        lengths = np.diff(self.station_m)
        safe = np.maximum(lengths, SAME_M)
        dx, dy = x_m - begins[:, 0], y_m - begins[:, 1]
        along = (dx * steps[:, 0] + dy * steps[:, 1]) / safe
        left = (dy * steps[:, 0] - dx * steps[:, 1]) / safe
        low, high = np.zeros(len(along)), lengths.copy()
        real = np.flatnonzero(lengths > SAME_M)
        low[real[0]], high[real[-1]] = -np.inf, np.inf
        beyond = along - np.clip(along, low, high)
        i = int(real[np.argmin(np.hypot(beyond, left)[real])])
        on = min(max(float(along[i]), float(low[i])), float(high[i]))
        return float(self.station_m[i]) + on, float(left[i]) if beyond[i] == 0.0 else _side(left[i], beyond[i])

    def direction_rad(self, station_m: float) -> float:
        """Returns the direction of travel at a station, whatever the body's heading."""
        i = self._piece(station_m)
        dx, dy = self.points[i + 1] - self.points[i]
        along = math.atan2(dy, dx)
        heading = self.pose(station_m).heading_rad
        return heading if abs(math.remainder(heading - along, math.tau)) < NEAR_RAD else along

    def cut(self, from_m: float, to_m: float) -> "TravelLine":
        """Returns the part of an untimed line between two stations."""
        inner = (self.station_m > from_m + SAME_M) & (self.station_m < to_m - SAME_M)
        ends = [self.pose(from_m), self.pose(to_m)]
        points = np.concatenate(([ends[0][:2]], self.points[inner], [ends[1][:2]]))
        return line_of(points, np.array([ends[0].heading_rad, *self.heading[inner], ends[1].heading_rad]))

    def time_s(self, station_m: float) -> float:
        """Returns when a station of a timed line is passed."""
        if self.times_s is None:
            raise ValueError("a line without times")
        return float(np.interp(station_m, self.station_m, self.times_s))

    def station_at(self, time_s: float) -> float:
        """Returns the station at a time of a timed line."""
        if self.times_s is None:
            raise ValueError("a line without times")
        return float(np.interp(time_s, self.times_s, self.station_m))

    def _piece(self, station_m: float) -> int:
        """Returns the piece of a station, which has a length."""
        i = int(np.searchsorted(self.station_m, station_m, side="right")) - 1
        i = min(max(i, 0), len(self.station_m) - 2)
        lengths = np.diff(self.station_m)
        while i > 0 and lengths[i] <= SAME_M:
            i -= 1
        while lengths[i] <= SAME_M:
            i += 1
        return i


def _side(left: float, beyond: float) -> float:
    """Distance of a point that is beside a corner, with the sign of its side."""
    return math.copysign(math.hypot(left, beyond), left)


def line_of(points: Floats, heading: Floats | None = None, times_s: Floats | None = None) -> TravelLine:
    """Returns the line through points.

    Args:
      points: `n x 2`; two at least that differ.
      heading: `n`; without it the direction of travel.
      times_s: `n`.
    """
    keep = np.concatenate(([True], np.hypot(*np.diff(points, axis=0).T) > SAME_M))
    if heading is None:
        points, times_s = points[keep], None if times_s is None else times_s[keep]
        heading = directions(points)
    station_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    return TravelLine(points, heading, station_m, times_s)


def directions(points: Floats) -> Floats:
    """Returns the direction of a smooth line at its points, from the points beside them, `n`."""
    steps = np.diff(points, axis=0)
    units = steps / np.hypot(*steps.T)[:, None]
    around = np.concatenate((units[:1], units[:-1] + units[1:], units[-1:]))
    return np.unwrap(np.arctan2(around[:, 1], around[:, 0]))


def polyline(corners: Floats, facing: Sequence[float | None], times_s: Floats | None = None) -> TravelLine:
    """Returns a line of straight pieces.

    Args:
      corners: `n x 2`.
      facing: `n` headings of the body, which turns evenly between corners; None: the direction of travel.
      times_s: `n`.
    """
    points, heading, times = list[Floats](), list[float](), list[float]()
    for i in range(len(corners) - 1):
        dx, dy = corners[i + 1] - corners[i]
        along = math.atan2(dy, dx) if math.hypot(dx, dy) > SAME_M else (heading[-1] if heading else None)
        for k in (i, i + 1):
            stated = facing[k]
            points.append(corners[k])
            heading.append(stated if stated is not None else along if along is not None else 0.0)
            if times_s is not None:
                times.append(float(times_s[k]))
    return line_of(np.array(points), np.array(heading), np.array(times) if times_s is not None else None)
