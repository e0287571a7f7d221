"""Finds when, where and how the conflict with the striker began.

Sources: UN Regulation 157, Annex 3, for cut-ins and leaders; for pedestrians and crossing vehicles R157's driver
after Engström et al., "Modeling road user response timing in naturalistic traffic conflicts" (arXiv 2208.08651).
"""

import math
from dataclasses import dataclass

import numpy as np

from risk_sac.records import ConflictType
from risk_sac.verdicts.course import (
    HORIZON_S,
    MARKING_S,
    WANDER_M,
    YIELDING_MPS2,
    BodyOnPath,
    MovingBox,
    Path,
    at,
    entry_distance,
    lane_conflicts,
    time_to_meet,
    time_to_touch,
    with_margin,
)
from risk_sac.verdicts.evidence import (
    Evidence,
    column,
    ego_path,
    front_moved_across,
    inside,
    lane_path,
    lanes_of,
    recorded_motion,
    recorded_size,
    seen_along,
    soon_inside,
)
from risk_sac.world.geometry import Size
from risk_sac.world.jit import compiled
from risk_sac.world.types import Bools, Floats, Kind

BODY_M = 0.5  # from a pedestrian's centre: what a body on the kerb reaches of the carriageway
KERB_S = 1.0  # a pedestrian this near to the carriageway is about to step onto it
FIRM_MPS2 = 6.0  # what a driver that brakes already can go up to, without an emergency
SAME_WAY_COS = math.cos(math.radians(30.0))
TURNING_COS = math.cos(math.radians(60.0))
TURN_WINDOW_S = 3.0
OVER_S = 1.0
SETTLED_S = 2.0  # a vehicle that has been in the ego's lane for so long is its leader, and no longer cuts in
BRIDGE = 2  # frames, 0.2 s: a conflict interrupted for no longer has not ended
UNRESPONSIVE_S = 1.5
BRAKES_MPS2 = 1.5  # Krauss's drivers dawdle with up to σ · accel = 1.3 m/s², and mean nothing by it


@dataclass(frozen=True, slots=True, kw_only=True)
class Conflict:
    """Origin of the conflict that ended in the contact."""

    type: ConflictType
    frame: int  # when it began for a driver that sees what the ego sees
    time_s: float  # t0, from the release
    noticed_s: float  # the same for a wary driver: it trusts nothing beside it and nothing that brakes; never later
    x_m: float  # where the striker was then
    y_m: float
    position: str  # ahead | alongside
    hidden: bool  # the ego knew nothing of the striker when the bodies' motion made it a conflict
    course_from: int  # first frame of the visible collision course that lasted until the contact
    in_lane: int  # the last frame in which the ego was in its lane: that of its beginning, unless it came over before

    @property
    def came_over(self) -> bool:
        """Whether the ego came over to the striker from its lane."""
        return self.in_lane < self.frame


def find_conflict(evidence: Evidence, striker: int) -> Conflict:
    """Returns the conflict with the striker up to the last frame's contact.

    A conflict begins no earlier than the ego knows of the striker; with a pedestrian that steps out from behind a
    truck, when it comes into sight. With a striker that was never in sight it begins with the contact. Where the ego
    came over to the striker, it begins no earlier than the ego left its place in its lane.
    """
    path = ego_path(evidence)
    known = evidence.known[:, striker]
    seen = seen_along(path, evidence, striker)
    corridor, motion = with_margin(recorded_size(evidence, 0)), recorded_motion(evidence, striker)
    speed = column(evidence.speed_mps, 0)
    course = collision_courses(path, speed, corridor, motion, to_meet=False)
    same_way = _drives_the_same_way(evidence, striker, seen.turn_rad)
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        meets = collision_courses(path, speed, corridor, motion, to_meet=True)
        begins = lasts = begins_if_wary = lasts_if_wary = meets & _at_the_carriageway(evidence, striker)
    elif same_way:
        begins, lasts = _lane_conflicts(evidence, striker, seen, wary=False)
        begins_if_wary, lasts_if_wary = _lane_conflicts(evidence, striker, seen, wary=True)
    else:
        to_go_m = _way_to_corridor(path, evidence, striker)
        begins = lasts = course | _cannot_stop(to_go_m, evidence, striker, wary=False)
        begins_if_wary = lasts_if_wary = course | _cannot_stop(to_go_m, evidence, striker, wary=True)
    frame, unseen = lasting_since(begins & known, lasts & known), lasting_since(begins, lasts)
    noticed = lasting_since(begins_if_wary & known, lasts_if_wary & known)
    unseen_if_wary = lasting_since(begins_if_wary, lasts_if_wary)
    course_from = lasting_since(course & known, course & known)
    if same_way and unseen_if_wary == len(course) - 1:  # neither led nor cut in
        frame, unseen = course_from, lasting_since(course, course)
    left = None if same_way and came_further(evidence, striker, seen) else left_its_lane(evidence, striker)
    if left is not None:
        frame, noticed, unseen = (max(left, each) for each in (frame, noticed, unseen))
    return Conflict(
        type=_type(evidence, striker, frame, same_way, seen, came_over=left is not None),
        frame=frame,
        time_s=float(evidence.time_s[frame]),
        noticed_s=float(evidence.time_s[min(noticed, frame)]),
        x_m=float(evidence.x_m[frame, striker]),
        y_m=float(evidence.y_m[frame, striker]),
        position="ahead" if seen.gap_m[frame] > 0.0 else "alongside",
        hidden=not known[unseen],
        course_from=course_from,
        in_lane=frame if left is None else left - 1,
    )


