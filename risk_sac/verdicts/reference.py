"""Reference drivers against a contact, and the grade that follows.

Source: UN Regulation 157, 5.2.5 and Annex 3; the drivers in `risk_sac.verdicts.drivers`.
"""

from collections.abc import Iterator, Mapping

import numpy as np

from risk_sac.geometry import Size, contact_point, frame_view, zone
from risk_sac.records import ConflictType, Grade, ReferenceOutcome
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.types import HEADING, LENGTH, WIDTH, Floats, X, Y
from risk_sac.verdicts.anticipation import driven, meets
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.drivers import R157_PERCEIVES_S
from risk_sac.verdicts.endangering import enters_safely
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.path import Path
from risk_sac.verdicts.recorded import ego_path, keeps_lane, lane_path, recorded_motion, recorded_size, seen_along
from risk_sac.verdicts.rollout import DEFENSIVE, FULL_BRAKING, FUZZY, HORIZON_S, R157, RSS, STANDING_MPS, Ending, drive

# The driver, and how long after the conflict began it perceives. Choice: fsm and rss look out from the beginning of the
# conflict on, not before, and perceive what they themselves hold to be dangerous: all drivers judge the same conflict.
DRIVERS = {
    "r157": (R157, R157_PERCEIVES_S),
    "fsm": (FUZZY, 0.0),
    "rss": (RSS, 0.0),
    "defensive": (DEFENSIVE, 0.0),
    "full_braking": (FULL_BRAKING, 0.0),
}
# What one of these avoids is preventable; full braking at once is a bound, and R157's rule for cut-ins knows no driver.
PREVENTING = frozenset({"r157", "fsm", "rss", "defensive"})
# Choice: a driver that was further along than the ego at the contact, and so is missed, avoids it by being faster and
# not by care. Such is one that brakes later than the ego did for a pedestrian that then runs into the ego's flank.
LEAD_M = 0.1
NEAR_M = 30.0  # further from the ego's place than that, an actor is not in the way of a reference driver
AVOIDED = ReferenceOutcome(avoids=True, impact_speed_mps=0.0)


def reference_outcomes(evidence: Evidence, striker: int, conflict: Conflict) -> Mapping[str, ReferenceOutcome]:
    """Computes each reference driver's outcome against the actor in column `striker`.

    A reference driver brakes and does not steer: it keeps the lane that the ego was in when the conflict began, or when
    the ego left it for the striker. Where the ego left its lane, others may be in the reference driver's way, so it has
    to avoid them too.
    `r157_ttc` speaks of cut-ins only and is left out of everything else.
    """
    recorded, kept = ego_path(evidence), None
    if conflict.came_over or not keeps_lane(evidence, conflict.frame):
        kept = lane_path(evidence, conflict.in_lane)
    outcomes = {}
    path = recorded if kept is None else kept
    others = (striker,) if kept is None else (striker, *_met(evidence, kept, striker))
    tracks = {other: _track(evidence, other) for other in others}
    for name, (driver, perceives_s) in DRIVERS.items():
        if driver == DEFENSIVE:
            latest = len(evidence.time_s) - 1 if kept is None else conflict.in_lane
            endings = _anticipating(evidence, path, tracks, conflict.frame, latest)
        else:
            endings = (
                _braking(evidence, path, track, driver, conflict.frame, perceives_s) for track in tracks.values()
            )
        each = (_outcome(evidence, *ending, kept=kept is not None) for ending in zip(tracks, endings, strict=True))
        outcomes[name] = next((outcome for outcome in each if not outcome.avoids), AVOIDED)
    if conflict.type is ConflictType.CUT_IN:
        outcomes["r157_ttc"] = _by_ttc(evidence, recorded, striker)
    return outcomes


def _met(evidence: Evidence, path: Path, striker: int) -> list[int]:
    """Lists other known actors near the ego's place on an untaken path."""
    e = evidence
    apart_m = np.hypot(e.x_m - path.x[:, None], e.y_m - path.y[:, None])
    near = np.where(e.known & np.isfinite(apart_m), apart_m, np.inf).min(axis=0) <= NEAR_M
    near &= np.isfinite(e.x_m[-1])
    return [int(i) for i in np.flatnonzero(near) if i not in (0, striker)]


def grade(keeps: Mapping[str, bool]) -> Grade:
    """Grades a violation, with or without contact, by which reference drivers would have prevented it."""
    if any(keeps.get(name, False) for name in PREVENTING):
        return Grade.PREVENTABLE
    return Grade.FULL_BRAKING if keeps["full_braking"] else Grade.UNAVOIDABLE


def _braking(
    evidence: Evidence, path: Path, track: Body[Floats], driver: int, began: int, perceives_s: float
) -> Ending | None:
    """Drives against one actor with a driver that brakes; None if the ego is struck before it perceives."""
    e = evidence
    first = began + round(perceives_s / e.step_s)
    if first >= len(e.time_s) - 1:
        return None
    speed, size, grip = float(e.speed_mps[first, 0]), recorded_size(e, 0), e.ground.friction * GRAVITY_MPS2
    return drive(driver, path, size, track, first, speed, grip, HORIZON_S - perceives_s, e.step_s, np.empty(0))


def _anticipating(
    evidence: Evidence, path: Path, tracks: Mapping[int, Body[Floats]], began: int, latest: int
) -> Iterator[Ending | None]:
    """Drives the defensive driver; None where it does as the ego did."""
    s, acts = driven(evidence, path, next(iter(tracks)), began, latest)
    for track in tracks.values():
        if acts == len(evidence.time_s) - 1:
            yield None
        else:
            yield meets(path, recorded_size(evidence, 0), track, s, acts, evidence.step_s)


def _track(evidence: Evidence, other: int) -> Body[Floats]:
    motion = recorded_motion(evidence, other)
    return motion._replace(heading=np.unwrap(motion.heading))


def _outcome(evidence: Evidence, other: int, ending: Ending | None, *, kept: bool) -> ReferenceOutcome:
    """Converts an ending into an outcome; None takes the ego's own.

    `kept`: the driver is on a path that the ego did not take.
    """
    if ending is None:
        return AVOIDED if kept else ReferenceOutcome(avoids=False, impact_speed_mps=float(evidence.speed_mps[-1, 0]))
    size, other_size = recorded_size(evidence, 0), recorded_size(evidence, other)
    blameless = not ending.touched or ending.speed_mps <= STANDING_MPS or _from_behind(ending, size, other_size)
    if blameless and (kept or ending.lead_m <= LEAD_M):
        return AVOIDED
    return ReferenceOutcome(avoids=False, impact_speed_mps=float(ending.passing_mps if blameless else ending.speed_mps))


def _from_behind(ending: Ending, size: Size, other_size: Size) -> bool:
    """Whether the contact lies on the ego's rear."""
    state = np.zeros((WIDTH + 1, 2))
    state[[X, Y, HEADING]] = np.transpose((ending.pose, ending.other))
    state[[LENGTH, WIDTH]] = 2 * np.transpose((size, other_size))
    return zone(*contact_point(frame_view(state)), *size) == "rear"


def _by_ttc(evidence: Evidence, path: Path, striker: int) -> ReferenceOutcome:
    """UN R157, 5.2.5.2: a cut-in that leaves room enough is preventable.

    Its impact speed is the recorded ego's: the rule knows no driver.
    """
    if enters_safely(evidence, striker, seen_along(path, evidence, striker)):
        return AVOIDED
    return ReferenceOutcome(avoids=False, impact_speed_mps=float(evidence.speed_mps[-1, 0]))
