"""States facts about the ego's part in a contact.

They are stated next to the verdict, and `risk_sac.verdicts.fault` judges by them.
"""

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from risk_sac.records import GAINS_MPS, PUBLISHED, ConflictType, EgoPart, Fault, Grade
from risk_sac.risk.rss import margins
from risk_sac.risk.rss_parameters import RssParameters
from risk_sac.scenario.limits import emergency_decel_mps2
from risk_sac.sim.ego import FLICKER_S
from risk_sac.verdicts.conflict import BODY_M, BRAKES_MPS2, Conflict, lasting_since
from risk_sac.verdicts.course import CORRIDOR_M, HORIZON_S, RESPONDS_S, YIELDING_MPS2, BodyOnPath, MovingBox
from risk_sac.verdicts.drivers import JERK_MPS3, R157_DELAY_S
from risk_sac.verdicts.evidence import Evidence, column, ego_path, inside, recorded_motion, seen_along
from risk_sac.verdicts.offences import EGO, STANDING_MPS, STOPS, entry, front_of
from risk_sac.world.geometry import frame_view
from risk_sac.world.jit import compiled
from risk_sac.world.types import HEADING, LENGTH, VX, VY, WIDTH, Bools, Floats, Kind, X, Y

RSS = RssParameters()
BUILD_UP_MPS = RSS.brake_min_mps2**2 / (2 * JERK_MPS3)
DRIFT_MPS = 0.2  # sideways, or of a pedestrian: no motion towards the other
HARDER = 1.1  # than the hardest braking to be expected, beyond what a step of 0.1 s cannot resolve


def left_first(
    evidence: Evidence, striker: int, conflict_type: ConflictType, seen: BodyOnPath[Floats], yields: str | None
) -> str | None:
    """Names the party that first left the proper response: ego or striker.

    None if neither did, or both at once.

    Args:
      evidence: up to the contact.
      striker: its column.
      conflict_type: how it came into the ego's way.
      seen: the striker along the ego's path.
      yields: ego | striker: which had to yield to the other; None if neither.
    """
    began, aside = _danger(evidence, striker)
    if conflict_type in (ConflictType.PEDESTRIAN, ConflictType.CROSSING):
        left = _on_crossing_ways(evidence, striker, began, yields)
    elif aside:
        left = _side_by_side(evidence, striker, began)
    else:
        left = _on_one_lane(evidence, striker, began, seen)
    ego, other = left
    if ego == other:
        return None
    return "ego" if ego < other else "striker"


def _danger(evidence: Evidence, striker: int) -> tuple[int, bool]:
    """Finds when danger began, and whether lateral distance became short last."""
    walks = np.array([evidence.kind[striker] == Kind.PEDESTRIAN])
    along, across = _margins(recorded_motion(evidence, 0), recorded_motion(evidence, striker), walks, RSS)
    dangerous = (along < 0.0) & (across < 0.0)
    began = lasting_since(dangerous, dangerous)
    return began, bool(across[began - 1] >= 0.0 > along[began - 1]) if began else False


def _on_crossing_ways(evidence: Evidence, striker: int, began: int, yields: str | None) -> tuple[float, float]:
    """Finds frames in which ego and striker leave the response, or inf."""
    walks = evidence.kind[striker] == Kind.PEDESTRIAN
    speed = column(evidence.speed_mps, striker)
    ego = _leaves(evidence, column(evidence.speed_mps, 0), began, RSS.brake_min_mps2, BUILD_UP_MPS, yields == "ego")
    if not walks:
        return ego, _leaves(evidence, speed, began, RSS.brake_min_mps2, BUILD_UP_MPS, yields == "striker")
    if yields == "ego":
        return ego, math.inf
    return ego, _leaves(evidence, speed, began, RSS.walk_brake_mps2, DRIFT_MPS, yields == "striker")


def _side_by_side(evidence: Evidence, striker: int, began: int) -> tuple[float, float]:
    e = evidence
    dx, dy = (float(each[began, striker] - each[began, 0]) for each in (e.x_m, e.y_m))
    heading = float(e.heading_rad[began, 0])
    side = math.copysign(1.0, dy * math.cos(heading) - dx * math.sin(heading))
    ego, other = (
        _leaves(e, towards * e.lateral_mps[:, actor], began, RSS.lateral_brake_mps2, DRIFT_MPS)
        for actor, towards in ((0, side), (striker, -side))
    )
    return ego, other


