"""Names the kind of a failure, and its variant within the kind.

A kind is what a person tells apart: the striker and its direction, the ego's manoeuvre, whether the striker was hidden
and, without contact, the requirement. All else that a verdict says of a failure makes the variant.
"""

import math
from typing import NamedTuple

from risk_sac.records import ConflictType
from risk_sac.scenario.bodies import body_of
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.offences import IN_WORDS
from risk_sac.verdicts.reference import NO_RED_LIGHT_ENTRY, ON_CARRIAGEWAY
from risk_sac.world.types import Role

ONCOMING_COS = math.cos(math.radians(135.0))
FAST_MPS = 30 / 3.6  # Choice: where pedestrians begin to die; see `risk_sac.verdicts.labels`
LATE_S = 2.0  # Choice: what R157's driver needs to be at full braking
STRIKERS = {
    ConflictType.LEADER: "leader",
    ConflictType.MERGE: "neighbour",
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
VIOLATED = {NO_RED_LIGHT_ENTRY: "red light entered", ON_CARRIAGEWAY: "carriageway left"}
# What the ego breaks by violating the requirement, which its name says already.
SAME_OFFENCES = {NO_RED_LIGHT_ENTRY: ("red_light",), ON_CARRIAGEWAY: ("off_road", "wrong_direction")}


class Named(NamedTuple):
    """Kind of a failure, and variant within the kind, in words."""

    kind: str
    variant: str


def name_contact(
    evidence: Evidence,
    striker: int,
    conflict: Conflict,
    *,
    manoeuvre: str,
    response: str,
    ground: str,
    broke: tuple[str, ...],
    ego_broke: tuple[str, ...],
) -> Named:
    """Names a contact in the last frame by its kind and variant.

    Such as "pedestrian, from hiding; ego goes straight" and "on red, ahead, on a crossing, slow; ego brakes late, fast,
    early conflict". Slow is below 30 km/h; a conflict is late that began less than 2 s before the contact.

    Neither names a zone of a body: a pedestrian of half a metre has four, and one failure would be four. Nor do they
    name a side where the mirrored scene is the same failure (a cut-in, a pedestrian). Traffic from the left and from
    the right is distinguished: it has other rules and other distances.
    """
    from_hiding = ["from hiding"] if conflict.hidden else []
    kind = f"{', '.join((_striker(evidence, striker, conflict), *from_hiding))}; {MANOEUVRES[manoeuvre]}"
    ego_mps, other_mps = (float(evidence.speed_mps[-1, column]) for column in (0, striker))
    background = ["background traffic"] if evidence.role[striker] == Role.BACKGROUND else []
    position = [] if conflict.type is ConflictType.CUT_IN else [conflict.position]
    lasted_s = float(evidence.time_s[-1]) - conflict.time_s
    of_striker = (*_offences(broke), *background, *position, GROUNDS[ground], _pace(other_mps))
    of_ego = (*_offences(ego_broke), RESPONSES[response], _pace(ego_mps))
    began = "early conflict" if lasted_s >= LATE_S else "late conflict"
    return Named(kind, f"{', '.join(of_striker)}; ego {', '.join(of_ego)}, {began}")


def name_violation(requirement: str, *, manoeuvre: str, broke: tuple[str, ...], ego_mps: float) -> Named:
    """Names a violation without contact by its kind and variant.

    Such as "red light entered; ego turns left" and "ego speeding, fast". What is near the ego is no part of it.
    """
    others = tuple(name for name in broke if name not in SAME_OFFENCES.get(requirement, ()))
    violated = VIOLATED.get(requirement, f"{requirement} violated")
    return Named(f"{violated}; {MANOEUVRES[manoeuvre]}", f"ego {', '.join((*_offences(others), _pace(ego_mps)))}")


def _striker(evidence: Evidence, striker: int, conflict: Conflict) -> str:
    """Names the striker; a body that the conflict's type does not say is named by its row."""
    body = body_of(int(evidence.body[striker]))
    vehicle = "vehicle" if body.shape == "vehicle" else body.name
    if evidence.role[striker] == Role.STATIC:
        return f"standing {vehicle}"
    of_body = "" if body.shape == "vehicle" else f" of a {vehicle}"
    if conflict.type is ConflictType.CUT_IN:
        return f"cut-in{of_body} from {conflict.position}"
    if conflict.type is ConflictType.PEDESTRIAN:
        return vehicle
    if conflict.type is not ConflictType.CROSSING:
        return STRIKERS[conflict.type] if body.shape == "vehicle" else f"{vehicle} as {STRIKERS[conflict.type]}"
    turn = float(evidence.heading_rad[conflict.frame, striker] - evidence.heading_rad[conflict.frame, 0])
    if math.cos(turn) < ONCOMING_COS:
        return f"oncoming {vehicle}"
    return f"{vehicle} from the right" if math.sin(turn) > 0.0 else f"{vehicle} from the left"


def _offences(broke: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(IN_WORDS[name] for name in broke)


def _pace(speed_mps: float) -> str:
    return "fast" if speed_mps >= FAST_MPS else "slow"
