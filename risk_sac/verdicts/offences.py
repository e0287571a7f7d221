"""Offences of a striker that endangered the ego, and the ego's own.

Background traffic is not asked for brake checks: SUMO's drivers brake for a reason, which is not always on record.
"""

import math

import numpy as np
from numpy.typing import NDArray

from risk_sac.maps.carriageway import ANY_WAY, carriageway_of, sector_of
from risk_sac.records import ConflictType
from risk_sac.risk.publish import depths, overtakes
from risk_sac.verdicts.conflict import Conflict
from risk_sac.verdicts.course import (
    HORIZON_S,
    MARKING_S,
    RESPONDS_S,
    WANDER_M,
    YIELDING_MPS2,
    BodyOnPath,
    at,
    time_to_touch,
    with_margin,
)
from risk_sac.verdicts.drivers import R157_DELAY_S
from risk_sac.verdicts.evidence import (
    Evidence,
    Letters,
    ego_path,
    inside,
    lanes_of,
    recorded_motion,
    recorded_size,
    seen_along,
)
from risk_sac.world.types import HEADING, LENGTH, SPEED, WIDTH, Bools, Floats, Kind, Role, X, Y

EGO = 0
JUNCTION_S = 6.0  # the longest way through a junction
LEAVES_S = 1.0  # a vehicle that has been out of the junction for no longer is still in it
STOPS = b"ruy"  # signals at which a vehicle has to stop if it can
EASES_MPS2 = 2.0  # how a driver that is too fast slows down to the limit
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
        "wrong_direction": reverses(evidence, striker) or "wrong_direction" in left_carriageway(evidence, striker),
        "speeding": speeds(evidence, striker),
    }
    return tuple(name for name, broke in rules.items() if broke)


def ego_offences(evidence: Evidence, striker: int | None = None, *, crossing: bool = False) -> tuple[str, ...]:
    """Lists what the ego broke: red_light, priority, wrong_direction, speeding, off_road.

    Priority counts against a striker only; an ego on red had none anyway. What the ego inherited at the release is no
    offence: a red light before which it could not stop any more, or a speed that it is reducing.
    """
    red_light = entered_on(evidence, EGO, RED) and not on_inherited_red(evidence)
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


def left_carriageway(evidence: Evidence, actor: int = EGO) -> frozenset[str]:
    """Names how a vehicle's whole body left its carriageway within 3 s.

    `wrong_direction`: on an oncoming lane, without overtaking; `off_road`: beside any lane.
    """
    e, found = evidence, set()
    if not e.ground.net:
        return frozenset()
    carriageway = carriageway_of(e.ground.net)
    order = [actor, *(column for column in range(len(e.ids)) if column != actor)]
    state = np.zeros((WIDTH + 1, len(e.ids)))
    state[LENGTH], state[WIDTH] = e.length_m[order], e.width_m[order]
    for t in range(len(e.time_s) - 1, e.since(RECENT_S) - 1, -LOOK_STEPS):
        for row, values in ((X, e.x_m), (Y, e.y_m), (HEADING, e.heading_rad), (SPEED, e.speed_mps)):
            state[row] = values[t, order]
        place = float(state[X, 0]), float(state[Y, 0])
        own = carriageway.around(*place, sector_of(float(state[HEADING, 0]))).edges
        if depths(own, state)[1] >= 0.0:
            continue
        if depths(carriageway.around(*place, ANY_WAY).edges, state)[1] < 0.0:
            found.add("off_road")
        elif not overtakes(own, state):
            found.add("wrong_direction")
    return frozenset(found)


def took_priority(evidence: Evidence, taker: int, other: int) -> bool:
    """Whether a vehicle that had to yield entered before one with priority.

    Their signals at its entry decide: one that turns green later gives no priority over what is in the junction. None
    is recorded for background traffic, whose drivers enter on green.
    """
    entered = entry(evidence, taker, MUST_YIELD)
    if entered is None or not entered_on(evidence, taker, MUST_YIELD):
        return False
    if evidence.role[other] == Role.BACKGROUND:
        return True
    before, later = (part[part > 0] for part in np.split(evidence.link[:, other], [entered]))
    shown = before[-1:] if len(before) else later[:1]
    return bool(len(shown) and int(shown[0]) in MAJOR)


def reverses(evidence: Evidence, striker: int) -> bool:
    """Whether the vehicle drives against its heading, the lane's, at the contact."""
    e = evidence
    heading = e.heading_rad[-1, striker]
    speed = e.vx_mps[-1, striker] * math.cos(heading) + e.vy_mps[-1, striker] * math.sin(heading)
    return bool(speed < -STANDING_MPS)