def _on_one_lane(evidence: Evidence, striker: int, began: int, seen: BodyOnPath[Floats]) -> tuple[float, float]:
    rear, front = (striker, 0) if seen.behind_m[began] > 0.0 else (0, striker)
    rear_left = _leaves(evidence, column(evidence.speed_mps, rear), began, RSS.brake_min_mps2, BUILD_UP_MPS)
    harder = np.flatnonzero(evidence.accel_mps2[began:, front] < -HARDER * RSS.brake_max_mps2)
    front_left = float(began + harder[0]) if len(harder) else math.inf
    return (front_left, rear_left) if rear == striker else (rear_left, front_left)


def _leaves(
    evidence: Evidence, speed: Floats, began: int, brake_mps2: float, tolerance_mps: float, yields: bool = False
) -> float:
    """Finds the first frame faster than the proper response; inf if none.

    The speed is the one towards the other.

    One that has to yield responds at once.
    """
    responds = began + (0 if yields else round(RSS.response_s / evidence.step_s))
    if responds >= len(speed):
        return math.inf
    since_s = np.arange(len(speed) - responds) * evidence.step_s
    allowed = np.maximum(speed[responds] - brake_mps2 * since_s, 0.0) + tolerance_mps
    faster = np.flatnonzero(speed[responds:] > allowed)
    return float(responds + faster[0]) if len(faster) else math.inf


@compiled
def _margins(
    ego: MovingBox[Floats], other: MovingBox[Floats], walks: Bools, parameters: RssParameters
) -> tuple[Floats, Floats]:
    """Measures the longitudinal and the lateral RSS margin of each frame, m."""
    along, across = np.empty(len(ego.x)), np.empty(len(ego.x))
    state = np.zeros((WIDTH + 1, 2))
    for i, body in enumerate((ego, other)):
        state[LENGTH, i], state[WIDTH, i] = 2 * body.size.half_length, 2 * body.size.half_width
    for t in range(len(along)):
        for i, body in enumerate((ego, other)):
            state[X, i], state[Y, i], state[HEADING, i] = body.x[t], body.y[t], body.heading[t]
            state[VX, i], state[VY, i] = body.vx[t], body.vy[t]
        found = margins(frame_view(state), walks, parameters)
        along[t], across[t] = found.longitudinal_m[0], found.lateral_m[0]
    return along, across


NEAR_M = 1.5  # of the ego's corridor: a pedestrian on the carriageway that may step into it
SLOW_MPS = 3.0  # an ego that stands looks as far ahead as at this speed


def ego_part(evidence: Evidence, striker: int, conflict: Conflict, yields: str | None) -> EgoPart:
    """Computes the ego's reaction to the striker up to the contact.

    The contact is in the last frame.

    `yields` names which had to yield to the other: ego | striker | None, as for `left_first`.
    """
    e = evidence
    speed, accel = column(e.speed_mps, 0), column(e.accel_mps2, 0)
    seen = seen_along(ego_path(e), e, striker)
    sighted, near = in_view_from(e, striker), _near(e, striker, seen)
    braked = np.flatnonzero(accel[conflict.frame :] <= -BRAKES_MPS2)
    sight_mps = None if sighted is None else _sight_speed(sighted, seen)
    return EgoPart(
        seen_s=0.0 if sighted is None else round(float(e.time_s[-1] - e.time_s[sighted]), 6),
        braked_after_s=round(float(braked[0]) * e.step_s, 6) if len(braked) else None,
        braking_mps2=max(-float(accel[conflict.frame :].min()), 0.0),
        possible_mps2=emergency_decel_mps2(e.ground.friction),
        gained_mps=_gained(speed, _aware_from(near, conflict.frame) + round(RESPONDS_S / e.step_s)),
        started=_started(e, striker, conflict, near),
        sight_mps=sight_mps,
        sighted_mps=None if sight_mps is None or sighted is None else float(speed[sighted]),
        left_first=left_first(e, striker, conflict.type, seen, yields),
    )


def in_view_from(evidence: Evidence, striker: int) -> int | None:
    """Finds the frame since which the striker was in view.

    Breaks of up to 0.5 s do not count. None if it ends unseen.
    """
    frames = np.flatnonzero(evidence.known[:, striker])
    flicker = round(FLICKER_S / evidence.step_s)
    if len(frames) == 0 or len(evidence.time_s) - 1 - frames[-1] > flicker:
        return None
    breaks = np.flatnonzero(np.diff(frames) > flicker)
    return int(frames[breaks[-1] + 1] if len(breaks) else frames[0])


