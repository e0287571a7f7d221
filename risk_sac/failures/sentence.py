"""Describes a failure in a sentence: striker's place, act, ego's response."""

import math
from itertools import groupby

import numpy as np

from risk_sac.failures.recording import Series
from risk_sac.records import Collision, ConflictType, Violation
from risk_sac.scenario.bodies import body_of
from risk_sac.verdicts.conflict import BRAKES_MPS2, SAME_WAY_COS
from risk_sac.verdicts.drivers import R157_DELAY_S, R157_PERCEIVES_S
from risk_sac.verdicts.labels import ONCOMING_COS, RESPONSES
from risk_sac.verdicts.offences import IN_WORDS, STANDING_MPS
from risk_sac.world.types import STEP_S, Floats, Kind, Role

IN_LANE_M = 1.5  # a vehicle nearer to the ego's axis leads it, or follows
ACROSS_MPS = 0.2  # slower lateral motion does not change the place in a lane
ACTS_MPS2 = 1.5
GAINS_MPS, MOVES_M = 0.3, 0.2  # least change of speed and of place across in a sentence
DRIVING = {"left_turn": " turning left", "right_turn": " turning right", "lane_change": " changing lanes"}


def sentence(series: Series, collision: Collision) -> str:
    """Describes a collision in one sentence.

    E.g. "left neighbour, 4 m ahead, moves right at 1.1 m/s for 1.5 s; ego at 14 m/s brakes 0.5 s late".
    """
    judged = collision.judgement
    since = series["time_s"] - series["released_s"]
    striker = [str(name) for name in series["ids"]].index(collision.other_id)
    began = min(int(np.searchsorted(since, judged.conflict_s - 1e-6)), len(since) - 1)
    begins = int(np.searchsorted(since, -1e-6))
    does = _does(series, striker, begins)
    first = min(began, does[0]) if does else began
    hidden = " from hiding" if judged.hidden else ""
    leads = judged.conflict_type is ConflictType.LEADER
    who = _who(series, striker, first, f"{hidden}{_broke(judged.broke)}", leads=leads)
    what = does[1] if does else f"goes on at {series['speed_mps'][first, striker]:.0f} m/s"
    manoeuvre = DRIVING.get(judged.ego_manoeuvre, "")
    ego = f"ego at {series['speed_mps'][began, 0]:.0f} m/s{manoeuvre}{_broke(judged.ego_broke)}"
    return f"{who}, {what}; {ego} {_response(series, began, judged.ego_response)}"


def story(series: Series, violation: Collision | Violation) -> str:
    """Returns a sentence about any violation; see `sentence` for a contact."""
    if isinstance(violation, Collision):
        return sentence(series, violation)
    ego = f"ego at {violation.ego_speed_mps:.0f} m/s{_broke(violation.broke)} violates {violation.requirement}"
    if violation.other_id is None:
        return ego
    since = series["time_s"] - series["released_s"]
    at, begins = (int(np.searchsorted(since, time_s - 1e-6)) for time_s in (violation.time_s, 0.0))
    other = [str(name) for name in series["ids"]].index(violation.other_id)
    until = {name: series[name][: at + 1] for name in ("accel_mps2", "lateral_mps")}
    does = _does({**series, **until}, other, begins)
    what = does[1] if does else f"goes on at {series['speed_mps'][at, other]:.0f} m/s"
    return f"{_who(series, other, does[0] if does else at, '')}, {what}; {ego}"


def _broke(offences: tuple[str, ...]) -> str:
    """Returns, e.g., " on red speeding"."""
    return "".join(f" {IN_WORDS[name]}" for name in offences)


def _who(series: Series, striker: int, at: int, more: str, *, leads: bool = False) -> str:
    """Names striker and place in the ego's frame.

    One that `leads` is the leader wherever the ego swerves to.
    """
    x, y = (series[name][at, striker] - series[name][at, 0] for name in ("x_m", "y_m"))
    heading = series["heading_rad"][at, 0]
    turn = series["heading_rad"][at, striker] - heading
    ahead_m, left_m = x * math.cos(heading) + y * math.sin(heading), y * math.cos(heading) - x * math.sin(heading)
    side = "left" if left_m > 0.0 else "right"
    body = body_of(int(series["body"][striker]))
    if body.shape != "vehicle" or series["role"][striker] == Role.STATIC:
        standing = "standing " if series["role"][striker] == Role.STATIC else ""
        name = f"{standing}{body.name} on the {side}"
    elif leads:
        name = "leader"
    elif math.cos(turn) > SAME_WAY_COS:
        name = f"{side} neighbour" if abs(left_m) > IN_LANE_M else "leader" if ahead_m > 0.0 else "follower"
    elif math.cos(turn) < ONCOMING_COS:
        name = "oncoming vehicle"
    else:
        name = f"vehicle from the {'right' if math.sin(turn) > 0.0 else 'left'}"  # as its kind says it
    name += more
    if abs(ahead_m) < 1.0:
        return f"{name}, level with it"
    return f"{name}, {abs(ahead_m):.0f} m {'ahead' if ahead_m > 0.0 else 'behind'}"


def _does(series: Series, striker: int, begins: int) -> tuple[int, str] | None:
    """Describes a striker's own action and when it starts; None without.

    A striker that goes on as it did has none.
    """
    accel, across = series["accel_mps2"][begins:, striker], series["lateral_mps"][begins:, striker]
    vehicle = series["kind"][striker] == Kind.VEHICLE
    acts = ACTS_MPS2 if vehicle else ACTS_MPS2 / 3
    slows = "brakes" if vehicle else "slows down"
    motions = [(slows, -accel, acts, GAINS_MPS, "m/s²"), ("speeds up", accel, acts, GAINS_MPS, "m/s²")]
    if vehicle:
        motions.append(("moves left", across, ACROSS_MPS, MOVES_M, "m/s"))
        motions.append(("moves right", -across, ACROSS_MPS, MOVES_M, "m/s"))
    parts = []
    for verb, values, limit, least, unit in motions:
        if frames := _lasting(values, limit, least):
            lasts_s = len(frames) * STEP_S
            parts.append((frames[0], f"{verb} at {values[frames].max():.1f} {unit} for {lasts_s:.1f} s"))
    if not parts:
        return None
    parts.sort()
    return begins + parts[0][0], ", then ".join(text for _, text in parts)


def _lasting(values: Floats, limit: float, least: float) -> list[int]:
    """Returns the last stretch above `limit` whose sum reaches `least`."""
    stretches = [list(frames) for above, frames in groupby(range(len(values)), lambda t: values[t] > limit) if above]
    enough = (frames for frames in reversed(stretches) if len(frames) >= 2 and values[frames].sum() * STEP_S >= least)
    return next(enough, [])


def _response(series: Series, began: int, response: str) -> str:
    """Returns the response in words, with its delay or what precedes it."""
    braked = np.flatnonzero(series["accel_mps2"][began:, 0] <= -BRAKES_MPS2)
    if response == "late_braking":
        late_s = (int(braked[0]) if len(braked) else 0) * STEP_S - R157_PERCEIVES_S - R157_DELAY_S
        return f"brakes {late_s:.1f} s late" if late_s >= STEP_S / 2 else RESPONSES[response]
    if response == "braking":
        return "brakes, and touches it still"
    speed = series["speed_mps"][began:, 0]
    if response == "standing" and speed[0] >= STANDING_MPS:
        return "has stopped"
    if response == "starting" and speed[0] >= STANDING_MPS > speed.min():
        return "stops, then starts"
    if response == "none" and len(braked):
        return "brakes no longer"
    return RESPONSES[response]
