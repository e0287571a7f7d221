"""The motions: what each kind of adversary does, given its genes.

All have three parts. At first an adversary prepares: it takes up a place beside the ego, keeps the time at which it
will be where their ways cross, or waits at the kerb. From its cue on it strikes, for as long as its genes say, and then
it does something else: so it may show itself, pause, and let the ego come.

What the motions can express follows from what a conflict is (`risk_sac.verdicts.conflict`) and what the ego is told
(`risk_sac.sim.lookout`): a neighbour may hang on the edge of its lane before it cuts in, a leader may be followed for a
while before it brakes, a pedestrian may hesitate.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from risk_sac.env.observation_layout import PER_ADVERSARY, PER_STATIC, SPEED_MPS, X_M, Y_M
from risk_sac.world.types import STEP_S

PASSIVE = 0.4  # an adversary whose gene `active` is smaller does nothing, unless it is the largest of all
EARLIEST_S = 0.5  # after the release: a contact within the first second counts against neither side
LATEST_CUE_S = 6.0  # after that
NEAREST_CUE_S, CUES_S = 0.3, 4.0  # from meeting the ego
LONGEST_S = 4.0  # of a strike
OVER_S = 3.0  # after which nothing more comes of a strike
SAME_WAY_COS = 0.9
CROSSING_SIN = 0.4

IN_LANE_M = 1.2  # an actor nearer to the ego's axis is its leader
NEAREST_M, FARTHEST_M = 1.9, 3.1  # from the ego's axis: touching it, and hardly off the middle of the next lane
FOREMOST_M = 12.0  # along it, from the ego's middle: an actor farther back strikes its flank
BEFORE_M = 5.0  # a leader's middle before the ego's, at least
SAME_LINE_RAD = 0.02  # of the ego's heading from its lane's: far ahead, a body aside by so much is on the ego's way
HIDING_M = 60.0  # the same of one that hides a standing body, at most: an ego at 26 m/s follows at 40 m
FASTER_MPS = 5.0  # than the ego, at most, to take up a place
CATCHING_UP = 0.5  # 1/s, of the way to that place
ANSWER = 0.5  # of full drive, for 1 m/s of difference
GENTLE_ANSWER = 0.15  # the same of a leader that hides a standing body and is too fast: it lets the ego come nearer
LEAST_EFFORT = 0.4  # of an actor that is on time
EARLIER_S, SOONEST_S = 2.0, 0.5  # than the ego, at most; and from now
TURNING = 0.5  # of what is possible, at most
STAYING = 0.2  # signed steering gene up to which a leader stays before a standing body


class Genes(NamedTuple):
    """Genes of one adversary, in [0, 1]; each motion interprets them."""

    active: float
    place: float
    aside: float
    cue: float
    drive: float
    steer: float
    lasts: float
    after: float


SIZE = len(Genes._fields)


class Seen(NamedTuple):
    """One adversary in the ego's frame, and the ego."""

    time_s: float  # since the release
    x_m: float  # between the centres
    y_m: float
    cos: float  # of the heading relative to the ego's
    sin: float
    speed_mps: float
    ego_mps: float
    standing_m: float = math.inf  # to the next static body on the ego's way, between the centres


class Act(NamedTuple):
    """Action in ±1: acceleration; a vehicle's lateral speed, a pedestrian's heading rate."""

    drive: float
    steer: float


def adversaries_seen(
    observation: NDArray[np.float32], adversaries: int, step: int, statics: int = 0
) -> list[Seen | None]:
    """Returns adversaries in the family's order; None for those off the net.

    Args:
      observation: see `risk_sac.env.observation`.
      adversaries: how many.
      step: of the episode, from 0.
      statics: how many bodies never move.
    """
    rows: list[list[float]] = observation[: adversaries * PER_ADVERSARY].reshape(-1, PER_ADVERSARY).tolist()
    ego_mps = float(observation[adversaries * PER_ADVERSARY]) * SPEED_MPS
    places: list[list[float]] = observation[-1 - PER_STATIC * statics : -1].reshape(-1, PER_STATIC).tolist()
    standing_m = [x * X_M for x, y in places if x > 0.0 and abs(y * Y_M) < IN_LANE_M + SAME_LINE_RAD * x * X_M]
    return [_seen(row, step * STEP_S, ego_mps, standing_m) if any(row) else None for row in rows]