def _near(evidence: Evidence, striker: int, seen: BodyOnPath[Floats]) -> Bools:
    """Whether the ego sees a carriageway pedestrian near its corridor, `T`."""
    e, ground = evidence, evidence.ground
    if e.kind[striker] != Kind.PEDESTRIAN:
        return np.zeros(len(e.time_s), dtype=np.bool_)
    reach = (e.width_m[0] + e.width_m[striker]) / 2 + CORRIDOR_M + NEAR_M
    near: Bools = e.known[:, striker] & (np.abs(seen.across_m) <= reach)
    near &= (seen.behind_m <= 0.0) & (seen.gap_m <= HORIZON_S * np.maximum(e.speed_mps[:, 0], SLOW_MPS))
    if ground.roadway:
        near &= inside(
            ground.roadway + ground.crossings, e.x_m[:, striker], e.y_m[:, striker], float(e.width_m[striker]) / 2
        )
    return near


def _aware_from(near: Bools, conflict: int) -> int:
    """Finds since when the ego saw the striker near its way."""
    elsewhere = np.flatnonzero(~near[:conflict])
    return int(elsewhere[-1]) + 1 if len(elsewhere) else 0


def _gained(speed: Floats, responds: int) -> float:
    """Computes the largest gain of speed from a frame on."""
    after = speed[responds:]
    return float((after - np.minimum.accumulate(after)).max()) if len(after) else 0.0


def _started(evidence: Evidence, striker: int, conflict: Conflict, near: Bools) -> bool:
    """Tells whether the ego drove on despite the striker in its way.

    It did so if it stood or braked within the last 4 s and then sped up.

    That is in its way or beside it. A crossing vehicle is there once it is in the junction, whether it moves or stands.
    """
    e = evidence
    first = e.since(HORIZON_S)
    speed, braked = e.speed_mps[first:, 0], e.accel_mps2[first:, 0] <= -BRAKES_MPS2
    there = near[first:] | (np.arange(first, len(near)) >= conflict.frame)
    if conflict.type is ConflictType.CROSSING:
        there |= inside(e.ground.junctions, e.x_m[first:, striker], e.y_m[first:, striker], BODY_M)
    there &= e.known[first:, striker]
    rises = np.maximum.accumulate(speed[::-1])[::-1] - speed  # of its speed, until the contact
    stood = (speed < STANDING_MPS) & (rises >= STANDING_MPS)
    slowed = np.logical_or.accumulate(braked & there) & (rises >= GAINS_MPS)
    return bool((there & (stood | slowed)).any())


def _sight_speed(sighted: int, seen: BodyOnPath[Floats]) -> float | None:
    """Computes the speed from which the ego could have stopped in time.

    It would have stopped before the place where the striker came into view.

    It would respond within R157's 0.75 s and brake with 3.4 m/s². None if the striker was in view all along, or was not
    ahead.
    """
    room = float(seen.gap_m[sighted])
    if sighted == 0 or room <= 0.0:
        return None
    lost = YIELDING_MPS2 * R157_DELAY_S
    return math.sqrt(lost * lost + 2 * YIELDING_MPS2 * room) - lost


YIELDS = frozenset({"red_light", "priority", "pedestrian_on_red", "wrong_direction"})  # its breaker has to yield
LATE_S = 0.5  # after which an answer comes later than R157's driver gives it
HARD = 0.8  # of the braking that car and road allow
CROSSINGS = ("crossing", "beside_crossing")
GREEN = b"Gg"


class Parts(NamedTuple):
    """Behaviour of both parties that the fault depends on."""

    other_broke: bool = False  # the other broke a rule of the road
    drove_into: bool = False  # the ego drove on into a road user that it saw in its way
    ego_erred: bool = False
    other_yields: bool = False  # the other had to yield
    ego_yields: bool = False  # the ego had to yield, or to keep its distance
    left_rss: bool = False  # the ego left RSS's proper response first, and did not brake at once either


def fault(parts: Parts) -> Fault:
    """Applies the rule; its first line that holds decides."""
    if parts.drove_into and not parts.other_broke:
        return Fault.EGO
    if parts.other_broke or parts.other_yields:
        return Fault.SHARED if parts.ego_erred else Fault.OTHER
    return Fault.EGO if parts.ego_erred or parts.ego_yields or parts.left_rss else Fault.OTHER


