"""Lines of a story's trajectories: polylines and clothoids.

Source: ASAM OpenSCENARIO XML 1.3, class reference: Polyline, Clothoid, ClothoidSpline.
"""

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np

from risk_sac.config.story_places import ClothoidSpline, Polyline, Position, Trajectory, WorldPosition
from risk_sac.errors import ConfigError
from risk_sac.scenario.travel_line import Pose, TravelLine, line_of, polyline
from risk_sac.world.plane_curves import Begin, Clothoid
from risk_sac.world.types import Floats

SAGITTA_M = 0.001  # between a bent line and the straight pieces that stand for it
SHORTEST_M, LONGEST_M = 0.02, 1.0  # of these pieces
LONGEST_SEGMENT_M = 100_000.0
MOST_POINTS = 100_000  # of a segment
Resolve = Callable[[Position], Pose]
Number = Callable[[str | float, str], float]


def trajectory_line(trajectory: Trajectory, resolve: Resolve, number: Number, start: Pose | None) -> TravelLine:
    """Returns the line of a trajectory in the net's coordinates.

    Args:
      trajectory: of the story.
      resolve: returns the pose of a position.
      number: returns the value of an expression; its path is for errors.
      start: where a clothoid begins that does not say it.

    Raises:
      ConfigError: it has no length, no begin, or times that go back.
    """
    if isinstance(trajectory, Polyline):
        return _polyline(trajectory, resolve, number)
    return _clothoids(trajectory, resolve, number, start)


def _polyline(trajectory: Polyline, resolve: Resolve, number: Number) -> TravelLine:
    """Returns straight pieces; a corner without a heading of its own faces the direction of travel."""
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
    """Whether a position states a heading of its own."""
    if isinstance(position, WorldPosition):
        return position.heading_rad is not None
    return position.heading == "absolute" or position.heading_rad != 0.0


def _times(times: Sequence[float | None], corners: Floats, field: str) -> Floats | None:
    """Returns when corners are passed, those without a time at an even speed; None if none has one."""
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
