"""Whether a reference driver in the ego's place keeps a requirement that the ego violated without contact.

Choices:
- A reference driver keeps its lane, and so it stays on the carriageway: without contact nothing pushes it off.
- It obeys signals: it does not enter on red if it could stop at the line from when the signal turned yellow or red.
  It needs its own reaction time and braking for that, `r157`'s: 1.15 s and up to 0.774 g. Signals are timed
  for 1 s and 3.05 m/s² (Institute of Transportation Engineers).
- It keeps the speed limit.
- Any other requirement is measured again, on the path of its lane and with what the driver brakes in the conflict with
  the actor that mattered most. Others move as recorded; those that follow the ego are left out, since they would have
  kept their distance. It is measured until the driver stands, the horizon, or 4 s after a contact of the ego.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from risk_sac.config import Requirement
from risk_sac.risk.measures import Gauge, Measures
from risk_sac.risk.publish import AHEAD, COS
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.types import ACCEL, HEADING, LATERAL, LENGTH, SPEED, STEP_S, VX, VY, Bools, Floats, Frame, Signal, X, Y
from risk_sac.verdicts.anticipation import driven
from risk_sac.verdicts.conflict import Conflict, left_its_place
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.path import Path, pose_at
from risk_sac.verdicts.recorded import ego_path, keeps_lane, lane_path, recorded_motion, recorded_size
from risk_sac.verdicts.reference import DRIVERS
from risk_sac.verdicts.rollout import HORIZON_S, drive, stopping_distance

NO_RED_LIGHT_ENTRY, ON_CARRIAGEWAY = "no_red_light_entry", "on_carriageway"
EASES_MPS2 = 2.0  # how a driver that is too fast slows down to the limit
AFTER_CONTACT_STEPS = 40


class History(NamedTuple):
    """Frames and measures of an episode, `T`, and the evidence made of them."""

    frames: Sequence[Frame]
    measures: Sequence[Measures]
    evidence: Evidence


class MetActor(NamedTuple):
    """The actor that mattered most at a violation, and the ego's conflict with it."""

    column: int  # in the evidence
    conflict: Conflict


def kept_by(
    requirement: Requirement, gauge: Gauge, history: History, index: int, met: MetActor | None
) -> Mapping[str, bool]:
    """Reference driver → whether it keeps a requirement that the ego first violated in frame `index`.

    `gauge` measures that requirement only.
    """
    if requirement.name == ON_CARRIAGEWAY:
        return dict.fromkeys(DRIVERS, True)
    if requirement.name == NO_RED_LIGHT_ENTRY:
        return {name: _stops_at_red(driver, history, index) for name, (driver, _) in DRIVERS.items()}
    return {name: _keeps(name, gauge, history, index, met) for name in DRIVERS}


def _stops_at_red(driver: int, history: History, index: int) -> bool:
    """Whether a driver could stop at the line from when its signal turned yellow or red."""
    first = index
    while first > 0 and history.frames[first - 1].signal in (Signal.YELLOW, Signal.RED):
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
        s, acts = _anticipating(e, path, met, index)
    else:
        touched = history.measures[-1].assessment.touched
        s, acts = _braking(name, e, path, met, after_steps=AFTER_CONTACT_STEPS * touched)
    fast = np.flatnonzero(e.speed_mps[e.time_s > -STEP_S / 2, 0] > e.ground.speed_limit_mps + 1e-6)
    if len(fast):
        first = int(np.searchsorted(e.time_s, -STEP_S / 2)) + int(fast[0])
        s, acts = _within_limit(s, first, e.ground.speed_limit_mps * e.step_s), min(acts, first)
    acts = acts if stays else min(acts, in_lane)
    if acts >= index:  # it acts when it is too late
        return False
    return _holds(gauge, history, path, s, acts)


def _anticipating(e: Evidence, path: Path, met: MetActor | None, index: int) -> tuple[Floats, int]:
    """Drives the defensive driver along the path.

    Returns its metres per frame until 3 s after the violation, and the frame in which it acts.
    """
    striker, began = (None, index) if met is None else (met.column, met.conflict.frame)
    s, acts = driven(e.until(index), Path(*(each[: index + 1] for each in path)), striker, began, index)
    return (path.s.copy() if acts == index else s), acts


def _braking(name: str, e: Evidence, path: Path, met: MetActor | None, after_steps: int) -> tuple[Floats, int]:
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


def _within_limit(s: Floats, first: int, most_m: float) -> Floats:
    """Limits the speed from frame `first` on; `most_m` is the limit's way in a step."""
    steps = np.diff(s, prepend=s[:1])
    for t in range(first, len(steps)):
        steps[t] = min(steps[t], max(most_m, steps[t - 1] - EASES_MPS2 * STEP_S**2))
    driven: Floats = s[0] + np.cumsum(steps)
    return driven


def _holds(gauge: Gauge, history: History, path: Path, s: Floats, acts: int) -> bool:
    """Measures whether the requirement holds on `s` along a path from frame `acts` on, until the driver stands."""
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
    """The actors that follow the ego in frame `t`, by id: behind it, and driving its way."""
    frame, others = history.frames[t], history.measures[t].assessment.others
    behind = others[AHEAD] + (frame.length_m[1:] + frame.length_m[0]) / 2 < 0.0
    return frozenset(np.array(frame.ids[1:])[behind & (others[COS] > 0.5)].tolist())


def placed(
    history: History, path: Path, s: Floats, t: int, without: frozenset[str], before: Frame
) -> tuple[Frame, Bools]:
    """Places the ego `s[t]` along the path in frame `t`; returns the frame and what the ego sees.

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
