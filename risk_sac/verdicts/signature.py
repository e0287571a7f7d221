"""The class of failures one belongs to, in words; what differs in it is a different failure.

It says who struck and how, whether ahead or alongside, what the ego drove and did about it, whether the striker came
out of hiding, on what ground, and what the striker broke. It names no zone of a body: a pedestrian of half a metre has
four, and one failure would be four. Nor does it name a side where the mirrored scene is the same failure (a cut-in, a
pedestrian). Traffic from the left and from the right is told apart: it has other rules and other distances.
"""

import math

from risk_sac.records import ConflictType
from risk_sac.types import Role
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.evidence import Evidence

ONCOMING_COS = math.cos(math.radians(135.0))
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
}
GROUNDS = {
    "lane": "in a lane",
    "junction": "in a junction",
    "crossing": "on a crossing",
    "beside_crossing": "beside a crossing",
}
BROKE = {
    "red_light": "on red",
    "priority": "against priority",
    "wrong_direction": "in the wrong direction",
    "speeding": "speeding",
    "pedestrian_on_red": "on red",
}


def signature(
    evidence: Evidence,
    striker: int,
    conflict: Conflict,
    *,
    manoeuvre: str,
    response: str,
    ground: str,
    broke: tuple[str, ...],
) -> str:
    """Such as "pedestrian on red, ahead, from hiding, on a crossing; ego goes straight, brakes late"."""
    who = " ".join((_striker(evidence, striker, conflict), *dict.fromkeys(BROKE[name] for name in broke)))
    if evidence.role[striker] == Role.BACKGROUND:
        who = f"background {who}"
    where = [conflict.position, *(["from hiding"] if conflict.hidden else []), GROUNDS[ground]]
    return f"{', '.join((who, *where))}; {MANOEUVRES[manoeuvre]}, {RESPONSES[response]}"


def _striker(evidence: Evidence, striker: int, conflict: Conflict) -> str:
    if conflict.type is ConflictType.CROSSING:
        return _crossing(evidence, striker, conflict.frame)
    return {ConflictType.LEADER: "leader", ConflictType.CUT_IN: "cut-in", ConflictType.PEDESTRIAN: "pedestrian"}[
        conflict.type
    ]


def _crossing(evidence: Evidence, striker: int, frame: int) -> str:
    """Where crossing traffic came from when the conflict began, by its heading against the ego's."""
    turn = float(evidence.heading_rad[frame, striker] - evidence.heading_rad[frame, 0])
    if math.cos(turn) < ONCOMING_COS:
        return "oncoming vehicle"
    return "vehicle from the right" if math.sin(turn) > 0.0 else "vehicle from the left"