def speeds(evidence: Evidence, actor: int) -> bool:
    """Whether a vehicle exceeded 110 % of the limit within 3 s.

    The ego may be as fast as at the release, less 2 m/s² from 1.15 s after it on.
    """
    e, first = evidence, evidence.since(RECENT_S)
    allowed = SPEEDING_FACTOR * lanes_of(e, actor, first).limit_mps
    if actor == EGO:
        inherited = e.speed_mps[e.released, EGO] - EASES_MPS2 * np.maximum(e.time_s[first:] - RESPONDS_S, 0.0)
        allowed = np.maximum(allowed, inherited)
    return bool((e.speed_mps[first:, actor] > allowed + 1e-6).any())


def pedestrian_on_red(evidence: Evidence, striker: int) -> bool:
    """Whether the pedestrian stepped on red onto the crossing of the contact.

    `KERB_M` beside it counts. A pedestrian that steps onto it on green and meets red half way has broken no rule.
    """
    stepped = _stepped_onto_crossing(evidence, striker)
    return stepped is not None and int(evidence.link[stepped, striker]) in RED


def took_crossing(evidence: Evidence, striker: int) -> bool:
    """Whether the ego entered a crossing after a pedestrian without red."""
    stepped = _stepped_onto_crossing(evidence, striker)
    if stepped is None or int(evidence.link[stepped, striker]) in RED:
        return False
    x_m, y_m = evidence.x_m[-1:, striker], evidence.y_m[-1:, striker]
    here = [area for area in evidence.ground.crossings if inside((area,), x_m, y_m, KERB_M)[0]]
    return not bool(inside(here, *front_of(evidence, 0, EGO))[: stepped + 1].any())


def entered_on(evidence: Evidence, actor: int, letters: bytes) -> bool:
    """Whether a vehicle is in a junction that it entered on `letters`.

    It is until its whole body has left the junction, however long that takes; where the record does not say where the
    junction ends, for 6 s.
    """
    entered = entry(evidence, actor, letters)
    if entered is None:
        return False
    x, y, areas = evidence.x_m[entered:, actor], evidence.y_m[entered:, actor], evidence.ground.junctions
    reach_m = float(evidence.length_m[actor]) / 2
    heading = evidence.heading_rad[entered:, actor]
    within = np.zeros(len(x), dtype=np.bool_)
    for share in (-1.0, 0.0, 1.0):  # rear, middle and front
        within |= inside(areas, x + share * reach_m * np.cos(heading), y + share * reach_m * np.sin(heading))
    reached = int(within.argmax())  # the junction begins behind the stop line
    allowed_s = LEAVES_S if areas else JUNCTION_S
    return bool(np.count_nonzero(~within[reached:]) * evidence.step_s <= allowed_s + 1e-6)


def on_inherited_red(evidence: Evidence) -> bool:
    """Whether the ego entered on a red inherited at the release.

    It could not stop at leisure any more: with 3.4 m/s² after 0.75 s, from where it was at the release.
    """
    e, entered = evidence, entry(evidence, EGO, RED)
    if entered is None or entered <= e.released:
        return False
    to_line_m = float(
        np.hypot(np.diff(e.x_m[e.released : entered + 1, EGO]), np.diff(e.y_m[e.released : entered + 1, EGO])).sum()
    )
    stopped = np.isin(e.link[e.released : entered, EGO], list(STOPS)).all()
    after_s = float(e.time_s[entered] - e.time_s[e.released])
    return bool(stopped) and inherits_stop(float(e.speed_mps[e.released, EGO]), to_line_m, after_s)


def inherits_stop(speed_mps: float, to_line_m: float, after_s: float) -> bool:
    """Whether the ego inherits that it passes a stop line.

    The way to the line is too short to stop at leisure, and it passes the line before it would then stand: one that
    passes it later has stopped or crept.

    Args:
      speed_mps: at the release.
      to_line_m: way to the line then.
      after_s: from the release until it passes the line.
    """
    stops_s, stops_m = R157_DELAY_S + speed_mps / YIELDING_MPS2, speed_mps**2 / (2 * YIELDING_MPS2)
    return speed_mps * R157_DELAY_S + stops_m > to_line_m and after_s <= stops_s + 1e-6