def _lane_conflicts(evidence: Evidence, striker: int, seen: BodyOnPath[Floats], *, wary: bool) -> tuple[Bools, Bools]:
    e = evidence
    offset, accel = column(e.lane_offset_m, striker), column(e.accel_mps2, striker)
    return lane_conflicts(seen, column(e.speed_mps, 0), offset, accel, lanes_of(e, 0).width_m, wary)


def left_its_place(evidence: Evidence) -> int | None:
    """Finds when the ego's front left its place by over 0.375 m.

    Returns None if it is back in its place in the last frame.

    Its place is the one that it had across its lane 3 s before the last frame.
    """
    moved = front_moved_across(evidence)
    in_place = np.abs(moved - moved[evidence.since(TURN_WINDOW_S)]) <= WANDER_M
    return None if in_place[-1] else int(np.flatnonzero(in_place)[-1]) + 1


def left_its_lane(evidence: Evidence, striker: int) -> int | None:
    """Finds when the ego left its lane towards the striker.

    Returns None if it did not.

    Choice: it came over if it would not have touched the striker up to 1 s after the contact, had it kept its place.
    """
    left = left_its_place(evidence)
    if left is None:
        return None
    path, striking = lane_path(evidence, left - 1), recorded_motion(evidence, striker)
    size, last = recorded_size(evidence, 0), len(path.s) - 1
    for t in range(left, last):
        if time_to_touch(path, float(path.s[t]), float(evidence.speed_mps[t, 0]), size, at(striking, t), 0.0) == 0.0:
            return None
    speed = float(evidence.speed_mps[last, 0])
    touches = time_to_touch(path, float(path.s[last]), speed, size, at(striking, last), OVER_S) <= OVER_S
    return None if touches else left


def came_further(evidence: Evidence, striker: int, seen: BodyOnPath[Floats]) -> bool:
    """Whether the striker moved further across than the ego in 3 s.

    Each one's movement counts towards the other.
    """
    e, first = evidence, evidence.since(TURN_WINDOW_S)
    side = math.copysign(1.0, seen.across_m[-1])
    own = front_moved_across(e)
    other = float(e.lateral_mps[first + 1 :, striker].sum()) * e.step_s
    return -side * other > side * float(own[-1] - own[first])


def unresponsive(evidence: Evidence, conflict: Conflict) -> bool:
    """Tells whether the ego never braked on a visible collision course.

    The course lasted for 1.5 s or more, until the contact.
    """
    first = conflict.course_from
    lasted = evidence.time_s[-1] - evidence.time_s[first] >= UNRESPONSIVE_S - 1e-6
    return bool(lasted and (evidence.accel_mps2[first:, 0] > -BRAKES_MPS2).all())


@compiled
def lasting_since(begins: Bools, lasts: Bools) -> int:
    """Finds the first frame from which a condition lasts to the end."""
    first, missing = len(begins) - 1, 0
    for t in range(len(begins) - 2, -1, -1):
        if begins[t]:
            first, missing = t, 0
        elif lasts[t]:
            missing = 0
        else:
            missing += 1
            if missing > BRIDGE:
                break
    return first


