"""Reference drivers against a contact, and the grade that follows.

Source: UN Regulation 157, 5.2.5 and Annex 3; the drivers in `risk_sac.verdicts.drivers`.
"""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from risk_sac.config import Requirement
from risk_sac.records import ConflictType, Grade, ReferenceOutcome
from risk_sac.risk.measures import Gauge, Measures
from risk_sac.risk.publish import AHEAD, COS
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.verdicts.conflict import Conflict, left_its_place
from risk_sac.verdicts.course import MovingBox, Path, pose_at
from risk_sac.verdicts.drivers import R157_PERCEIVES_S
from risk_sac.verdicts.evidence import (
    Evidence,
    ego_path,
    keeps_lane,
    lane_path,
    lanes_of,
    recorded_motion,
    recorded_size,
    seen_along,
)
from risk_sac.verdicts.offences import EASES_MPS2, enters_safely
from risk_sac.verdicts.rollout import (
    DEFENSIVE,
    FULL_BRAKING,
    FUZZY,
    HORIZON_S,
    R157,
    RSS,
    STANDING_MPS,
    RolloutEnd,
    drive,
    driven,
    meets,
    stopping_distance,
)
from risk_sac.world.geometry import Pose, Size, contact_point, frame_view, zone
from risk_sac.world.types import (
    ACCEL,
    HEADING,
    LATERAL,
    LENGTH,
    SPEED,
    STEP_S,
    VX,
    VY,
    WIDTH,
    Bools,
    Floats,
    Frame,
    Signal,
    X,
    Y,
)

# The driver, and how long after the conflict began it perceives. Choice: fsm and rss look out from the beginning of the
# conflict on, not before, and perceive what they themselves hold to be dangerous: all drivers judge the same conflict.
DRIVERS = {
    "r157": (R157, R157_PERCEIVES_S),
    "fsm": (FUZZY, 0.0),
    "rss": (RSS, 0.0),
    "defensive": (DEFENSIVE, 0.0),
    "full_braking": (FULL_BRAKING, 0.0),
}
# What one of these avoids is preventable, unless the spec's `judge.drivers` names fewer. Full braking at once is a
# bound, and R157's rule for cut-ins knows no driver.
PREVENTING = ("r157", "fsm", "rss", "defensive")
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


def grade(keeps: Mapping[str, bool], drivers: Collection[str] = PREVENTING) -> Grade:
    """Grades a violation by which of the reference `drivers` keep the requirement."""
    if any(keeps.get(name, False) for name in drivers):
        return Grade.PREVENTABLE
    return Grade.FULL_BRAKING if keeps["full_braking"] else Grade.UNAVOIDABLE


def _braking(
    evidence: Evidence, path: Path, track: MovingBox[Floats], driver: int, began: int, perceives_s: float
) -> RolloutEnd | None:
    """Brakes against one actor; None if struck before the driver perceives."""
    e = evidence
    first = began + round(perceives_s / e.step_s)
    if first >= len(e.time_s) - 1:
        return None
    speed, size, grip = float(e.speed_mps[first, 0]), recorded_size(e, 0), e.ground.friction * GRAVITY_MPS2
    return drive(driver, path, size, track, first, speed, grip, HORIZON_S - perceives_s, e.step_s, np.empty(0))


def _anticipating(
    evidence: Evidence, path: Path, tracks: Mapping[int, MovingBox[Floats]], began: int, latest: int
) -> Iterator[RolloutEnd | None]:
    """Drives the defensive driver; None where it does as the ego did."""
    s, acts = driven(evidence, path, next(iter(tracks)), began, latest)
    for track in tracks.values():
        if acts == len(evidence.time_s) - 1:
            yield None
        else:
            yield meets(path, recorded_size(evidence, 0), track, s, acts, evidence.step_s)


def _track(evidence: Evidence, other: int) -> MovingBox[Floats]:
    motion = recorded_motion(evidence, other)
    return motion._replace(heading=np.unwrap(motion.heading))


def _outcome(evidence: Evidence, other: int, ending: RolloutEnd | None, *, kept: bool) -> ReferenceOutcome:
    """Converts an ending into an outcome; None takes the ego's own.

    `kept`: on a path that the ego did not take.
    """
    if ending is None:
        return AVOIDED if kept else ReferenceOutcome(avoids=False, impact_speed_mps=float(evidence.speed_mps[-1, 0]))
    size, other_size = recorded_size(evidence, 0), recorded_size(evidence, other)
    blameless = (
        not ending.touched
        or ending.speed_mps <= STANDING_MPS
        or from_behind(ending.pose, ending.other, size, other_size)
    )
    if blameless and (kept or ending.lead_m <= LEAD_M):
        return AVOIDED
    return ReferenceOutcome(avoids=False, impact_speed_mps=float(ending.passing_mps if blameless else ending.speed_mps))


