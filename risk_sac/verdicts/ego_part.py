"""States facts about the ego's part in a contact.

They are stated next to the verdict, and `risk_sac.verdicts.fault` judges by them.
"""

import math

import numpy as np

from risk_sac.records import GAINS_MPS, ConflictType, EgoPart
from risk_sac.scenario.limits import emergency_decel_mps2
from risk_sac.sim.ego import FLICKER_S
from risk_sac.types import Bools, Floats, Kind
from risk_sac.verdicts.along import Along
from risk_sac.verdicts.conflict import BODY_M, BRAKES_MPS2, YIELDING_MPS2, Conflict
from risk_sac.verdicts.course import CORRIDOR_M, HORIZON_S
from risk_sac.verdicts.drivers import R157_DELAY_S, R157_PERCEIVES_S
from risk_sac.verdicts.evidence import Evidence, inside
from risk_sac.verdicts.offences import STANDING_MPS
from risk_sac.verdicts.proper_response import left_first
from risk_sac.verdicts.recorded import column, ego_path, seen_along

RESPONDS_S = R157_PERCEIVES_S + R157_DELAY_S  # what the ego does earlier is no answer yet
NEAR_M = 1.5  # of the ego's corridor: a pedestrian on the carriageway that may step into it
SLOW_MPS = 3.0  # an ego that stands looks as far ahead as at this speed


def ego_part(evidence: Evidence, striker: int, conflict: Conflict, yields: str | None) -> EgoPart:
    """Computes the ego's reaction to the actor in column `striker` until the contact.

    The contact is in the last frame.

    `yields` names which had to yield to the other: ego | striker | None, as for `left_first`.
    """
    e = evidence
    speed, accel = column(e.speed_mps, 0), column(e.accel_mps2, 0)
    seen = seen_along(ego_path(e), e, striker)
    sighted, near = in_view_from(e, striker), _near(e, striker, seen)
    braked = np.flatnonzero(accel[conflict.frame :] <= -BRAKES_MPS2)
    sight_mps = None if sighted is None else _sight_speed(sighted, seen)
    return EgoPart(
        seen_s=0.0 if sighted is None else round(float(e.time_s[-1] - e.time_s[sighted]), 6),
        braked_after_s=round(float(braked[0]) * e.step_s, 6) if len(braked) else None,
        braking_mps2=max(-float(accel[conflict.frame :].min()), 0.0),
        possible_mps2=emergency_decel_mps2(e.ground.friction),
        gained_mps=_gained(speed, _aware_from(near, conflict.frame) + round(RESPONDS_S / e.step_s)),
        started=_started(e, striker, conflict, near),
        sight_mps=sight_mps,
        sighted_mps=None if sight_mps is None or sighted is None else float(speed[sighted]),
        left_first=left_first(e, striker, conflict.type, seen, yields),
    )


def in_view_from(evidence: Evidence, striker: int) -> int | None:
    """Finds the frame since which the striker was continuously in view.

    Breaks of up to 0.5 s are ignored. Returns None if it is out of view at the end.
    """
    frames = np.flatnonzero(evidence.known[:, striker])
    flicker = round(FLICKER_S / evidence.step_s)
    if len(frames) == 0 or len(evidence.time_s) - 1 - frames[-1] > flicker:
        return None
    breaks = np.flatnonzero(np.diff(frames) > flicker)
    return int(frames[breaks[-1] + 1] if len(breaks) else frames[0])


def _near(evidence: Evidence, striker: int, seen: Along[Floats]) -> Bools:
    """Whether the ego sees a pedestrian on the carriageway ahead, within 1.5 m of its corridor, `T`."""
    e, ground = evidence, evidence.ground
    if e.kind[striker] != Kind.PEDESTRIAN:
        return np.zeros(len(e.time_s), dtype=np.bool_)
    reach = (e.width_m[0] + e.width_m[striker]) / 2 + CORRIDOR_M + NEAR_M
    near: Bools = e.known[:, striker] & (np.abs(seen.across_m) <= reach)
    near &= (seen.behind_m <= 0.0) & (seen.gap_m <= HORIZON_S * np.maximum(e.speed_mps[:, 0], SLOW_MPS))
    if ground.roadway:
        near &= inside(
            ground.roadway + ground.crossings, e.x_m[:, striker], e.y_m[:, striker], float(e.width_m[striker]) / 2
        )
    return near


def _aware_from(near: Bools, conflict: int) -> int:
    """Finds since when the ego saw the striker in its way, or near it."""
    elsewhere = np.flatnonzero(~near[:conflict])
    return int(elsewhere[-1]) + 1 if len(elsewhere) else 0


def _gained(speed: Floats, responds: int) -> float:
    """Computes the largest gain of speed from a frame on."""
    after = speed[responds:]
    return float((after - np.minimum.accumulate(after)).max()) if len(after) else 0.0


def _started(evidence: Evidence, striker: int, conflict: Conflict, near: Bools) -> bool:
    """Tells whether the ego drove on although it saw the striker in its way.

    It did so if it stood or braked within the last 4 s and then sped up.

    That is in its way or beside it. A crossing vehicle is there once it is in the junction, whether it moves or stands.
    """
    e = evidence
    first = e.since(HORIZON_S)
    speed, braked = e.speed_mps[first:, 0], e.accel_mps2[first:, 0] <= -BRAKES_MPS2
    there = near[first:] | (np.arange(first, len(near)) >= conflict.frame)
    if conflict.type is ConflictType.CROSSING:
        there |= inside(e.ground.junctions, e.x_m[first:, striker], e.y_m[first:, striker], BODY_M)
    there &= e.known[first:, striker]
    rises = np.maximum.accumulate(speed[::-1])[::-1] - speed  # of its speed, until the contact
    stood = (speed < STANDING_MPS) & (rises >= STANDING_MPS)
    slowed = np.logical_or.accumulate(braked & there) & (rises >= GAINS_MPS)
    return bool((there & (stood | slowed)).any())


def _sight_speed(sighted: int, seen: Along[Floats]) -> float | None:
    """Computes the speed from which the ego could have stopped in time.

    It would have stopped before the place where the striker came into view.

    It would respond within R157's 0.75 s and brake with 3.4 m/s². None if the striker was in view all along, or was not
    ahead.
    """
    room = float(seen.gap_m[sighted])
    if sighted == 0 or room <= 0.0:
        return None
    lost = YIELDING_MPS2 * R157_DELAY_S
    return math.sqrt(lost * lost + 2 * YIELDING_MPS2 * room) - lost
