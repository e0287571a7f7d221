"""Realism cost.

C_real(s, a) = C_hard(s, a) + C_soft(s, a)                                           (5)

Choice: C_hard acts on the whole episode: a scene that breaks one of its rules is rejected before the first step. What
remains is C_soft, in [0, 1], of what adversaries do. Undisturbed traffic costs about 0, or a bound on the cost would
mean nothing.

Source: RISK-SAC, Sec. III-B.
"""

import math
from typing import Literal, Never

import numpy as np
from numpy.typing import NDArray

from risk_sac.errors import InfeasibleScene
from risk_sac.risk.publish import Assessment, worst_rss_margin
from risk_sac.world.geometry import overlapping_pairs
from risk_sac.world.jit import compiled
from risk_sac.world.types import ACCEL, HEADING, LATERAL, SPEED, STEP_S, Floats, Frame, Kind, Scene

BUILD_UP_S = 0.4  # in which an emergency braking builds up from nothing to an actor's limit
ORDINARY_JERK = 0.75  # share of the jerk that this takes, up to which a driver counts as ordinary
COMFORT_MPS2 = 4.5  # what SUMO's drivers brake with at a light; drivers exceed it in emergencies only
COMFORT_SHARE = 0.6  # of an actor's limit, where that is less: pedestrians have a comfort level too
LATERAL_COMFORT_MPS2 = 0.75  # across the lane or the walking direction; SUMO changes lanes with up to 1
LATERAL_LIMIT_MPS2 = 1.5  # at which the lateral excess saturates
CLOSE_GAP_M = 2.0  # an extreme proximity: less than half a car
CLOSING_SCALE_MPS = 15.0  # closing speed at which the closeness term saturates; above, no driver could react

MIN_INITIAL_TTC_S = 1.0  # a shorter one leaves a default driver (0.5 s delay) no chance: the scene itself collides
MIN_INITIAL_GAP_M = 0.5  # bodies placed closer than traffic ever stands

PEDESTRIAN = int(Kind.PEDESTRIAN)  # compiled code knows no enums of int8

HardRule = Literal["initial_overlap", "initial_gap", "initial_ttc", "initial_rss", "initial_conflict"]


@compiled
def jerk_term(accel_mps2: float, previous_accel_mps2: float, limit_mps2: float) -> float:
    """Abrupt control of one adversary, max(|Δa| / dt - ordinary, 0) / (greatest - ordinary), at most 1.

    Choice: the greatest jerk is the actor's own, limit / BUILD_UP_S, and three quarters of it are free, as ordinary
    drivers need them at a light or behind a leader. The limit is the greatest absolute acceleration, above 0.
    """
    greatest = limit_mps2 / BUILD_UP_S
    ordinary = ORDINARY_JERK * greatest
    jerk = abs(accel_mps2 - previous_accel_mps2) / STEP_S
    return min(max(jerk - ordinary, 0.0) / (greatest - ordinary), 1.0)


@compiled
def acceleration_term(accel_mps2: float, lateral_accel_mps2: float, limit_mps2: float) -> float:
    """Excess acceleration of one adversary, the larger of that along and that across its way.

    Each is max(|a| - comfort, 0) / (limit - comfort), at most 1.
    """
    comfort = min(COMFORT_MPS2, COMFORT_SHARE * limit_mps2)
    along = max(abs(accel_mps2) - comfort, 0.0) / (limit_mps2 - comfort)
    across = max(abs(lateral_accel_mps2) - LATERAL_COMFORT_MPS2, 0.0) / (LATERAL_LIMIT_MPS2 - LATERAL_COMFORT_MPS2)
    return min(max(along, across), 1.0)


@compiled
def closeness_term(gap_m: float, previous_gap_m: float) -> float:
    """Sudden extreme proximity of one adversary to the ego, nearness · closing speed / scale.

    nearness = max(1 - gap / close, 0) is 1 at contact; the closing speed is (previous gap - gap) / dt. Only what is
    both near and sudden costs: a queue at a light is slow, and a distant oncoming car is far.
    """
    nearness = 1.0 - gap_m / CLOSE_GAP_M
    closing_mps = (previous_gap_m - gap_m) / STEP_S
    if nearness <= 0.0 or closing_mps <= 0.0:
        return 0.0
    return min(nearness, 1.0) * min(closing_mps / CLOSING_SCALE_MPS, 1.0)


