"""Rules of the road that the striker or the ego broke."""

import math

import numpy as np

from risk_sac.risk.own_motion import depths, overtakes
from risk_sac.scenario.carriageway import ANY_WAY, carriageway_of, sector_of
from risk_sac.types import HEADING, LENGTH, SPEED, WIDTH, Bools, Floats, Kind, Role, X, Y
from risk_sac.verdicts.evidence import Evidence, Letters, inside

EGO = 0
JUNCTION_S = 6.0  # the longest way through a junction
RECENT_S = 3.0
LOOK_STEPS = 2  # frames between two checks of the ego's position
SPEEDING_FACTOR = 1.1
STANDING_MPS = 0.5
KERB_M = 0.5  # a pedestrian this near to a crossing is stepping onto it
RED, MUST_YIELD, MAJOR = b"ru", b"g", b"G"
IN_WORDS = {
    "red_light": "on red",
    "priority": "against priority",
    "wrong_direction": "in the wrong direction",
    "speeding": "speeding",
    "off_road": "off the road",
    "pedestrian_on_red": "on red",
    "unsafe_lane_change": "without a safe gap",
    "brake_check": "brake-checking",
    "turned_into_path": "turning into the way",
}


def striker_offences(evidence: Evidence, striker: int, *, crossing: bool) -> tuple[str, ...]:
    """Lists what the striker broke: red_light, priority, wrong_direction, speeding, pedestrian_on_red.

    `crossing` says whether it is a vehicle that crossed the ego's way.
    """
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        return ("pedestrian_on_red",) if pedestrian_on_red(evidence, striker) else ()
    rules = {
        "red_light": entered_on(evidence, striker, RED),
        "priority": crossing and took_priority(evidence, striker, EGO),
        "wrong_direction": reverses(evidence, striker),
        "speeding": speeds(evidence, striker),
    }
    return tuple(name for name, broke in rules.items() if broke)


def ego_offences(evidence: Evidence, striker: int | None = None, *, crossing: bool = False) -> tuple[str, ...]:
    """Lists what the ego broke: red_light, priority, wrong_direction, speeding, off_road.

    Priority counts against a striker only; an ego on red had none anyway.
    """
    red_light = entered_on(evidence, EGO, RED)
    priority = False
    if striker is not None and not red_light:
        walks = evidence.kind[striker] == Kind.PEDESTRIAN
        priority = took_crossing(evidence, striker) if walks else crossing and took_priority(evidence, EGO, striker)
    left = left_carriageway(evidence)
    rules = {
        "red_light": red_light,
        "priority": priority,
        "wrong_direction": "wrong_direction" in left,
        "speeding": speeds(evidence, EGO),
        "off_road": "off_road" in left,
    }
    return tuple(name for name, broke in rules.items() if broke)


def left_carriageway(evidence: Evidence) -> frozenset[str]:
    """Names how the ego's whole body left its carriageway in the last 3 s.

    `wrong_direction`: on an oncoming lane, without overtaking; `off_road`: beside any lane.
    """
    e, found = evidence, set()
    if not e.ground.net:
        return frozenset()
    carriageway = carriageway_of(e.ground.net)
    state = np.zeros((WIDTH + 1, len(e.ids)))
    state[LENGTH], state[WIDTH] = e.length_m, e.width_m
    for t in range(len(e.time_s) - 1, e.since(RECENT_S) - 1, -LOOK_STEPS):
        state[X], state[Y], state[HEADING], state[SPEED] = e.x_m[t], e.y_m[t], e.heading_rad[t], e.speed_mps[t]
        place = float(state[X, EGO]), float(state[Y, EGO])
        own = carriageway.around(*place, sector_of(float(state[HEADING, EGO]))).edges
        if depths(own, state)[1] >= 0.0:
            continue
        if depths(carriageway.around(*place, ANY_WAY).edges, state)[1] < 0.0:
            found.add("off_road")
        elif not overtakes(own, state):
            found.add("wrong_direction")
    return frozenset(found)


