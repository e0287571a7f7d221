"""Labels of a failure: the rules the striker broke, the ground, what the ego did, and the signature made of them."""

import math

import numpy as np

from risk_sac.records import ConflictType
from risk_sac.types import Bools, Floats, Kind, Role
from risk_sac.verdicts.conflict import BRAKES_MPS2, Conflict
from risk_sac.verdicts.drivers import CAREFUL_DELAY_S, CAREFUL_PERCEIVES_S
from risk_sac.verdicts.evidence import Evidence, Letters, inside

JUNCTION_S = 6.0  # nobody takes longer through a junction
SPEEDING_S = 3.0
SPEEDING_FACTOR = 1.1
STANDING_MPS = 0.5
BESIDE_M = 3.0  # a pedestrian this near to a crossing means to use it
KERB_M = 0.5  # a pedestrian this near to a crossing is stepping onto it
RED, MUST_YIELD, MAJOR = b"ru", b"g", b"G"
RECENT_S = 3.0
RECENT_M = 12.0  # a quarter of a circle of 8 m: an ego that creeps through its turn is turning
TURN_RAD = math.radians(20.0)  # more than a lane change takes
LANE_CHANGE_M = 1.0
ONCOMING_COS = math.cos(math.radians(135.0))
STRIKERS = {ConflictType.LEADER: "leader", ConflictType.CUT_IN: "cut-in", ConflictType.PEDESTRIAN: "pedestrian"}
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


def broken(evidence: Evidence, striker: int, conflict: Conflict) -> tuple[str, ...]:
    """Among red_light, priority, wrong_direction, speeding and pedestrian_on_red, those that the striker broke."""
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        return ("pedestrian_on_red",) if pedestrian_on_red(evidence, striker) else ()
    rules = {
        "red_light": _entered_on(evidence, striker, RED),
        "priority": took_priority(evidence, striker, conflict),
        "wrong_direction": wrong_direction(evidence, striker),
        "speeding": speeding(evidence, striker),
    }
    return tuple(name for name, broke in rules.items() if broke)


def took_priority(evidence: Evidence, striker: int, conflict: Conflict) -> bool:
    """Whether the vehicle crossed the ego's way from a signal that told it to yield, the ego from one that did not."""
    if conflict.type is not ConflictType.CROSSING or not _entered_on(evidence, striker, MUST_YIELD):
        return False
    first = evidence.since(JUNCTION_S)
    ahead = evidence.link[first:, 0]
    shown = ahead[ahead != 0]
    return bool(len(shown) and shown[-1] in MAJOR)


def wrong_direction(evidence: Evidence, striker: int) -> bool:
    """Whether the vehicle goes backwards when it strikes; SUMO takes its heading from the lane."""
    e = evidence
    heading = e.heading_rad[-1, striker]
    speed = e.vx_mps[-1, striker] * math.cos(heading) + e.vy_mps[-1, striker] * math.sin(heading)
    return bool(speed < -STANDING_MPS)


def speeding(evidence: Evidence, striker: int) -> bool:
    """Whether the vehicle was more than 10 % over the limit in the last 3 s."""
    fastest = evidence.speed_mps[evidence.since(SPEEDING_S) :, striker].max()
    return bool(fastest > SPEEDING_FACTOR * evidence.ground.speed_limit_mps + 1e-6)


def pedestrian_on_red(evidence: Evidence, striker: int) -> bool:
    """Whether the pedestrian stepped on red onto the signalised crossing on which, or beside which, it was struck.

    Who steps on it on green and is caught by red half way has broken nothing.
    """
    e = evidence
    on = inside(e.ground.crossings, e.x_m[:, striker], e.y_m[:, striker], KERB_M)
    if not on[-1]:
        return False
    away = np.flatnonzero(~on)
    stepped = int(away[-1]) + 1 if len(away) else 0
    return int(e.link[stepped, striker]) in RED


def _entered_on(evidence: Evidence, actor: int, letters: bytes) -> bool:
    """Whether a vehicle passed a stop line while its signal showed one of these letters, in the last 6 s.

    Its signal then goes from them to none. To another letter it turned, unless the vehicle came into a junction in that
    step and it is the next junction's.
    """
    e, first = evidence, evidence.since(JUNCTION_S)
    link = e.link[first:, actor]
    shown = _is_any(link[:-1], letters)
    passed = shown & (link[1:] == 0)
    in_junction = inside(e.ground.junctions, *_front(e, first, actor))
    passed |= shown & ~_is_any(link[1:], letters) & in_junction[1:] & ~in_junction[:-1]
    return bool((passed & (e.speed_mps[first + 1 :, actor] > STANDING_MPS)).any())


def _is_any(link: Letters, letters: bytes) -> Bools:
    return np.isin(link, list(letters))


def _front(evidence: Evidence, first: int, actor: int) -> tuple[Floats, Floats]:
    e = evidence
    heading, reach = e.heading_rad[first:, actor], e.length_m[actor] / 2
    return e.x_m[first:, actor] + reach * np.cos(heading), e.y_m[first:, actor] + reach * np.sin(heading)


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
    """Names the class of failures that a failure belongs to; what differs in it is a different failure.

    Such as "pedestrian on red, ahead, from hiding, on a crossing; ego goes straight, brakes late".

    It names no zone of a body: a pedestrian of half a metre has four, and one failure would be four. Nor does it name a
    side where the mirrored scene is the same failure (a cut-in, a pedestrian). Traffic from the left and from the right
    is told apart: it has other rules and other distances.
    """
    who = " ".join((_striker(evidence, striker, conflict), *dict.fromkeys(BROKE[name] for name in broke)))
    if evidence.role[striker] == Role.BACKGROUND:
        who = f"background {who}"
    where = [conflict.position, *(["from hiding"] if conflict.hidden else []), GROUNDS[ground]]
    return f"{', '.join((who, *where))}; {MANOEUVRES[manoeuvre]}, {RESPONSES[response]}"


def _striker(evidence: Evidence, striker: int, conflict: Conflict) -> str:
    if conflict.type is not ConflictType.CROSSING:
        return STRIKERS[conflict.type]
    turn = float(evidence.heading_rad[conflict.frame, striker] - evidence.heading_rad[conflict.frame, 0])
    if math.cos(turn) < ONCOMING_COS:
        return "oncoming vehicle"
    return "vehicle from the right" if math.sin(turn) > 0.0 else "vehicle from the left"