@compiled
def lateral_accel(
    lateral_mps: float, previous_lateral_mps: float, turn_rad: float, speed_mps: float, walks: bool
) -> float:
    """Acceleration across the lane of a vehicle, or across the walking direction of a pedestrian, m/s²."""
    if walks:
        return speed_mps * math.atan2(math.sin(turn_rad), math.cos(turn_rad)) / STEP_S
    return (lateral_mps - previous_lateral_mps) / STEP_S


@compiled
def soft_cost(
    rows: NDArray[np.intp],
    limit_mps2: Floats,
    kind: NDArray[np.int8],
    state: Floats,
    gap_m: Floats,
    previous: Floats,
    previous_gap_m: Floats,
) -> float:
    """Soft realism cost of the step between two frames of the same `n` actors, C_soft(s, a) of (5).

    C_soft = 1/2 · max_k jerk_k + 1/4 · max_k excess_k + 1/4 · max_k closeness_k

    Choice: jerk counts double, because it tells commands from driving. Over the adversaries the worst counts, not the
    mean, or one could behave as it liked beside others that do nothing.

    Args:
      rows: columns of the adversaries.
      limit_mps2: greatest absolute acceleration of each adversary.
      kind: `n`.
      state: `rows x n`, now.
      gap_m: `n - 1`, from the ego's body to the others'.
      previous: state one step before.
      previous_gap_m: the gaps one step before.

    Returns:
      In [0, 1]; 0 without adversaries.
    """
    jerk = excess = closeness = 0.0
    for k, row in enumerate(rows):
        accel, limit = state[ACCEL, row], limit_mps2[k]
        turn = state[HEADING, row] - previous[HEADING, row]
        walks = kind[row] == PEDESTRIAN
        across = lateral_accel(state[LATERAL, row], previous[LATERAL, row], turn, state[SPEED, row], walks)
        jerk = max(jerk, jerk_term(accel, previous[ACCEL, row], limit))
        excess = max(excess, acceleration_term(accel, across, limit))
        closeness = max(closeness, closeness_term(gap_m[row - 1], previous_gap_m[row - 1]))
    return jerk / 2.0 + (excess + closeness) / 4.0


def refuse_overlap(frame: Frame, scene: Scene) -> None:
    """C_hard of (5) for every frame up to the release: no two bodies overlap; raises `InfeasibleScene`."""
    if pairs := overlapping_pairs(frame.state):
        first, second = (frame.ids[i] for i in pairs[0])
        _refuse(scene, "initial_overlap", f" by {first!r} and {second!r}")


def refuse_danger(assessment: Assessment, scene: Scene, *, in_conflict: bool) -> None:
    """C_hard of (5) for the frame of the release; raises `InfeasibleScene`."""
    least_gap_m, margin_m = float(assessment.gap_m.min()), worst_rss_margin(assessment)
    rule = broken_hard_rule(least_gap_m, assessment.least.ttc_s, margin_m, in_conflict=in_conflict)
    if rule is not None:
        _refuse(scene, rule)


def _refuse(scene: Scene, rule: HardRule, details: str = "") -> Never:
    message = f"scene of {scene.family!r} breaks {rule}{details}: {dict(scene.values)}"
    raise InfeasibleScene(message, reason=rule)


def broken_hard_rule(gap_m: float, ttc_s: float, rss_margin: float, *, in_conflict: bool) -> HardRule | None:
    """C_hard of (5): the rule that the frame of the release breaks, or None.

    `in_conflict` holds for R157's driver in the ego's place; the rest are the ego's smallest measures. The rule
    of `initial_overlap` is asked of every frame up to the release.
    """
    if gap_m < MIN_INITIAL_GAP_M:
        return "initial_gap"
    if ttc_s < MIN_INITIAL_TTC_S:
        return "initial_ttc"
    if rss_margin < 0.0:
        return "initial_rss"
    if in_conflict:
        return "initial_conflict"
    return None