def from_behind(pose: Pose, other: Pose, size: Size, other_size: Size) -> bool:
    """Whether the ego's contact with another body lies at its rear."""
    state = np.zeros((WIDTH + 1, 2))
    state[[X, Y, HEADING]] = np.transpose((pose, other))
    state[[LENGTH, WIDTH]] = 2 * np.transpose((size, other_size))
    return zone(*contact_point(frame_view(state)), *size) == "rear"


def _by_ttc(evidence: Evidence, path: Path, striker: int) -> ReferenceOutcome:
    """UN R157, 5.2.5.2: a cut-in that leaves room enough is preventable.

    Its impact speed is the recorded ego's: the rule knows no driver.
    """
    if enters_safely(evidence, striker, seen_along(path, evidence, striker)):
        return AVOIDED
    return ReferenceOutcome(avoids=False, impact_speed_mps=float(evidence.speed_mps[-1, 0]))


NO_RED_LIGHT_ENTRY, ON_CARRIAGEWAY = "no_red_light_entry", "on_carriageway"
AFTER_CONTACT_STEPS = 40


class History(NamedTuple):
    """Frames, measures and evidence of an episode; `T` frames."""

    frames: Sequence[Frame]
    measures: Sequence[Measures]
    evidence: Evidence


class MetActor(NamedTuple):
    """The actor that mattered most at a violation, and the ego's conflict."""

    column: int  # in the evidence
    conflict: Conflict


def kept_by(
    requirement: Requirement, gauge: Gauge, history: History, index: int, met: MetActor | None
) -> Mapping[str, bool]:
    """Reference driver → whether it keeps the requirement violated in frame `index`.

    `gauge` measures that requirement only.
    """
    if requirement.name == ON_CARRIAGEWAY:
        return dict.fromkeys(DRIVERS, True)
    if requirement.name == NO_RED_LIGHT_ENTRY:
        return {name: _stops_at_red(driver, history, index) for name, (driver, _) in DRIVERS.items()}
    return {name: _keeps(name, gauge, history, index, met) for name in DRIVERS}


def _stops_at_red(driver: int, history: History, index: int) -> bool:
    """Whether a driver could stop at a yellow or red signal's line."""
    first = index
    while first > 0 and history.frames[first - 1].signal in (Signal.YELLOW, Signal.RED):
        if history.frames[first].ego_speed_mps < STANDING_MPS:
            break
        if first < index and history.frames[first - 1].stop_line_m < history.frames[first].stop_line_m - 1.0:
            break  # of the signal before
        first -= 1
    frame = history.frames[first]
    grip = history.evidence.ground.friction * GRAVITY_MPS2
    return stopping_distance(driver, frame.ego_speed_mps, grip) <= frame.stop_line_m


def _keeps(name: str, gauge: Gauge, history: History, index: int, met: MetActor | None) -> bool:
    """Whether the requirement holds on what a driver drives, measured again."""
    e = history.evidence
    left = left_its_place(e.until(index))
    in_lane = left - 1 if left is not None else index if met is None else met.conflict.frame
    stays = left is None and keeps_lane(e, in_lane)
    path = ego_path(e) if stays else lane_path(e, in_lane)
    if name == "defensive":
        s, acts = _keeps_by_anticipating(e, path, met, index)
    else:
        touched = history.measures[-1].assessment.touched
        s, acts = _keeps_by_braking(name, e, path, met, after_steps=AFTER_CONTACT_STEPS * touched)
    limit_mps = lanes_of(e, 0).limit_mps
    fast = np.flatnonzero((e.speed_mps[:, 0] > limit_mps + 1e-6) & (e.time_s > -STEP_S / 2))
    if len(fast):
        first = int(fast[0])
        s, acts = _within_limit(s, first, limit_mps * e.step_s), min(acts, first)
    acts = acts if stays else min(acts, in_lane)
    if acts >= index:  # it acts when it is too late
        return False
    return _holds(gauge, history, path, s, acts)


def _keeps_by_anticipating(e: Evidence, path: Path, met: MetActor | None, index: int) -> tuple[Floats, int]:
    """Drives the defensive driver along the path.

    Returns its metres per frame until 3 s after the violation, and the frame in which it acts.
    """
    striker, began = (None, index) if met is None else (met.column, met.conflict.frame)
    s, acts = driven(e.until(index), Path(*(each[: index + 1] for each in path)), striker, began, index)
    return (path.s.copy() if acts == index else s), acts