def _seen(row: list[float], time_s: float, ego_mps: float, standing_m: Sequence[float]) -> Seen:
    x, y, _, _, cos, sin, speed, *_ = row
    to_m = min((other_m - x * X_M for other_m in standing_m if other_m > x * X_M), default=math.inf)
    return Seen(time_s, x * X_M, y * Y_M, cos, sin, speed * SPEED_MPS, ego_mps, to_m)


def act(genes: Genes, seen: Seen, since_cue_s: float, pedestrian: bool) -> Act:
    """Returns an adversary's present action.

    Args:
      genes: its own.
      seen: itself and the ego.
      since_cue_s: negative before its cue.
      pedestrian: whether it is one.
    """
    same_way = seen.cos > SAME_WAY_COS and not pedestrian
    return alongside(genes, seen, since_cue_s) if same_way else crossing(genes, seen, since_cue_s, pedestrian)


def cue(genes: Genes, seen: Seen, pedestrian: bool) -> bool:
    """Whether it is time to strike.

    A vehicle in the ego's direction strikes at a time of its genes, all others as the ego nears: 0.3 to 4.3 s from
    meeting, as both approach along the ego's axis. One that hides a static body does so as it nears that body.
    """
    if not pedestrian and seen.cos > SAME_WAY_COS:
        if math.isfinite(seen.standing_m):
            return seen.standing_m < (NEAREST_CUE_S + CUES_S * genes.cue) * seen.speed_mps
        return seen.time_s >= EARLIEST_S + LATEST_CUE_S * genes.cue
    closing_mps = seen.ego_mps - seen.cos * seen.speed_mps
    return 0.0 < seen.x_m < (NEAREST_CUE_S + CUES_S * genes.cue) * closing_mps


def is_over(genes: Genes, since_cue_s: float) -> bool:
    """Whether the strike has been over for a while."""
    return since_cue_s > LONGEST_S * genes.lasts + OVER_S


def alongside(genes: Genes, seen: Seen, since_cue_s: float) -> Act:
    """Drives a vehicle that goes the ego's way.

    It keeps a place beside or ahead of the ego, then comes over, brakes or both.

    `place` is where along the ego it waits and `aside` how far from the ego's axis; a leader keeps its lane. `drive`
    and `steer`, towards the ego, are those of the strike, `after` is the drive that follows.

    Before a static body on the ego's way it leaves that way instead, so that the ego meets the body: to the right for a
    `steer` below 0.4, to the left above 0.6. `aside` is how far. `drive` is how fast, up to 5 m/s from the ego's speed,
    whatever its driver would do about the body. A neighbour stays beside.
    """
    if since_cue_s < 0.0:
        return _taking_place(genes, seen)
    if math.isinf(seen.standing_m) or since_cue_s >= LONGEST_S * genes.lasts:
        return _strike(genes, since_cue_s, genes.steer * _clip(-seen.y_m))
    wanted, leads = _signed(genes.steer), abs(seen.y_m) < IN_LANE_M
    stays = leads and abs(wanted) < STAYING
    aside_m = 0.0 if stays else math.copysign(_aside_m(genes), wanted if leads else seen.y_m)
    return Act(_keeping_speed(seen, FASTER_MPS * _signed(genes.drive)), _clip(aside_m - seen.y_m))


def _keeping_speed(seen: Seen, faster_mps: float, answer: float = ANSWER) -> float:
    return _clip(answer * (seen.ego_mps + faster_mps - seen.speed_mps))


