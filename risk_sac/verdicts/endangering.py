"""Offences of a striker that endangered the ego: unsafe lane change, brake check, turn into the ego's way.

Background traffic is not asked for brake checks: SUMO's drivers brake for a reason, which is not always on record.
"""

import math

import numpy as np
from numpy.typing import NDArray

from risk_sac.records import ConflictType
from risk_sac.types import Bools, Floats, Kind, Role
from risk_sac.verdicts.along import WANDER_M, Along
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.course import HORIZON_S, at, time_to_touch, with_margin
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.offences import RECENT_S, STANDING_MPS, took_crossing
from risk_sac.verdicts.recorded import ego_path, recorded_motion, recorded_size, seen_along

INTRUSION_M = 0.3  # into the ego's lane, from which a cut-in counts
R157_BRAKES_MPS2, R157_DELAY_S = 6.0, 0.35
R157_GAP_M = 2.0  # 5.2.3.3: the least distance to a vehicle ahead at any speed
CHECKS_MPS2, CHECKS_STEPS = 4.0, 5  # 0.5 s: longer than it takes to come over in front of the ego
CLEAR_M = 30.0  # a vehicle without any other this near ahead, from its front, brakes for none
STEPS_ASIDE_M = 1.0  # a pedestrian this far beside a vehicle's way may be about to step into it
STOPPING_LETTERS = tuple(b"ruygos")  # signals at which a vehicle may have to stop
TURN_RAD = math.radians(30.0)
WALKING_MPS = 0.3  # below it the direction of a pedestrian is noise


def endangered_ego(evidence: Evidence, striker: int, conflict: Conflict) -> tuple[str, ...]:
    """Lists how the striker endangered the ego: unsafe_lane_change, brake_check, turned_into_path."""
    if conflict.type is ConflictType.PEDESTRIAN:  # one that the ego has to let cross may turn
        turned = not took_crossing(evidence, striker) and turns_into_path(evidence, striker)
        return ("turned_into_path",) if turned else ()
    if conflict.type not in (ConflictType.CUT_IN, ConflictType.LEADER):
        return ()
    seen = seen_along(ego_path(evidence), evidence, striker)
    rules = {
        "unsafe_lane_change": conflict.type is ConflictType.CUT_IN and changes_lane_unsafely(evidence, striker, seen),
        "brake_check": evidence.role[striker] == Role.ADVERSARY
        and checks_brakes(evidence, striker, seen, conflict.frame),
    }
    return tuple(name for name, did in rules.items() if did)


def changes_lane_unsafely(evidence: Evidence, striker: int, seen: Along[Floats]) -> bool:
    """Tells whether a vehicle entered the ego's lane without enough room.

    Beside the ego there is none; ahead of it UN R157 says how much.
    """
    if np.ptp(seen.across_m[evidence.since(RECENT_S) :]) <= WANDER_M:  # it kept its place
        return False
    return not enters_safely(evidence, striker, seen, R157_GAP_M)


def enters_safely(evidence: Evidence, striker: int, seen: Along[Floats], least_gap_m: float = 0.0) -> bool:
    """Whether a cut-in leaves the ego room to brake, by UN R157, 5.2.5.2.

    When it intrudes by 0.3 m into the ego's lane, it is that far ahead and TTC > v_rel / (2 · 6 m/s²) + 0.35 s.
    """
    t = _intrusion(evidence, striker, seen)
    closing = evidence.speed_mps[t, 0] - seen.speed_mps[t]
    needed_s = max(closing, 0.0) / (2 * R157_BRAKES_MPS2) + R157_DELAY_S
    return bool(seen.gap_m[t] > least_gap_m and seen.ttc_s[t] > needed_s)


def checks_brakes(evidence: Evidence, striker: int, seen: Along[Floats], began: int) -> bool:
    """Tells whether a vehicle before the ego braked hard without a reason.

    Hard is over 4 m/s² for 0.5 s, in the last 3 s or from frame `began` of the conflict on. A reason is a road user
    within 30 m ahead of it, or a signal at which it may have to stop.
    """
    e = evidence
    first = min(began, e.since(RECENT_S))
    behind = (seen.gap_m > 0.0) & (seen.gap_m <= HORIZON_S * e.speed_mps[:, 0])
    behind &= np.abs(seen.across_m) <= e.ground.lane_width_m / 2
    braked = behind & (e.accel_mps2[:, striker] < -CHECKS_MPS2) & ~np.isin(e.link[:, striker], STOPPING_LETTERS)
    frames = first + np.flatnonzero(braked[first:])
    return bool(np.count_nonzero(~_any_ahead(e, striker, frames)) >= CHECKS_STEPS)


def turns_into_path(evidence: Evidence, striker: int) -> bool:
    """Tells whether a pedestrian turned into the way of an ego in sight.

    It turned by 30° or more within the last 4 s. What the ego sees can see the ego.
    """
    e = evidence
    first = e.since(HORIZON_S)
    vx, vy = e.vx_mps[first:, striker], e.vy_mps[first:, striker]
    if math.hypot(vx[-1], vy[-1]) < WALKING_MPS:
        return False
    turned = np.abs(np.angle((vx + 1j * vy) / (vx[-1] + 1j * vy[-1]))) >= TURN_RAD
    before = np.flatnonzero(turned & (np.hypot(vx, vy) >= WALKING_MPS) & e.known[first:, striker])
    if len(before) == 0 or e.speed_mps[first + before[-1], 0] < STANDING_MPS:
        return False
    path, size, motion = ego_path(e), with_margin(recorded_size(e, 0)), recorded_motion(e, striker)
    t = first + int(before[-1])
    return time_to_touch(path, float(path.s[t]), float(e.speed_mps[t, 0]), size, at(motion, t), HORIZON_S) > HORIZON_S


def _intrusion(evidence: Evidence, striker: int, seen: Along[Floats]) -> int:
    """Finds when the striker last came 0.3 m into the ego's lane.

    Returns the frame of the contact if it did not.
    """
    e = evidence
    reach = (
        np.abs(np.sin(seen.turn_rad)) * e.length_m[striker] + np.abs(np.cos(seen.turn_rad)) * e.width_m[striker]
    ) / 2
    intrudes = np.abs(seen.across_m) - reach <= e.ground.lane_width_m / 2 - INTRUSION_M
    outside = np.flatnonzero(~intrudes)
    return min(int(outside[-1]) + 1, len(intrudes) - 1) if len(outside) else 0


def _any_ahead(evidence: Evidence, vehicle: int, frames: NDArray[np.int64]) -> Bools:
    """Tells whether a road user is, or soon will be, before a vehicle.

    It is within 30 m ahead and in the vehicle's way.
    """
    e = evidence
    others = np.delete(np.arange(len(e.ids)), vehicle)
    dx, dy = (each[np.ix_(frames, others)] - each[frames, vehicle, None] for each in (e.x_m, e.y_m))
    cos, sin = (of(e.heading_rad[frames, vehicle, None]) for of in (np.cos, np.sin))
    ahead = dx * cos + dy * sin - (e.length_m[others] + e.length_m[vehicle]) / 2
    aside = np.abs(dy * cos - dx * sin) - (e.width_m[others] + e.width_m[vehicle]) / 2
    aside -= np.where(e.kind[others] == Kind.PEDESTRIAN, STEPS_ASIDE_M, 0.0)
    found: Bools = ((ahead > 0.0) & (ahead <= CLEAR_M) & (aside <= 0.0)).any(axis=1)
    return found
