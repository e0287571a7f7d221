"""The reference drivers: when each perceives a conflict, and how it brakes from then on.

Sources: UN Regulation 157, Annex 3, for its competent and careful human driver; `risk_sac.verdicts.fuzzy` for the
JRC's model; Shalev-Shwartz et al. 2017 for RSS, with the parameters of Mattas et al. 2022, "Driver models for the
definition of safety requirements of automated vehicles in international regulations", Accident Analysis & Prevention
174.
"""

import math
from typing import NamedTuple

from risk_sac.jit import compiled
from risk_sac.risk.rss import lateral, opposite_direction, same_direction
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.scenario.limits import GRAVITY_MPS2
from risk_sac.verdicts.along import Along
from risk_sac.verdicts.course import CORRIDOR_M
from risk_sac.verdicts.fuzzy import REACTION_S, braking

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

    along: Along[float]  # the striker along the ego's path
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
    """Braking of RSS's proper response, m/s²: 6 while both distances are too small, else none."""
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