def _aside_m(genes: Genes) -> float:
    return NEAREST_M + (FARTHEST_M - NEAREST_M) * genes.aside


def _taking_place(genes: Genes, seen: Seen) -> Act:
    leads = abs(seen.y_m) < IN_LANE_M
    hides = leads and math.isfinite(seen.standing_m)
    foremost_m = HIDING_M - BEFORE_M if hides else FOREMOST_M
    place_m = foremost_m * genes.place + (BEFORE_M if leads else 0.0)
    aside_m = 0.0 if leads else _aside_m(genes)
    faster_mps = _clip(CATCHING_UP * (place_m - seen.x_m), FASTER_MPS)
    waits_s = EARLIEST_S + LATEST_CUE_S * genes.cue / 4  # for most of the time to its cue it is beside the ego
    steer = _clip(math.copysign(aside_m, seen.y_m) - seen.y_m) if seen.time_s >= waits_s else 0.0
    too_fast = seen.speed_mps > seen.ego_mps + faster_mps
    return Act(_keeping_speed(seen, faster_mps, GENTLE_ANSWER if hides and too_fast else ANSWER), steer)


def crossing(genes: Genes, seen: Seen, since_cue_s: float, pedestrian: bool) -> Act:
    """Drives a crossing or opposing vehicle, or a pedestrian.

    It keeps its time to where the ways cross, then goes for it.

    `place` is how much earlier than the ego it means to be there, 2 s at most, or how it moves where the ways do not
    cross; `aside` is how hard it works at that, against what a driver would do at a red light. So it waits for the ego,
    slows down as the ego does, and sets off when the ego does. `drive` and `steer`, to the left or the right, are those
    of the strike, `after` is the drive that follows.
    """
    if since_cue_s < 0.0:
        keeping_time = _walking_on_time if pedestrian else _driving_on_time
        return Act((LEAST_EFFORT + (1.0 - LEAST_EFFORT) * genes.aside) * keeping_time(genes, seen), 0.0)
    return _strike(genes, since_cue_s, TURNING * _signed(genes.steer))


def _strike(genes: Genes, since_cue_s: float, steer: float) -> Act:
    if since_cue_s < LONGEST_S * genes.lasts:
        return Act(_signed(genes.drive), steer)
    return Act(_signed(genes.after), 0.0)


def _walking_on_time(genes: Genes, seen: Seen) -> float:
    """A pedestrian stands or walks."""
    if abs(seen.sin) < CROSSING_SIN:
        return _signed(genes.place)
    own_m, ego_s = _to_crossing(seen)
    return _clip(own_m / max(seen.speed_mps, 1.0) - ego_s + EARLIER_S * _signed(genes.place))


def _driving_on_time(genes: Genes, seen: Seen) -> float:
    """A vehicle takes up the speed that brings it there on time.

    An action by the difference of the times overshoots again and again, as acceleration builds up with limited jerk,
    and no driver changes pedals every second.
    """
    if abs(seen.sin) < CROSSING_SIN:
        return _signed(genes.place)
    own_m, ego_s = _to_crossing(seen)
    wanted_s = max(ego_s - EARLIER_S * _signed(genes.place), SOONEST_S)
    return _clip(ANSWER * (own_m / wanted_s - seen.speed_mps))


def _to_crossing(seen: Seen) -> tuple[float, float]:
    """Computes an adversary's way to the ego's axis, and the ego's time.

    The time is the ego's until it is there.
    """
    own_m = -seen.y_m / seen.sin
    ego_m = seen.x_m + own_m * seen.cos
    return own_m, ego_m / max(seen.ego_mps, 1.0)


def _signed(gene: float) -> float:
    """From [0, 1] to [-1, 1]."""
    return 2.0 * gene - 1.0


def _clip(value: float, limit: float = 1.0) -> float:
    return min(max(value, -limit), limit)
