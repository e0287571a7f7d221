"""The JRC's fuzzy surfaces: how uncomfortable and how critical a gap is.

Sources: Mattas, Makridis, Botzoris, Kriston, Minarini, Papadopoulos, Re, Rognelund, Ciuffo 2020, "Fuzzy surrogate
safety metrics for real-time assessment of rear-end collision risk. A study based on empirical observations", Accident
Analysis & Prevention 148, 105794; UN Regulation 157 (01 series), Annex 3, performance model 2. Written from memory of
the formulas, not from the model's code. No public text with the equations was found, so the formulas below and their
parameters have still to be compared with the annex.
"""

import math
from typing import NamedTuple

from risk_sac.risk.rss import lateral, opposite_direction, same_direction
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.verdicts.course import CORRIDOR_M, BodyOnPath
from risk_sac.world.jit import compiled

REACTION_S = 0.75  # τ
COMFORT_MPS2 = 4.0  # b_comf
HARDEST_MPS2 = 6.0  # b_max
LEADER_MPS2 = 7.0  # the hardest braking expected of the vehicle ahead
REST_M = 2.0  # d1: wanted between the two when both stand


@compiled
def proactive(gap: float, ego: float, leader: float) -> float:
    """Computes PFS, the proactive fuzzy metric: 0 is safe, 1 is unsafe.

    0: the ego could stop in comfort behind a leader that brakes hard. 1: it could not even with its hardest braking.

    d_safe = u_e τ + u_e²/(2 b_comf) − u_l²/(2 b_lead),  d_unsafe = u_e τ + u_e²/(2 b_max) − u_l²/(2 b_lead)

    `gap` lies between the bodies, m; d1 of it is kept in reserve. In between PFS is linear.
    """
    leader_stops = leader * leader / (2 * LEADER_MPS2)
    safe = ego * REACTION_S + ego * ego / (2 * COMFORT_MPS2) - leader_stops
    unsafe = ego * REACTION_S + ego * ego / (2 * HARDEST_MPS2) - leader_stops
    return _between(gap - REST_M, safe, unsafe)


@compiled
def critical(gap: float, ego: float, ego_accel: float, leader: float) -> float:
    """Computes CFS, the critical fuzzy metric: 0 is safe, 1 is unsafe.

    0: comfortable braking after the reaction avoids a leader that keeps its speed. 1: no braking does.

    u_next = u_e + a' τ with a' = max(a_e, −b_comf);  d_new = ((u_e + u_next)/2 − u_l) τ

    d_safe = d_new + (u_next − u_l)²/(2 b_comf),  d_unsafe = d_new + (u_next − u_l)²/(2 b_max)

    Where the ego is the slower one within the reaction already, d_safe = d_unsafe = (u_e − u_l)²/(2 |a'|).
    In between CFS is linear.
    """
    if ego <= leader:
        return 0.0
    accel = max(ego_accel, -COMFORT_MPS2)
    later = ego + accel * REACTION_S
    if later <= leader:
        return 0.0 if gap > (ego - leader) ** 2 / (-2 * accel) else 1.0
    closed = ((ego + later) / 2 - leader) * REACTION_S
    squared = (later - leader) ** 2
    return _between(gap, closed + squared / (2 * COMFORT_MPS2), closed + squared / (2 * HARDEST_MPS2))


@compiled
def braking(gap: float, ego: float, ego_accel: float, leader: float) -> float:
    """Computes the model's braking, m/s².

    It rises to 4 with PFS, then to 6 with CFS. A leader that comes towards the ego has a negative speed,
    which only CFS can handle.
    """
    urgency = critical(gap, ego, ego_accel, leader)
    if urgency > 0.0:
        return COMFORT_MPS2 + urgency * (HARDEST_MPS2 - COMFORT_MPS2)
    return proactive(gap, ego, max(leader, 0.0)) * COMFORT_MPS2


@compiled
def _between(gap: float, safe: float, unsafe: float) -> float:
    if gap >= safe:
        return 0.0
    if gap <= unsafe:
        return 1.0
    return (safe - gap) / (safe - unsafe)