def entry(evidence: Evidence, actor: int, letters: bytes) -> int | None:
    """Finds the frame of a vehicle's last entry on `letters`, or None.

    On entry the signal goes from one of these letters to none. A change to another letter is a change of the signal,
    unless the vehicle came into a junction in that step: the letter is then the next junction's.
    """
    e = evidence
    link = e.link[:, actor]
    shown = _is_any(link[:-1], letters)
    if not shown.any():
        return None
    passed = shown & (link[1:] == 0)
    in_junction = inside(e.ground.junctions, *front_of(e, 0, actor))
    passed |= shown & ~_is_any(link[1:], letters) & in_junction[1:] & ~in_junction[:-1]
    frames = np.flatnonzero(passed & (e.speed_mps[1:, actor] > STANDING_MPS))
    return int(frames[-1]) + 1 if len(frames) else None


def _stepped_onto_crossing(evidence: Evidence, striker: int) -> int | None:
    """Finds when the pedestrian stepped onto the contact's crossing; None without one."""
    e = evidence
    on = inside(e.ground.crossings, e.x_m[:, striker], e.y_m[:, striker], KERB_M)
    if not on[-1]:
        return None
    away = np.flatnonzero(~on)
    return int(away[-1]) + 1 if len(away) else 0


def _is_any(link: Letters, letters: bytes) -> Bools:
    any_of: Bools = np.logical_or.reduce([link == letter for letter in letters])
    return any_of


def front_of(evidence: Evidence, first: int, actor: int) -> tuple[Floats, Floats]:
    """Locates the middle of an actor's front, from frame `first` on; m."""
    e = evidence
    heading, reach = e.heading_rad[first:, actor], e.length_m[actor] / 2
    return e.x_m[first:, actor] + reach * np.cos(heading), e.y_m[first:, actor] + reach * np.sin(heading)


INTRUSION_M = 0.3  # into the ego's lane, from which a cut-in counts
R157_BRAKES_MPS2, R157_CUT_IN_S = 6.0, 0.35
R157_GAP_M = 2.0  # 5.2.3.3: the least distance to a vehicle ahead at any speed
CHECKS_MPS2, CHECKS_STEPS = 4.0, 5  # 0.5 s: longer than it takes to come over in front of the ego
ROUNDING_MPS2 = 0.01  # drivers of ordinary behaviour brake with exactly 4 m/s²
CLEAR_M = 30.0  # a vehicle without any other this near ahead, from its front, brakes for none
STEPS_ASIDE_M = 1.0  # a pedestrian this far beside a vehicle's way may be about to step into it
STOPPING_LETTERS = tuple(b"ruygos")  # signals at which a vehicle may have to stop
TURN_RAD = math.radians(30.0)
WALKING_MPS = 0.3  # below it the direction of a pedestrian is noise


def endangered_ego(evidence: Evidence, striker: int, conflict: Conflict) -> tuple[str, ...]:
    """Lists how the striker endangered the ego: unsafe_lane_change, brake_check, turned_into_path."""
    if conflict.type is ConflictType.PEDESTRIAN:  # one that the ego has to let cross may turn
        turned = not took_crossing(evidence, striker) and turns_into_path(evidence, striker)
        return ("turned_into_path",) if turned else ()
    if conflict.type not in (ConflictType.CUT_IN, ConflictType.LEADER):
        return ()
    seen = seen_along(ego_path(evidence), evidence, striker)
    rules = {
        "unsafe_lane_change": conflict.type is ConflictType.CUT_IN
        and changes_lane_unsafely(evidence, striker, seen, conflict.frame),
        "brake_check": evidence.role[striker] == Role.ADVERSARY
        and checks_brakes(evidence, striker, seen, conflict.frame),
    }
    return tuple(name for name, did in rules.items() if did)


def changes_lane_unsafely(evidence: Evidence, striker: int, seen: BodyOnPath[Floats], began: int) -> bool:
    """Tells whether a vehicle entered the ego's lane without enough room.

    Beside the ego there is none; ahead of it UN R157 says how much. It moved across within the last 3 s, or from 1 s
    before the conflict on, which began in frame `began`.
    """
    first = min(evidence.since(RECENT_S), max(began - round(MARKING_S / evidence.step_s), 0))
    if np.ptp(seen.across_m[first:]) <= WANDER_M:  # it kept its place
        return False
    return not enters_safely(evidence, striker, seen, R157_GAP_M)


def enters_safely(evidence: Evidence, striker: int, seen: BodyOnPath[Floats], least_gap_m: float = 0.0) -> bool:
    """Whether a cut-in leaves the ego room to brake (UN R157, 5.2.5.2).

    When it intrudes by 0.3 m into the ego's lane, it is that far ahead and TTC > v_rel / (2 · 6 m/s²) + 0.35 s.
    """
    t = intrusion(evidence, striker, EGO, seen)
    return leaves_room(float(evidence.speed_mps[t, EGO]), seen, t, least_gap_m)