def took_priority(evidence: Evidence, taker: int, other: int) -> bool:
    """Whether a vehicle entered although it had to yield and the other did not.

    Their signals at entry decide. None is recorded for background traffic, whose drivers enter on green.
    """
    if not entered_on(evidence, taker, MUST_YIELD):
        return False
    if evidence.role[other] == Role.BACKGROUND:
        return True
    ahead = evidence.link[evidence.since(JUNCTION_S) :, other]
    shown = ahead[ahead != 0]
    return bool(len(shown) and int(shown[-1]) in MAJOR)


def reverses(evidence: Evidence, striker: int) -> bool:
    """Whether the vehicle goes backwards when it strikes; SUMO takes its heading from the lane."""
    e = evidence
    heading = e.heading_rad[-1, striker]
    speed = e.vx_mps[-1, striker] * math.cos(heading) + e.vy_mps[-1, striker] * math.sin(heading)
    return bool(speed < -STANDING_MPS)


def speeds(evidence: Evidence, actor: int) -> bool:
    """Whether the vehicle was more than 10 % over the limit in the last 3 s."""
    fastest = evidence.speed_mps[evidence.since(RECENT_S) :, actor].max()
    return bool(fastest > SPEEDING_FACTOR * evidence.ground.speed_limit_mps + 1e-6)


def pedestrian_on_red(evidence: Evidence, striker: int) -> bool:
    """Whether the pedestrian stepped on red onto the crossing where it was struck; `KERB_M` beside it counts.

    A pedestrian that steps onto it on green and meets red half way has broken no rule.
    """
    stepped = _stepped_onto_crossing(evidence, striker)
    return stepped is not None and int(evidence.link[stepped, striker]) in RED


def took_crossing(evidence: Evidence, striker: int) -> bool:
    """Whether the ego came onto a crossing after the pedestrian had stepped onto it, and not on red."""
    stepped = _stepped_onto_crossing(evidence, striker)
    if stepped is None or int(evidence.link[stepped, striker]) in RED:
        return False
    x_m, y_m = evidence.x_m[-1:, striker], evidence.y_m[-1:, striker]
    here = [area for area in evidence.ground.crossings if inside((area,), x_m, y_m, KERB_M)[0]]
    return not bool(inside(here, *_front(evidence, 0, EGO))[: stepped + 1].any())


def entered_on(evidence: Evidence, actor: int, letters: bytes) -> bool:
    """Whether a vehicle entered a junction on one of these letters in the last 6 s.

    On entry the signal goes from one of these letters to none. A change to another letter is a change of the signal,
    unless the vehicle came into a junction in that step: the letter is then the next junction's.
    """
    e, first = evidence, evidence.since(JUNCTION_S)
    link = e.link[first:, actor]
    shown = _is_any(link[:-1], letters)
    passed = shown & (link[1:] == 0)
    in_junction = inside(e.ground.junctions, *_front(e, first, actor))
    passed |= shown & ~_is_any(link[1:], letters) & in_junction[1:] & ~in_junction[:-1]
    return bool((passed & (e.speed_mps[first + 1 :, actor] > STANDING_MPS)).any())


def _stepped_onto_crossing(evidence: Evidence, striker: int) -> int | None:
    """The frame in which the pedestrian stepped onto the crossing that it was struck on; None without one."""
    e = evidence
    on = inside(e.ground.crossings, e.x_m[:, striker], e.y_m[:, striker], KERB_M)
    if not on[-1]:
        return None
    away = np.flatnonzero(~on)
    return int(away[-1]) + 1 if len(away) else 0


def _is_any(link: Letters, letters: bytes) -> Bools:
    return np.isin(link, list(letters))


def _front(evidence: Evidence, first: int, actor: int) -> tuple[Floats, Floats]:
    e = evidence
    heading, reach = e.heading_rad[first:, actor], e.length_m[actor] / 2
    return e.x_m[first:, actor] + reach * np.cos(heading), e.y_m[first:, actor] + reach * np.sin(heading)
