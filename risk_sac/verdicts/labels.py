"""Severity of a contact: injury risk at its impact speed, and class.

The impact speed is taken along the normal of the contact, so that bodies that slide along each other hardly collide.
Between vehicles, and with riders, it is the speed at which they close; a pedestrian is struck with the vehicle's own
speed. The row of the struck body in `risk_sac.scenario.bodies` names its curve.

All curves are logistic, P = 1 / (1 + exp(a - b v)). They hold for a population, not for the one contact, and none knows
where the body was struck.

Sources:
  Pedestrians: Rosén and Sander 2009, "Pedestrian fatality risk as a function of car impact speed", Accident Analysis
    and Prevention 41, 536-542. Fatality by impact speed in km/h; fitted to 490 pedestrians of 15 years and older (36
    died) that the front of a car struck, GIDAS 1999-2007, weighted by German statistics.
  Occupants: Wang 2022, "MAIS(05/08) injury probability curves as functions of delta V", NHTSA DOT HS 813 219. Injury of
    MAIS 3 or more by delta-v in miles/h, all crashes; fitted to occupants of towed cars, NASS-CDS 2010-2015.
  Cyclists: Nie, Li and Yang, "A study of fatality risk and head dynamic response of cyclist and pedestrian based on
    passenger car accident data analysis and simulations", Traffic Injury Prevention. Fatality by impact speed in km/h,
    with the coefficients that PDM-FRAZZOLI/dg-commons gives for it; the paper itself was not at hand.
  Motorcyclists: Lubbe, Wu and Jeppsson 2022, "Safe speeds: fatality and injury risks of pedestrians, cyclists,
    motorcyclists, and car drivers impacting the front of another passenger car as a function of closing speed and age",
    Traffic Safety Research. Injury of MAIS 3 or more: 10 % at a closing speed of 48 km/h. The slope is choice, that of
    the pedestrians' curve.
"""

import math
from typing import NamedTuple

import numpy as np

from risk_sac.records import ConflictType, Severity
from risk_sac.records.judgement import Harm
from risk_sac.scenario.bodies import body_of
from risk_sac.sim.collision import Contact
from risk_sac.verdicts.conflict import BRAKES_MPS2, Conflict
from risk_sac.verdicts.drivers import R157_DELAY_S, R157_PERCEIVES_S
from risk_sac.verdicts.evidence import Evidence, front_moved_across, inside
from risk_sac.verdicts.offences import IN_WORDS, RECENT_S, STANDING_MPS
from risk_sac.verdicts.reference import NO_RED_LIGHT_ENTRY, ON_CARRIAGEWAY
from risk_sac.world.types import Kind, Role

KMH = 3.6  # in 1 m/s
MILES_PER_H = 3.6 / 1.609344
FATALITY = (6.9, 0.090)
MAIS3 = (6.9540, 0.1637)
CYCLIST_FATALITY = (6.929, 0.095)
MOTORCYCLIST_MAIS3 = (math.log(9.0) + 0.090 * 48.0, 0.090)
MINOR_MPS = 2.0
# Choice: one in a hundred. It is reached by a pedestrian at 26 km/h, a car struck by a car at an impact speed of
# 46 km/h, and one struck by a truck at 28 km/h.
SEVERE_RISK = 0.01


def fatality_risk(impact_mps: float) -> float:
    """Returns a pedestrian's risk of death for an impact speed."""
    return _logistic(FATALITY, impact_mps * KMH)


def serious_injury_risk(delta_v_mps: float) -> float:
    """Computes an occupant's risk of MAIS 3 or more for a delta-v."""
    return _logistic(MAIS3, delta_v_mps * MILES_PER_H)


class Impact(NamedTuple):
    """Impact speed of a contact, risk of injury and kind of harm."""

    speed_mps: float
    risk: float
    harm: Harm


def delta_v_mps(closing_mps: float, own_kg: float, other_kg: float) -> float:
    """Returns a body's change of velocity if both move on together."""
    return closing_mps * other_kg / (own_kg + other_kg)


def severity(impact_mps: float, risk: float) -> Severity:
    """Returns the class of a contact."""
    if risk >= SEVERE_RISK:
        return Severity.SEVERE
    return Severity.MINOR if impact_mps < MINOR_MPS else Severity.MODERATE


def impact(evidence: Evidence, striker: int, contact: Contact) -> Impact:
    """Computes a contact's impact; between vehicles for the worse-off occupants."""
    ego, other = (body_of(int(evidence.body[actor])) for actor in (0, striker))
    closing_mps = max(0.0, contact.closing_normal_mps)
    match other.injury:
        case "pedestrian":
            own_mps = max(0.0, contact.closing_normal_ego_mps)
            return Impact(own_mps, fatality_risk(own_mps), "death")
        case "cyclist":
            return Impact(closing_mps, _logistic(CYCLIST_FATALITY, closing_mps * KMH), "death")
        case "motorcyclist":
            return Impact(closing_mps, _logistic(MOTORCYCLIST_MAIS3, closing_mps * KMH), "serious injury")
        case "occupant":
            light_kg, heavy_kg = sorted((ego.mass_kg, other.mass_kg))
            worse_off_mps = delta_v_mps(closing_mps, light_kg, heavy_kg)
            return Impact(closing_mps, serious_injury_risk(worse_off_mps), "serious injury")


def _logistic(curve: tuple[float, float], speed: float) -> float:
    a, b = curve
    return 1.0 / (1.0 + math.exp(a - b * speed))


RESPONSE_S = 1.0  # before the contact: what the ego does then is its response
SPEEDS_UP_MPS2 = 1.5  # more than Krauss's drivers dawdle with, as `BRAKES_MPS2`
BESIDE_M = 3.0  # a pedestrian this near to a crossing means to use it
RECENT_M = 12.0  # a quarter of a circle of 8 m: an ego that creeps through its turn is turning
TURN_RAD = math.radians(20.0)  # more than a lane change takes
LANE_CHANGE_M = 1.0


def ground(evidence: Evidence, striker: int) -> str:
    """Names the ground: lane or junction; for pedestrians also crossing or beside_crossing."""
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
    """Names what the ego did in the last second before contact.

    One of none, late_braking, braking, standing, starting and accelerating.
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


ONCOMING_COS = math.cos(math.radians(135.0))
FAST_MPS = 30 / 3.6  # Choice: where pedestrians begin to die; see `severity`
LATE_S = 2.0  # Choice: what R157's driver needs to be at full braking
STRIKERS = {ConflictType.LEADER: "leader", ConflictType.MERGE: "neighbour"}
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
    """Names the striker; its body too where the conflict type lacks it."""
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