def came_first(evidence: Evidence, striker: int) -> bool:
    """Tells whether a vehicle was in the junction before the ego's green.

    The ego, which enters on that green, has to yield to one that entered lawfully.

    Source: North Dakota pattern jury instructions, traffic control signals: traffic on green "must yield the
    right-of-way to other vehicles [...] lawfully within the intersection [...] at the time the signal is exhibited".
    """
    e = evidence
    here = [area for area in e.ground.junctions if inside((area,), e.x_m[-1:, striker], e.y_m[-1:, striker])[0]]
    entered = entry(e, EGO, GREEN)
    if entered is None or not here:
        return False
    stopped = np.flatnonzero(np.isin(e.link[:entered, EGO], list(STOPS)))
    return bool(len(stopped) and inside(here, *front_of(e, int(stopped[-1]) + 1, striker))[0])


def has_to_yield(
    conflict_type: ConflictType, ground: str, broke: Collection[str], ego_broke: Collection[str], *, first: bool = False
) -> str | None:
    """Names which had to yield: ego, striker, or None if unclear.

    A follower has to, and one that comes over; at a crossing the ego, unless the pedestrian came on red, and beside it
    the pedestrian. Between vehicles whose ways cross their offences tell, and `first`: whether the striker was in the
    junction before the ego's signal turned green.
    """
    if not YIELDS.isdisjoint(broke):
        return "striker"
    if not YIELDS.isdisjoint(ego_broke) or conflict_type in (ConflictType.LEADER, ConflictType.MERGE):
        return "ego"
    if first and conflict_type is ConflictType.CROSSING:
        return "ego"
    if conflict_type is ConflictType.PEDESTRIAN:
        return "ego" if ground in CROSSINGS else "striker"
    return None


def parts_of_contact(
    part: EgoPart,
    conflict_type: ConflictType,
    *,
    yields: str | None,
    broke: Collection[str],
    ego_broke: Collection[str],
    avoids: Mapping[str, bool],
    grade: Grade,
    lasted_s: float,
    contact_x_m: float,
) -> Parts:
    """Sums up a contact.

    A crossing vehicle that runs into the ego behind its front half is the ego's fault only if the ego had to yield.

    Args:
      part: what the ego did about the striker.
      conflict_type: how it came into the ego's way.
      yields: which had to yield, see `has_to_yield`.
      broke: what the striker broke.
      ego_broke: what the ego broke.
      avoids: reference driver → whether it avoids the contact.
      grade: of the contact.
      lasted_s: from the beginning of the conflict to the contact.
      contact_x_m: of the contact point ahead of the ego's centre.
    """
    other_broke, other_yields = bool(broke), yields == "striker"
    if conflict_type is ConflictType.CROSSING and contact_x_m < 0.0 and yields != "ego":
        return Parts(other_broke=other_broke, other_yields=other_yields)
    walks, crosses = (conflict_type is each for each in (ConflictType.PEDESTRIAN, ConflictType.CROSSING))
    braked_after_s = math.inf if part.braked_after_s is None else part.braked_after_s
    return Parts(
        other_broke=other_broke,
        other_yields=other_yields,
        drove_into=(walks and part.sped_up) or ((walks or crosses) and part.started),
        ego_erred=bool(ego_broke)
        or conflict_type is ConflictType.MERGE
        or part.sped_up
        or part.started
        or min(braked_after_s, lasted_s) >= RESPONDS_S + LATE_S
        or any(avoids.get(name, False) for name in PUBLISHED)
        or (part.too_fast and grade is Grade.PREVENTABLE and YIELDS.isdisjoint(broke)),
        ego_yields=yields == "ego",
        left_rss=part.left_first == "ego"
        and not (braked_after_s <= RESPONDS_S and part.braking_mps2 >= HARD * part.possible_mps2),
    )


def parts_of_violation(
    *, own: bool, yields: str | None, other_broke: Collection[str], broke: Collection[str], grade: Grade
) -> Parts:
    """Sums up a violation without contact.

    `own`: the requirement speaks of the ego's own driving only, or nothing was in its way; `yields`: `has_to_yield`.
    """
    if own:
        return Parts(ego_erred=grade is Grade.PREVENTABLE)
    return Parts(
        ego_erred=bool(broke) or grade is Grade.PREVENTABLE, other_broke=bool(other_broke), ego_yields=yields == "ego"
    )
