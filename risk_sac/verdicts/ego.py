"""What the ego was doing when it was struck, and what it did about it."""

import math

import numpy as np

from risk_sac.verdicts.conflict import BRAKES_MPS2, Conflict
from risk_sac.verdicts.drivers import CAREFUL_DELAY_S, CAREFUL_PERCEIVES_S
from risk_sac.verdicts.evidence import Evidence

RECENT_S = 3.0
RECENT_M = 12.0  # a quarter of a circle of 8 m: an ego that creeps through its turn is turning
TURN_RAD = math.radians(20.0)  # more than a lane change takes
LANE_CHANGE_M = 1.0
STANDING_MPS = 0.5


def manoeuvre(evidence: Evidence) -> str:
    """straight, left_turn, right_turn or lane_change: what the ego drove in the last 3 s or 12 m, whichever is more."""
    driven_m = np.cumsum(evidence.speed_mps[:, 0]) * evidence.step_s
    first = min(evidence.since(RECENT_S), int(np.searchsorted(driven_m, driven_m[-1] - RECENT_M)))
    heading = np.unwrap(evidence.heading_rad[first:, 0])
    turned = float(heading[-1] - heading[0])
    if abs(turned) > TURN_RAD:
        return "left_turn" if turned > 0.0 else "right_turn"
    offset = evidence.unwrapped_offset_m(0)[first:]
    moved = abs(float(offset[-1] - offset[0]))  # NaN where offsets are not on record
    return "lane_change" if moved > LANE_CHANGE_M else "straight"


def response(evidence: Evidence, conflict: Conflict) -> str:
    """none, late_braking, braking, standing or starting: what the ego did from the conflict's beginning on.

    Late is later than the careful driver. Who stood within the last 3 s and gains speed at the contact is starting.
    """
    speed = evidence.speed_mps[:, 0]
    if speed[-1] < STANDING_MPS:
        return "standing"
    recent = speed[evidence.since(RECENT_S) :]
    if recent.min() < STANDING_MPS and recent[-1] >= recent.max() - STANDING_MPS:
        return "starting"
    braked = np.flatnonzero(evidence.accel_mps2[conflict.frame :, 0] <= -BRAKES_MPS2)
    if len(braked) == 0:
        return "none"
    after_s = braked[0] * evidence.step_s
    return "late_braking" if after_s > CAREFUL_PERCEIVES_S + CAREFUL_DELAY_S else "braking"
