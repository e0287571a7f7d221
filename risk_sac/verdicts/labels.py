"""Which rules the striker broke, and on what ground it was struck."""

import math

import numpy as np

from risk_sac.records import ConflictType
from risk_sac.types import Bools, Floats, Kind
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.evidence import Evidence, Letters, inside

RECENT_S = 6.0  # nobody takes longer through a junction
SPEEDING_S = 3.0
SPEEDING_FACTOR = 1.1
MOVES_MPS = 0.5
BESIDE_M = 3.0  # a pedestrian this near to a crossing means to use it
KERB_M = 0.5  # a pedestrian this near to a crossing is stepping onto it
RED, MUST_YIELD, MAJOR = b"ru", b"g", b"G"


def broken(evidence: Evidence, striker: int, conflict: Conflict) -> tuple[str, ...]:
    """Among red_light, priority, wrong_direction, speeding and pedestrian_on_red, those that the striker broke."""
    if evidence.kind[striker] == Kind.PEDESTRIAN:
        return ("pedestrian_on_red",) if pedestrian_on_red(evidence, striker) else ()
    rules = {
        "red_light": ran_red(evidence, striker),
        "priority": took_priority(evidence, striker, conflict),
        "wrong_direction": wrong_direction(evidence, striker),
        "speeding": speeding(evidence, striker),
    }
    return tuple(name for name, broke in rules.items() if broke)


def ran_red(evidence: Evidence, striker: int) -> bool:
    """Whether the vehicle passed a stop line on red in the last 6 s.

    Its signal then goes from red to none. From red to another colour it turned, unless the vehicle came into a
    junction in that step and it is the next junction's.
    """
    return _entered_on(evidence, striker, RED)


def took_priority(evidence: Evidence, striker: int, conflict: Conflict) -> bool:
    """Whether the vehicle crossed the ego's way from a signal that told it to yield, the ego from one that did not."""
    if conflict.type is not ConflictType.CROSSING or not _entered_on(evidence, striker, MUST_YIELD):
        return False
    first = evidence.since(RECENT_S)
    ahead = evidence.link[first:, 0]
    shown = ahead[ahead != 0]
    return bool(len(shown) and shown[-1] in MAJOR)


def wrong_direction(evidence: Evidence, striker: int) -> bool:
    """Whether the vehicle moves by more than 90 degrees off its lane's direction when it strikes.

    Where the lane's direction is not on record it is the vehicle's heading, which SUMO takes from the lane: what is
    found then is a vehicle that goes backwards.
    """
    e = evidence
    lane = e.heading_rad if e.lane_heading_rad is None else e.lane_heading_rad
    along = lane[-1, striker]
    speed = e.vx_mps[-1, striker] * math.cos(along) + e.vy_mps[-1, striker] * math.sin(along)
    return bool(speed < -MOVES_MPS)


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
    """Whether a vehicle passed a stop line while its signal showed one of these letters, in the last 6 s."""
    e, first = evidence, evidence.since(RECENT_S)
    link = e.link[first:, actor]
    shown = _is_any(link[:-1], letters)
    passed = shown & (link[1:] == 0)
    in_junction = inside(e.ground.junctions, *_front(e, first, actor))
    passed |= shown & ~_is_any(link[1:], letters) & in_junction[1:] & ~in_junction[:-1]
    return bool((passed & (e.speed_mps[first + 1 :, actor] > MOVES_MPS)).any())


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