@compiled
def collision_courses(path: Path, speed: Floats, size: Size, motion: MovingBox[Floats], to_meet: bool) -> Bools:
    """Tells whether each frame is on a collision course, `T`.

    With `to_meet` it is one if the ways meet, see `time_to_meet`; else if the bodies would touch within 4 s. It looks
    backwards; False before the course was first interrupted.
    """
    on_course = np.zeros(len(speed), dtype=np.bool_)
    missing = 0
    for t in range(len(speed) - 1, -1, -1):
        if to_meet:
            on_course[t] = time_to_meet(path, path.s[t], speed[t], size, at(motion, t)) < math.inf
        else:
            on_course[t] = time_to_touch(path, path.s[t], speed[t], size, at(motion, t), HORIZON_S) <= HORIZON_S
        missing = 0 if on_course[t] else missing + 1
        if missing > BRIDGE + 1:  # the last frame may be beyond the contact
            break
    return on_course


def _at_the_carriageway(evidence: Evidence, striker: int) -> Bools:
    """Tells whether the pedestrian is on the carriageway or 1 s away.

    It holds in all frames for a pedestrian that was struck beside the carriageway: there the ego left the carriageway.
    """
    e, ground = evidence, evidence.ground
    x, y, areas = e.x_m[:, striker], e.y_m[:, striker], ground.roadway + ground.crossings
    if not ground.roadway or not inside(areas, x[-1:], y[-1:], BODY_M)[0]:
        return np.ones(len(e.time_s), dtype=np.bool_)
    return soon_inside(areas, x, y, e.vx_mps[:, striker], e.vy_mps[:, striker], KERB_S)


def _drives_the_same_way(evidence: Evidence, striker: int, turn_rad: Floats) -> bool:
    """Tells whether the striker drives in the ego's direction.

    In the last 3 s its direction stays within 60 degrees of the ego's path, and is once within 30.

    One that the ego follows round a bend does; one that turns into the ego's way comes from across.
    """
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        return False
    cos = np.cos(turn_rad[evidence.since(TURN_WINDOW_S) :])
    return bool(cos.max() > SAME_WAY_COS and cos.min() > TURNING_COS)


def _way_to_corridor(path: Path, evidence: Evidence, striker: int) -> Floats:
    """Computes the striker's remaining way to the ego's corridor, `T`, m.

    It is inf earlier than 4 s before the contact.

    Both paths are on record, so where they meet is known, and that both come there too.
    """
    first, motion = evidence.since(HORIZON_S), recorded_motion(evidence, striker)
    x, y, heading = motion.x[first:], motion.y[first:], motion.heading[first:]
    corridor = with_margin(recorded_size(evidence, 0))
    distance, _ = entry_distance(path, first, path.s[-1], corridor, x, y, heading, motion.size)
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    return np.concatenate((np.full(first, np.inf), distance - gone))


def _cannot_stop(to_go_m: Floats, evidence: Evidence, striker: int, *, wary: bool) -> Bools:
    """Tells when the striker cannot stop before the ego's corridor, `T`.

    Choice: a striker that brakes already is taken to yield as long as firm braking suffices, but by a wary driver.
    """
    yielding = (evidence.accel_mps2[:, striker] <= -BRAKES_MPS2) & (not wary)
    braking_mps2 = np.where(yielding, FIRM_MPS2, YIELDING_MPS2)
    found: Bools = to_go_m <= evidence.speed_mps[:, striker] ** 2 / (2 * braking_mps2)
    return found


def _type(
    evidence: Evidence, striker: int, frame: int, same_way: bool, seen: BodyOnPath[Floats], *, came_over: bool
) -> ConflictType:
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        return ConflictType.PEDESTRIAN
    if not same_way:
        return ConflictType.CROSSING
    first = int(np.searchsorted(evidence.time_s, evidence.time_s[frame] - SETTLED_S - 1e-6))
    width_m = lanes_of(evidence, 0, first).width_m[: frame + 1 - first]
    settled = (np.abs(seen.across_m[first : frame + 1]) <= width_m / 2).all()
    if settled:
        return ConflictType.LEADER
    if came_over:
        return ConflictType.MERGE
    ahead = seen.gap_m[frame] > 0.0
    return ConflictType.LEADER if ahead and _keeps_lane(evidence, striker, frame) else ConflictType.CUT_IN


def _keeps_lane(evidence: Evidence, striker: int, frame: int) -> bool:
    """Tells whether the striker stayed within 0.375 m of its lane's centre.

    It did so in the last 3 s, and from 1 s before the conflict began in `frame`. False without recorded offsets.
    """
    first = min(evidence.since(TURN_WINDOW_S), max(frame - round(MARKING_S / evidence.step_s), 0))
    return bool((np.abs(evidence.lane_offset_m[first:, striker]) <= WANDER_M).all())