def leaves_room(follower_mps: float, seen: BodyOnPath[Floats], t: int, least_gap_m: float) -> bool:
    """Whether a body leaves its follower the room of UN R157, 5.2.5.2."""
    closing = follower_mps - seen.speed_mps[t]
    needed_s = max(closing, 0.0) / (2 * R157_BRAKES_MPS2) + R157_CUT_IN_S
    return bool(seen.gap_m[t] > least_gap_m and seen.ttc_s[t] > needed_s)


def checks_brakes(evidence: Evidence, striker: int, seen: BodyOnPath[Floats], began: int) -> bool:
    """Tells whether a vehicle before the ego braked hard without a reason.

    Hard is over 4 m/s² for 0.5 s, in the last 3 s or from frame `began` of the conflict on. A reason is a road user
    within 30 m ahead of it, or a signal at which it may have to stop.
    """
    e = evidence
    first = min(began, e.since(RECENT_S))
    behind = (seen.gap_m > 0.0) & (seen.gap_m <= HORIZON_S * e.speed_mps[:, 0])
    behind &= np.abs(seen.across_m) <= lanes_of(e, EGO).width_m / 2
    hard = e.accel_mps2[:, striker] < -CHECKS_MPS2 - ROUNDING_MPS2
    braked = behind & hard & ~np.isin(e.link[:, striker], STOPPING_LETTERS)
    frames = first + np.flatnonzero(braked[first:])
    return bool(np.count_nonzero(~_any_ahead(e, striker, frames)) >= CHECKS_STEPS)


def turns_into_path(evidence: Evidence, striker: int) -> bool:
    """Tells whether a pedestrian turned into a visible ego's way.

    It turned by 30° or more within the last 4 s. What the ego sees can see the ego.
    """
    e = evidence
    first = e.since(HORIZON_S)
    vx, vy = e.vx_mps[first:, striker], e.vy_mps[first:, striker]
    if math.hypot(vx[-1], vy[-1]) < WALKING_MPS:
        return False
    turned = np.abs(np.angle((vx + 1j * vy) / (vx[-1] + 1j * vy[-1]))) >= TURN_RAD
    before = np.flatnonzero(turned & (np.hypot(vx, vy) >= WALKING_MPS) & e.known[first:, striker])
    if len(before) == 0 or e.speed_mps[first + before[-1], 0] < STANDING_MPS:
        return False
    path, size, motion = ego_path(e), with_margin(recorded_size(e, 0)), recorded_motion(e, striker)
    t = first + int(before[-1])
    return time_to_touch(path, float(path.s[t]), float(e.speed_mps[t, 0]), size, at(motion, t), HORIZON_S) > HORIZON_S


def intrusion(evidence: Evidence, actor: int, owner: int, seen: BodyOnPath[Floats]) -> int:
    """Finds when an actor last came 0.3 m into the owner's lane.

    The owner is that of the path. It is the frame of the contact if the actor did not.
    """
    e = evidence
    reach = (np.abs(np.sin(seen.turn_rad)) * e.length_m[actor] + np.abs(np.cos(seen.turn_rad)) * e.width_m[actor]) / 2
    intrudes = np.abs(seen.across_m) - reach <= lanes_of(e, owner).width_m / 2 - INTRUSION_M
    outside = np.flatnonzero(~intrudes)
    return min(int(outside[-1]) + 1, len(intrudes) - 1) if len(outside) else 0


def _any_ahead(evidence: Evidence, vehicle: int, frames: NDArray[np.int64]) -> Bools:
    """Tells whether a road user is in the way, or soon is.

    That is within 30 m ahead of the vehicle.
    """
    e = evidence
    others = np.delete(np.arange(len(e.ids)), vehicle)
    dx, dy = (each[np.ix_(frames, others)] - each[frames, vehicle, None] for each in (e.x_m, e.y_m))
    cos, sin = (of(e.heading_rad[frames, vehicle, None]) for of in (np.cos, np.sin))
    ahead = dx * cos + dy * sin - (e.length_m[others] + e.length_m[vehicle]) / 2
    aside = np.abs(dy * cos - dx * sin) - (e.width_m[others] + e.width_m[vehicle]) / 2
    aside -= np.where(e.kind[others] == Kind.PEDESTRIAN, STEPS_ASIDE_M, 0.0)
    found: Bools = ((ahead > 0.0) & (ahead <= CLEAR_M) & (aside <= 0.0)).any(axis=1)
    return found