R157_PERCEIVES_S = 0.4
R157_DELAY_S = 0.75
RELEASE_MPS2 = 0.4  # the drag of the released pedal during the delay
FULL_MPS2 = 0.774 * GRAVITY_MPS2
JERK_MPS3 = 12.65
FULL_BRAKING_MPS2 = 8.0
RSS = RssParameters(
    response_s=0.75,
    accel_mps2=3.0,
    brake_min_mps2=6.0,
    brake_max_mps2=6.0,
    lateral_accel_mps2=1.0,
    lateral_brake_mps2=1.0,
    fluctuation_m=0.3,
)


class Situation(NamedTuple):
    """Input of a reference driver, besides the time."""

    along: BodyOnPath[float]  # the striker along the ego's path
    speed_mps: float  # its own
    braking_mps2: float  # its own, now
    half_width_m: float
    other_half_width_m: float  # across the path
    other_lateral_mps: float  # away from the path's left


@compiled
def r157(since_s: float, grip: float) -> float:
    """Braking of R157's driver, m/s², `since_s` after it perceived the conflict.

    0.75 s of released pedal, then a rise at 12.65 m/s³ to 0.774 g or what the road bears.
    """
    braked_s = since_s - R157_DELAY_S
    if braked_s <= 0.0:
        return min(RELEASE_MPS2, grip)
    return min(RELEASE_MPS2 + JERK_MPS3 * braked_s, FULL_MPS2, grip)


@compiled
def full_braking(grip: float) -> float:
    """Braking of the bound, m/s²: in full, at once."""
    return min(FULL_BRAKING_MPS2, grip)


@compiled
def fuzzy(situation: Situation) -> float:
    """Computes the braking that the fuzzy safety model asks for, m/s².

    It is 0 where the striker is not in the way and will not be.

    Choice: beside leaders and cut-ins, anybody in the ego's corridor, or on the way into it, is taken for a leader that
    drives with its speed along the ego's path.
    """
    if not _in_the_way(situation):
        return 0.0
    ahead = situation.along
    return braking(max(ahead.gap_m, 0.0), situation.speed_mps, -situation.braking_mps2, ahead.speed_mps)


@compiled
def rss(situation: Situation) -> float:
    """Returns RSS's braking, m/s²: 6 while both distances are short, else none."""
    ahead, speed = situation.along, situation.speed_mps
    if ahead.behind_m > 0.0:
        return 0.0
    if ahead.speed_mps < 0.0:
        wanted = opposite_direction(speed, -ahead.speed_mps, RSS)
    else:
        wanted = same_direction(speed, ahead.speed_mps, RSS)
    side = 1.0 if ahead.across_m > 0.0 else -1.0
    clear = abs(ahead.across_m) - situation.half_width_m - situation.other_half_width_m
    sideways = lateral(0.0, -side * situation.other_lateral_mps, RSS)
    return RSS.brake_min_mps2 if ahead.gap_m < wanted and clear < sideways else 0.0


@compiled
def towards_command(braking_mps2: float, wanted: float, grip: float, step_s: float) -> float:
    """Limits the change and the size of the braking over one step.

    It changes by at most 12.65 m/s³ and stays below 0.774 g and the road's grip.
    """
    wanted = min(wanted, FULL_MPS2, grip)
    change = JERK_MPS3 * step_s
    return min(max(wanted, braking_mps2 - change), braking_mps2 + change)


@compiled
def _in_the_way(situation: Situation) -> bool:
    ahead = situation.along
    if ahead.behind_m > 0.0:
        return False
    clear = abs(ahead.across_m) - situation.half_width_m - situation.other_half_width_m - CORRIDOR_M
    return clear <= 0.0 or math.copysign(1.0, ahead.across_m) * situation.other_lateral_mps < 0.0


FUZZY_DELAY_S = REACTION_S
RSS_DELAY_S = RSS.response_s
RSS_BRAKES_MPS2 = RSS.brake_min_mps2