def _keeps_by_braking(name: str, e: Evidence, path: Path, met: MetActor | None, after_steps: int) -> tuple[Floats, int]:
    """Drives a braking driver along the path.

    Returns its metres per frame, NaN once it stands, and the frame from which it brakes.
    """
    last = len(e.time_s) - 1
    if met is None:
        return path.s.copy(), last
    driver, perceives_s = DRIVERS[name]
    first = met.conflict.frame + round(perceives_s / e.step_s)
    if first >= last:
        return path.s.copy(), last
    motion = recorded_motion(e, met.column)
    track = motion._replace(heading=np.unwrap(motion.heading))
    driven = np.full(last - first + after_steps, np.nan)
    grip = e.ground.friction * GRAVITY_MPS2
    speed = float(e.speed_mps[first, 0])
    drive(driver, path, recorded_size(e, 0), track, first, speed, grip, HORIZON_S - perceives_s, e.step_s, driven)
    return np.concatenate((path.s[: first + 1], driven)), first


def _within_limit(s: Floats, first: int, most_m: Floats) -> Floats:
    """Limits the speed from frame `first` on to `most_m` per step."""
    steps = np.diff(s, prepend=s[:1])
    for t in range(first, len(steps)):
        steps[t] = min(steps[t], max(most_m[min(t, len(most_m) - 1)], steps[t - 1] - EASES_MPS2 * STEP_S**2))
    driven: Floats = s[0] + np.cumsum(steps)
    return driven


def _holds(gauge: Gauge, history: History, path: Path, s: Floats, acts: int) -> bool:
    """Tells whether the requirement holds on `s` from frame `acts` to standstill."""
    gauge.reset(gauge.carriageway)
    for frame, measures in zip(history.frames[: acts + 1], history.measures, strict=False):
        gauge.remember(frame, measures.signals)
    followers = _followers(history, acts)
    before = history.frames[acts]
    for t in range(acts + 1, len(s)):
        if math.isnan(s[t]):
            break
        frame, seen = placed(history, path, s, t, followers, before)
        measured = gauge.measure(frame, before, seen)
        if measured.assessment.touched or measured.robustness[0] < 0.0:
            return False
        before = frame
    return True


def _followers(history: History, t: int) -> frozenset[str]:
    """Returns ids of same-direction actors behind the ego in frame `t`."""
    frame, others = history.frames[t], history.measures[t].assessment.others
    behind = others[AHEAD] + (frame.length_m[1:] + frame.length_m[0]) / 2 < 0.0
    return frozenset(np.array(frame.ids[1:])[behind & (others[COS] > 0.5)].tolist())


def placed(
    history: History, path: Path, s: Floats, t: int, without: frozenset[str], before: Frame
) -> tuple[Frame, Bools]:
    """Returns frame `t` and the ego's view with the ego at `s[t]`.

    `before` is the frame before it.

    After the last frame others go on as they move in it. `without` lists actors that are left out.
    """
    last = len(history.frames) - 1
    recorded, measures = history.frames[min(t, last)], history.measures[min(t, last)]
    stays = np.array([id_ not in without for id_ in recorded.ids])
    state = recorded.state[:, stays].copy()
    beyond_s = max(t - last, 0) * STEP_S
    state[X] += beyond_s * state[VX]
    state[Y] += beyond_s * state[VY]
    x, y, heading = pose_at(path, s[t])
    speed = (s[t] - s[t - 1]) / STEP_S
    if t + 1 < len(s) and not math.isnan(s[t + 1]):  # now, not on average over the step before
        speed = (s[t + 1] - s[t - 1]) / (2 * STEP_S)
    state[(X, Y, HEADING), 0] = x, y, heading
    # As frames have it: the velocity of the front over the step.
    reach, b = state[LENGTH, 0] / 2, before.state[:, 0]
    state[VX, 0] = (x - b[X] + reach * (math.cos(heading) - math.cos(b[HEADING]))) / STEP_S
    state[VY, 0] = (y - b[Y] + reach * (math.sin(heading) - math.sin(b[HEADING]))) / STEP_S
    state[(SPEED, LATERAL, ACCEL), 0] = speed, 0.0, (speed - before.ego_speed_mps) / STEP_S
    frame = recorded._replace(
        time_s=recorded.time_s + beyond_s,
        ids=tuple(id_ for id_, stay in zip(recorded.ids, stays, strict=True) if stay),
        kind=recorded.kind[stays],
        role=recorded.role[stays],
        state=state,
        link=recorded.link[stays],
        stop_line_m=recorded.stop_line_m + path.s[min(t, last)] - s[t],
    )
    return frame, measures.assessment.seen[stays[1:]]
