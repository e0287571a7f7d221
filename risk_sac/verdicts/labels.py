"""Labels of a failure: the ground, what the ego did, and the signature made of them."""

import math

import numpy as np

from risk_sac.records import ConflictType
from risk_sac.types import Kind, Role
from risk_sac.verdicts.conflict import BRAKES_MPS2, Conflict
from risk_sac.verdicts.drivers import R157_DELAY_S, R157_PERCEIVES_S
from risk_sac.verdicts.evidence import Evidence, inside
from risk_sac.verdicts.offences import IN_WORDS, RECENT_S, STANDING_MPS
from risk_sac.verdicts.recorded import front_moved_across

RESPONSE_S = 1.0  # before the contact: what the ego does then is its response
SPEEDS_UP_MPS2 = 1.5  # more than Krauss's drivers dawdle with, as `BRAKES_MPS2`
BESIDE_M = 3.0  # a pedestrian this near to a crossing means to use it
RECENT_M = 12.0  # a quarter of a circle of 8 m: an ego that creeps through its turn is turning
TURN_RAD = math.radians(20.0)  # more than a lane change takes
LANE_CHANGE_M = 1.0
ONCOMING_COS = math.cos(math.radians(135.0))
STRIKERS = {
    ConflictType.LEADER: "leader",
    ConflictType.CUT_IN: "cut-in",
    ConflictType.MERGE: "neighbour",
    ConflictType.PEDESTRIAN: "pedestrian",
}
MANOEUVRES = {
    "straight": "ego goes straight",
    "left_turn": "ego turns left",
    "right_turn": "ego turns right",
    "lane_change": "ego changes lanes",
}
RESPONSES = {
    "none": "does not brake",
    "late_braking": "brakes late",
    "braking": "brakes",
    "standing": "stands",
    "starting": "starts",
    "accelerating": "speeds up",
}
GROUNDS = {
    "lane": "in a lane",
    "junction": "in a junction",
    "crossing": "on a crossing",
    "beside_crossing": "beside a crossing",
}


def ground(evidence: Evidence, striker: int) -> str:
    """Names the ground of the contact: lane, junction, crossing or beside_crossing.

    Crossings matter to pedestrians only.
    """
    where, here = evidence.ground, (evidence.x_m[-1:, striker], evidence.y_m[-1:, striker])
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        if inside(where.crossings, *here)[0]:
            return "crossing"
        if inside(where.crossings, *here, BESIDE_M)[0]:
            return "beside_crossing"
    return "junction" if inside(where.junctions, *here)[0] else "lane"


def manoeuvre(evidence: Evidence) -> str:
    """Names the ego's manoeuvre: straight, left_turn, right_turn or lane_change.

    It is what the ego drove in the last 3 s or 12 m, whichever is more.
    """
    driven_m = np.cumsum(evidence.speed_mps[:, 0]) * evidence.step_s
    first = min(evidence.since(RECENT_S), int(np.searchsorted(driven_m, driven_m[-1] - RECENT_M)))
    heading = np.unwrap(evidence.heading_rad[first:, 0])
    turned = float(heading[-1] - heading[0])
    if abs(turned) > TURN_RAD:
        return "left_turn" if turned > 0.0 else "right_turn"
    moved = front_moved_across(evidence)[first:]
    return "lane_change" if abs(moved[-1] - moved[0]) > LANE_CHANGE_M else "straight"


def response(evidence: Evidence, conflict: Conflict) -> str:
    """none, late_braking, braking, standing, starting or accelerating: what the ego did in the last second.

    Of what came before the conflict nothing counts. Of braking and speeding up, the longer counts. Late is an ego that
    first braked in the conflict later than R157's driver. One that stood within the last 3 s and gains speed at
    the contact is starting.
    """
    speed = evidence.speed_mps[:, 0]
    if speed[-1] < STANDING_MPS:
        return "standing"
    recent = speed[evidence.since(RECENT_S) :]
    stood = np.flatnonzero(recent < STANDING_MPS)
    if len(stood) and recent[-1] >= recent[stood[-1] :].max() - STANDING_MPS:
        return "starting"
    accel = evidence.accel_mps2[:, 0]
    latest = accel[max(conflict.frame, evidence.since(RESPONSE_S)) :]
    acts = latest[(latest <= -BRAKES_MPS2) | (latest >= SPEEDS_UP_MPS2)]
    if len(acts) == 0:
        return "none"
    if (acts > 0.0).sum() > len(acts) / 2:
        return "accelerating"
    after_s = np.flatnonzero(accel[conflict.frame :] <= -BRAKES_MPS2)[0] * evidence.step_s
    return "late_braking" if after_s > R157_PERCEIVES_S + R157_DELAY_S else "braking"


def signature(
    evidence: Evidence,
    striker: int,
    conflict: Conflict,
    *,
    manoeuvre: str,
    response: str,
    ground: str,
    broke: tuple[str, ...],
    ego_broke: tuple[str, ...],
) -> str:
    """Names the class of failures that a failure belongs to; what differs in it is a different failure.

    Such as "pedestrian on red, ahead, from hiding, on a crossing; ego goes straight, brakes late". What the striker
    broke follows its name, what the ego broke its manoeuvre: "oncoming vehicle, ...; ego turns left against priority".

    It names no zone of a body: a pedestrian of half a metre has four, and one failure would be four. Nor does it name a
    side where the mirrored scene is the same failure (a cut-in, a pedestrian). Traffic from the left and from the right
    is distinguished: it has other rules and other distances.
    """
    who = " ".join((_striker(evidence, striker, conflict), *(IN_WORDS[name] for name in broke)))
    if evidence.role[striker] == Role.BACKGROUND:
        who = f"background {who}"
    where = [conflict.position, *(["from hiding"] if conflict.hidden else []), GROUNDS[ground]]
    return f"{', '.join((who, *where))}; {ego_in_words(manoeuvre, ego_broke)}, {RESPONSES[response]}"


def ego_in_words(manoeuvre: str, broke: tuple[str, ...]) -> str:
    """Names what the ego did and broke, such as "ego turns left against priority"."""
    return " ".join((MANOEUVRES[manoeuvre], *(IN_WORDS[name] for name in broke)))


def _striker(evidence: Evidence, striker: int, conflict: Conflict) -> str:
    if conflict.type is not ConflictType.CROSSING:
        return STRIKERS[conflict.type]
    turn = float(evidence.heading_rad[conflict.frame, striker] - evidence.heading_rad[conflict.frame, 0])
    if math.cos(turn) < ONCOMING_COS:
        return "oncoming vehicle"
    return "vehicle from the right" if math.sin(turn) > 0.0 else "vehicle from the left"
