"""Measures actors' behaviour after the release by the features of `risk_sac.risk.driving`."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.risk.conduct import CALM_MPS, CRAWLS_MPS, MOVING_MPS, NEAR_LINE_M
from risk_sac.scenario.bodies import body_of
from risk_sac.scenario.layout import Area
from risk_sac.verdicts.course import BodyOnPath
from risk_sac.verdicts.evidence import Evidence, ego_path, inside, lanes_of, seen_along
from risk_sac.world.types import Bools, Floats, Kind, Role

SMOOTH = 5  # frames, 0.5 s: a pedal that is held
JERK_STEPS = 3  # between the accelerations that are compared
PRESSED_MPS2 = 1.5  # from which a pedal counts as pressed; SUMO's drivers dawdle with less
TOUCHED_MPS2, CHANGES_S = 0.5, 5.0  # changes between gas and brake above this count, in so many seconds
OVER_M = 0.3  # from which a body over the line is a lane change, as R157 takes a cut-in
CHANGE_S = 1.0  # within which the fastest lateral motion is taken
MOVES_MPS, STANDS_MPS, DRIVES_MPS = 0.5, 0.3, 5.0
SAME_SPEED_MPS = 1.0
SAME_WAY_COS = 0.866  # 30 degrees
TOWARDS_COS = 0.707  # 45 degrees
NEAR_M, CLEAR_M, MEETS_M = 30.0, 30.0, 2.0
BESIDE = (0.4, 1.1)  # of a lane's width: where the next vehicle of the lane beside is when a line is crossed
RED, YIELDS, MAJOR = b"ru", b"g", b"G"
LONGEST_S = 10.0  # a time beyond which none is unlikely


class Observed(NamedTuple):
    """One feature of what an actor did."""

    actor: int  # column
    feature: str  # of `FEATURES`
    value: float
    time_s: float  # from the release


def observed_of(evidence: Evidence) -> list[Observed]:
    """Lists the features of all adversaries that moved after the release."""
    observed: list[Observed] = []
    path = None
    released = int(np.searchsorted(evidence.time_s, -1e-6))
    for actor in np.flatnonzero(evidence.role == Role.ADVERSARY).tolist():
        frames = released + np.flatnonzero(~np.isnan(evidence.x_m[released:, actor]))
        if len(frames) <= SMOOTH or not (evidence.speed_mps[frames, actor] > MOVES_MPS).any():
            continue
        if evidence.kind[actor] == Kind.PEDESTRIAN:
            path = ego_path(evidence) if path is None else path
            observed += _walker(evidence, actor, frames, seen_along(path, evidence, actor))
        else:
            observed += _vehicle(evidence, actor, frames)
    return observed


def _vehicle(e: Evidence, actor: int, frames: NDArray[np.intp]) -> Iterator[Observed]:
    speed, accel = e.speed_mps[frames, actor], e.accel_mps2[frames, actor]
    held, time_s = smoothed(accel), e.time_s[frames]
    for name, sign in (("braking", -1.0), ("acceleration", 1.0)):
        for first, last in runs(sign * held > PRESSED_MPS2):
            at = first + int((sign * held[first:last]).argmax())
            yield Observed(actor, name, float(sign * held[at]), float(time_s[at]))
    jerk = np.abs(held[JERK_STEPS:] - held[:-JERK_STEPS]) / (JERK_STEPS * e.step_s)
    if len(jerk):
        yield Observed(actor, "jerk", float(jerk.max()), float(time_s[jerk.argmax() + JERK_STEPS]))
    changes, changed_s = pedal_changes(held, time_s)
    yield Observed(actor, "pedal_changes", changes, changed_s)
    lanes = lanes_of(e, actor)
    over_mps = speed - lanes.limit_mps[frames]
    fastest = int(over_mps.argmax())
    yield Observed(actor, "speeding", float(over_mps[fastest]), float(time_s[fastest]))
    ahead_m, left_m, cos = _around(e, actor, frames)
    within = _in_areas(e, e.ground.junctions, actor, frames)
    yield from _lines(e, actor, frames, lanes.width_m[frames], within, (ahead_m, left_m, cos))
    level_s, from_s = _pacing(e, actor, frames, ahead_m, left_m, cos)
    if level_s > 0.0:
        yield Observed(actor, "pacing", level_s, from_s)
    yield from _junctions(e, actor, frames, within, (ahead_m, left_m))


def _around(e: Evidence, actor: int, frames: NDArray[np.intp]) -> tuple[Floats, Floats, Floats]:
    """Computes m ahead of and left of an actor, and headings' cosine.

    Each is `F x n`.
    """
    heading = e.heading_rad[frames, actor][:, None]
    dx, dy = e.x_m[frames] - e.x_m[frames, actor][:, None], e.y_m[frames] - e.y_m[frames, actor][:, None]
    cos, sin = np.cos(heading), np.sin(heading)
    return dx * cos + dy * sin, dy * cos - dx * sin, np.cos(e.heading_rad[frames] - heading)


def _lines(
    e: Evidence,
    actor: int,
    frames: NDArray[np.intp],
    lane_m: Floats,
    within: Bools,
    others: tuple[Floats, Floats, Floats],
) -> Iterator[Observed]:
    """Measures lane changes and time near or over a line, outside junctions."""
    ahead_m, left_m, cos = others
    offset = e.lane_offset_m[frames, actor]
    over = np.abs(offset) + e.width_m[actor] / 2 - lane_m / 2
    over[within | np.isnan(over)] = -np.inf
    jumps = np.concatenate(([False], np.abs(offset[1:] - offset[:-1]) > lane_m[1:] / 2))  # into the next lane
    lateral = np.abs(e.lateral_mps[frames, actor])
    keeps = (over > -NEAR_LINE_M) & (lateral < CALM_MPS) & (e.speed_mps[frames, actor] > MOVING_MPS)
    yield Observed(actor, "over_line", float(keeps.sum()) * e.step_s, float(e.time_s[frames[keeps.argmax()]]))
    window = round(CHANGE_S / e.step_s)
    for first, last in runs(over > 0.0):
        crosses = first + np.flatnonzero(jumps[first:last])
        enters = first + np.flatnonzero(over[first:last] > OVER_M)
        if first == 0 or not len(enters) or not (len(crosses) or last == len(frames)):
            continue  # it came so from the release, or went back
        at, during = int(enters[0]), slice(max(first - window, 0), last + window)
        time_s = float(e.time_s[frames[at]])
        moving = smoothed(lateral[during], window)
        fastest = float(moving.max()) if len(moving) else float(lateral[during].mean())
        yield Observed(actor, "lateral_speed", float(lateral[during].max()), time_s)
        yield Observed(actor, "lane_change_duration", float(lane_m[at]) / max(fastest, 0.1), time_s)
        side = float(np.sign(offset[at]))
        yield from _new_follower(e, actor, frames, at, side * left_m[at], ahead_m[at], cos[at])


def _new_follower(
    e: Evidence, actor: int, frames: NDArray[np.intp], at: int, beside_m: Floats, ahead_m: Floats, cos: Floats
) -> Iterator[Observed]:
    """Measures the room that a lane change leaves the next follower."""
    half_m = (e.length_m + e.length_m[actor]) / 2
    low, high = (share * e.ground.lane_width_m for share in BESIDE)
    there = (beside_m > low) & (beside_m < high) & (cos > SAME_WAY_COS) & (e.kind == Kind.VEHICLE)
    there &= (ahead_m < half_m) & (ahead_m > -CLEAR_M)
    there[actor] = False
    if not there.any():
        return
    gap_m = np.where(there, np.maximum(-ahead_m - half_m, 0.0), np.inf)
    follower, frame = int(gap_m.argmin()), frames[at]
    gap, time_s, speed = float(gap_m[follower]), float(e.time_s[frame]), float(e.speed_mps[frame, follower])
    closing = speed - float(e.speed_mps[frame, actor])
    if speed > DRIVES_MPS:
        yield Observed(actor, "lane_change_gap", gap, time_s)
    if speed > MOVES_MPS:
        yield Observed(actor, "lane_change_headway", gap / speed, time_s)
    if closing > SAME_SPEED_MPS:
        yield Observed(actor, "lane_change_ttc", min(gap / closing, LONGEST_S), time_s)


def _pacing(
    e: Evidence, actor: int, frames: NDArray[np.intp], ahead_m: Floats, left_m: Floats, cos: Floats
) -> tuple[float, float]:
    """Finds the longest pacing of a vehicle (level, same speed), and start."""
    speed = e.speed_mps[frames]
    level = np.abs(ahead_m) < (e.length_m + e.length_m[actor]) / 2
    level &= (np.abs(left_m) < 1.5 * e.ground.lane_width_m) & (cos > SAME_WAY_COS)
    level &= (np.abs(speed - speed[:, actor, None]) < SAME_SPEED_MPS) & (speed > 2.0)
    level[:, actor], level[:, e.kind == Kind.PEDESTRIAN] = False, False
    paced = np.flatnonzero(level.any(axis=0)).tolist()
    longest = max(((last - first, first) for k in paced for first, last in runs(level[:, k])), default=(0, 0))
    return longest[0] * e.step_s, float(e.time_s[frames[longest[1]]])


def _junctions(
    e: Evidence, actor: int, frames: NDArray[np.intp], within: Bools, others: tuple[Floats, Floats]
) -> Iterator[Observed]:
    """Measures entries on red or without priority, and stops within a junction."""
    ahead_m, left_m = others
    link, speed = e.link[frames, actor], e.speed_mps[frames, actor]
    enters = (link[:-1] != 0) & ((link[1:] == 0) | (within[1:] & ~within[:-1])) & (speed[1:] > MOVES_MPS)
    for t in np.flatnonzero(enters).tolist():
        frame = int(frames[t])
        if int(link[t]) in RED:
            before = np.flatnonzero(~np.isin(e.link[:frame, actor], list(RED)))
            began = int(before[-1]) + 1 if len(before) else 0
            yield Observed(actor, "red_entry", float(e.time_s[frame] - e.time_s[began]), float(e.time_s[frame]))
        elif int(link[t]) in YIELDS:
            gap_s = _arrives_after(e, actor, frame)
            if gap_s is not None:
                yield Observed(actor, "junction_gap", gap_s, float(e.time_s[frame]))
    if not within.any():
        return
    in_way = (ahead_m > 0.0) & (ahead_m < CLEAR_M) & (np.abs(left_m) < e.ground.lane_width_m)
    in_way[:, actor] = False
    free, stands = within & ~in_way.any(axis=1), speed < STANDS_MPS
    stops_s = max((last - first for first, last in runs(free & stands)), default=0) * e.step_s
    crawls_s = float((free & ~stands & (speed < CRAWLS_MPS)).sum()) * e.step_s
    entered_s = float(e.time_s[frames[within.argmax()]])
    yield Observed(actor, "junction_stop", stops_s, entered_s)
    yield Observed(actor, "junction_crawl", crawls_s, entered_s)


def _arrives_after(e: Evidence, actor: int, frame: int) -> float | None:
    """Finds when a vehicle with priority reaches the actor's way.

    In s since `frame`; None if none does.
    """
    x, y = e.x_m[frame:, actor], e.y_m[frame:, actor]
    soonest = None
    for other in np.flatnonzero(e.kind == Kind.VEHICLE).tolist():
        if (
            other == actor
            or int(np.nan_to_num(e.link[frame, other])) not in MAJOR
            or e.speed_mps[frame, other] < MOVES_MPS
        ):
            continue
        ox, oy = e.x_m[frame:, other], e.y_m[frame:, other]
        arrives = np.flatnonzero((np.hypot(ox[:, None] - x, oy[:, None] - y) < MEETS_M).any(axis=1))
        if len(arrives) and arrives[0] > 0:
            gap_s = float(arrives[0]) * e.step_s
            soonest = gap_s if soonest is None else min(soonest, gap_s)
    return soonest


def _walker(e: Evidence, actor: int, frames: NDArray[np.intp], seen: BodyOnPath[Floats]) -> Iterator[Observed]:
    speed, time_s = e.speed_mps[frames, actor], e.time_s[frames]
    held, gait = smoothed(speed), body_of(int(e.body[actor])).gait
    fastest = int(held.argmax())
    yield Observed(actor, f"{gait}_speed", float(held[fastest]), float(time_s[fastest]))
    gains = smoothed(e.accel_mps2[frames, actor])
    for first, last in runs(gains > MOVES_MPS):
        at = first + int(gains[first:last].argmax())
        yield Observed(actor, f"{gait}_acceleration", float(gains[at]), float(time_s[at]))
    turning = smoothed(np.abs(np.diff(np.unwrap(e.heading_rad[frames, actor]))) / e.step_s)
    turning[smoothed(speed[1:]) < MOVES_MPS] = 0.0
    sharpest = int(turning.argmax())
    yield Observed(actor, "turn_rate", float(turning[sharpest]), float(time_s[sharpest]))
    x, y = e.x_m[frames, actor], e.y_m[frames, actor]
    on_crossing = inside(e.ground.crossings, x, y, MOVES_MPS)
    on_road = inside(e.ground.roadway, x, y) | on_crossing if e.ground.roadway else np.ones(len(x), dtype=np.bool_)
    yield from _steps_out(e, actor, frames, on_road, on_crossing, seen)
    to_x, to_y = e.x_m[frames, 0] - x, e.y_m[frames, 0] - y
    away = np.maximum(np.hypot(to_x, to_y), 1e-6)
    heads = (e.vx_mps[frames, actor] * to_x + e.vy_mps[frames, actor] * to_y) / away
    towards = on_road & (speed > MOVES_MPS) & (heads > TOWARDS_COS * speed) & (away < NEAR_M)
    towards &= e.speed_mps[frames, 0] > MOVES_MPS
    in_way = on_road & (speed < STANDS_MPS) & (np.abs(seen.across_m[frames]) < e.width_m[0] / 2 + MOVES_MPS)
    in_way &= (seen.gap_m[frames] > 0.0) & (away < NEAR_M)
    for name, does in (("towards_car", towards), ("stop_in_way", in_way)):
        first, last = max(runs(does), key=lambda run: run[1] - run[0], default=(0, 0))
        if last > first:
            yield Observed(actor, name, (last - first) * e.step_s, float(time_s[first]))


def _steps_out(
    e: Evidence, actor: int, frames: NDArray[np.intp], on_road: Bools, on_crossing: Bools, seen: BodyOnPath[Floats]
) -> Iterator[Observed]:
    """Measures a pedestrian's step onto the road without priority.

    That is on red, or into a gap.
    """
    for t in (np.flatnonzero(on_road[1:] & ~on_road[:-1]) + 1).tolist():
        frame, link = int(frames[t]), int(e.link[frames[t], actor])
        time_s = float(e.time_s[frame])
        on_red = bool(on_crossing[t]) and link in RED
        if on_red:
            before = np.flatnonzero(~np.isin(e.link[:frame, actor], list(RED)))
            began = int(before[-1]) + 1 if len(before) else 0
            yield Observed(actor, "walks_on_red", time_s - float(e.time_s[began]), time_s)
        if on_red or not on_crossing[t]:
            gap_m, speed = float(seen.gap_m[frame]), float(e.speed_mps[frame, 0])
            if gap_m > 0.0 and speed > MOVES_MPS:
                yield Observed(actor, "crossing_gap", min(gap_m / speed, LONGEST_S), time_s)


def pedal_changes(held: Floats, time_s: Floats) -> tuple[float, float]:
    """Counts changes between gas and brake in the 5 s with most.

    Returns the time of the last as well.
    """
    touched = np.flatnonzero(np.abs(held) > TOUCHED_MPS2)
    changed = touched[1:][np.diff(np.sign(held[touched])) != 0]
    if not len(changed):
        return 0.0, float(time_s[0])
    at_s = time_s[changed]
    counts = np.arange(1, len(at_s) + 1) - np.searchsorted(at_s, at_s - CHANGES_S)
    most = int(counts.argmax())
    return float(counts[most]), float(at_s[most])


def smoothed(values: Floats, frames: int = SMOOTH) -> Floats:
    """Computes the moving mean over `frames` frames; empty if there are fewer."""
    if len(values) < frames:
        return np.empty(0)
    total = np.cumsum(np.concatenate(([0.0], values)))
    mean: Floats = (total[frames:] - total[:-frames]) / frames
    return mean


def runs(does: Bools) -> list[tuple[int, int]]:
    """Lists stretches of a condition: first frame, and frame after the last."""
    flags, found, last = does.tobytes(), [], 0  # ten times as fast as np.diff on arrays of an episode's length
    while (first := flags.find(1, last)) >= 0:
        last = flags.find(0, first)
        last = len(flags) if last < 0 else last
        found.append((first, last))
    return found


def _in_areas(e: Evidence, areas: Sequence[Area], actor: int, frames: NDArray[np.intp]) -> Bools:
    heading, reach = e.heading_rad[frames, actor], e.length_m[actor] / 2
    front = e.x_m[frames, actor] + reach * np.cos(heading), e.y_m[frames, actor] + reach * np.sin(heading)
    return inside(areas, *front)
