"""Lines that actors travel along: points with headings and, if timed, times."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from risk_sac.config.story_actions import ClothoidSpline, Polyline, Position, Trajectory, WorldPosition
from risk_sac.errors import ConfigError
from risk_sac.world.plane_curves import Begin, Clothoid
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
        """Returns the pose `left_m` of a station; the ends extend straight."""
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
        """Returns a point's station and distance left of the line.

        Both ends of the line go straight on.
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
        i = int(np.searchsorted(self.station_m, station_m, side="right")) - 1
        i = min(max(i, 0), len(self.station_m) - 2)
        lengths = np.diff(self.station_m)
        while i > 0 and lengths[i] <= SAME_M:
            i -= 1
        while lengths[i] <= SAME_M:
            i += 1
        return i


def _side(left: float, beyond: float) -> float:
    """Returns the signed distance of a point beside a corner."""
    return math.copysign(math.hypot(left, beyond), left)


def line_of(points: Floats, heading: Floats | None = None, times_s: Floats | None = None) -> TravelLine:
    """Returns the line through points, `n x 2`, of which two differ.

    Without headings it has those of travel.
    """
    keep = np.concatenate(([True], np.hypot(*np.diff(points, axis=0).T) > SAME_M))
    if heading is None:
        points, times_s = points[keep], None if times_s is None else times_s[keep]
        heading = directions(points)
    station_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))))
    return TravelLine(points, heading, station_m, times_s)


def directions(points: Floats) -> Floats:
    """Returns a smooth line's directions at its points, `n`, by their neighbours."""
    steps = np.diff(points, axis=0)
    units = steps / np.hypot(*steps.T)[:, None]
    around = np.concatenate((units[:1], units[:-1] + units[1:], units[-1:]))
    return np.unwrap(np.arctan2(around[:, 1], around[:, 0]))


def polyline(corners: Floats, facing: Sequence[float | None], times_s: Floats | None = None) -> TravelLine:
    """Returns a line of straight pieces through corners, `n x 2`.

    A body that faces `n` headings turns evenly between corners; else it faces the direction of travel.
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


SAGITTA_M = 0.001  # between a bent line and the straight pieces that stand for it
SHORTEST_M, LONGEST_M = 0.02, 1.0  # of these pieces
LONGEST_SEGMENT_M = 100_000.0
MOST_POINTS = 100_000  # of a segment
Resolve = Callable[[Position], Pose]
Number = Callable[[str | float, str], float]


def trajectory_line(trajectory: Trajectory, resolve: Resolve, number: Number, start: Pose | None) -> TravelLine:
    """Returns the line of a story's trajectory in the net's coordinates.

    `start` is where a clothoid begins that does not say it; an expression's path is for errors.

    Raises:
      ConfigError: it has no length, no begin, or times that go back.
    """
    if isinstance(trajectory, Polyline):
        return _polyline(trajectory, resolve, number)
    return _clothoids(trajectory, resolve, number, start)


def _polyline(trajectory: Polyline, resolve: Resolve, number: Number) -> TravelLine:
    """Returns straight pieces; a corner without heading faces the direction of travel."""
    vertices = (*trajectory.vertices, trajectory.vertices[0]) if trajectory.closed else trajectory.vertices
    poses = [resolve(vertex.position) for vertex in vertices]
    facing = [
        pose.heading_rad if _is_faced(vertex.position) else None for vertex, pose in zip(vertices, poses, strict=True)
    ]
    corners = np.array([pose[:2] for pose in poses])
    if float(np.hypot(*np.diff(corners, axis=0).T).max()) < 1e-6:
        raise ConfigError("vertices", "the same point all along", "two points at least")
    stated = [vertex.time_s for vertex in vertices]
    times = [None if time is None else number(time, f"vertices[{i}].time_s") for i, time in enumerate(stated)]
    if trajectory.closed:
        times[-1] = None
    return polyline(corners, facing, _times(times, corners, "vertices"))


def _is_faced(position: Position) -> bool:
    if isinstance(position, WorldPosition):
        return position.heading_rad is not None
    return position.heading == "absolute" or position.heading_rad != 0.0


def _times(times: Sequence[float | None], corners: Floats, field: str) -> Floats | None:
    """Returns corners' times, interpolated at even speed; None if none is stated."""
    known = [i for i, time in enumerate(times) if time is not None]
    if not known:
        return None
    stated = [time for time in times if time is not None]
    if known[0] != 0 or known[-1] != len(times) - 1:
        missing = 0 if known[0] != 0 else len(times) - 1
        raise ConfigError(f"{field}[{missing}].time_s", "no time", "one, since others have one")
    for i, (before, after) in enumerate(itertools.pairwise(stated)):
        if after < before:
            raise ConfigError(f"{field}[{known[i + 1]}].time_s", f"{after:g} s after {before:g} s", "times that go on")
    stations = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))
    return np.interp(stations, stations[known], stated) if len(known) < len(times) else np.array(stated)


def _clothoids(trajectory: ClothoidSpline, resolve: Resolve, number: Number, start: Pose | None) -> TravelLine:
    rows, times, at = list[Floats](), list[Floats](), start
    ends = [segment.time_s for segment in trajectory.segments[1:]] + [trajectory.end_time_s]
    for i, (segment, end) in enumerate(zip(trajectory.segments, ends, strict=True)):
        field = f"segments[{i}]"
        if segment.position is not None:
            at = resolve(segment.position)
        if at is None:
            raise ConfigError(f"{field}.position", "none", "where the trajectory begins")
        length_m = number(segment.length_m, f"{field}.length_m")
        if not 0.0 < length_m <= LONGEST_SEGMENT_M:
            raise ConfigError(f"{field}.length_m", f"{length_m:g}", f"above 0, at most {LONGEST_SEGMENT_M:g}")
        bend = number(segment.curvature_start, f"{field}.curvature_start")
        to_bend = number(segment.curvature_end, f"{field}.curvature_end")
        turned = number(segment.turned_rad, f"{field}.turned_rad")
        curve = Clothoid(Begin(at.x_m, at.y_m, at.heading_rad + turned), bend, to_bend, length_m)
        step = (
            min(math.sqrt(8 * SAGITTA_M / max(abs(bend), abs(to_bend), 1e-9)), LONGEST_M)
            if bend or to_bend
            else length_m
        )
        stations = np.linspace(0.0, length_m, math.ceil(length_m / max(step, 0.02)) + 1)
        rows.append(curve.at(stations)[:, :3])
        at = Pose(*rows[-1][-1].tolist())
        if segment.time_s is not None and end is not None:
            begin_s, end_s = number(segment.time_s, f"{field}.time_s"), number(end, f"segments[{i + 1}].time_s")
            if end_s < begin_s:
                raise ConfigError(f"segments[{i + 1}].time_s", f"{end_s:g} s after {begin_s:g} s", "times that go on")
            times.append(begin_s + stations / length_m * (end_s - begin_s))
    if times and len(times) < len(rows):
        raise ConfigError("segments", "times of some segments", "times of all, and of the end, or of none")
    line = np.concatenate(rows)
    return line_of(line[:, :2], line[:, 2], np.concatenate(times) if times else None)
