"""STL requirements that an ODD implies for the ego, and their signals.

Signals are published once per frame. All are finite: a quantity with nothing to measure takes its cap.

Source: RISK-SAC, Sec. II-A.
"""

from dataclasses import dataclass

from risk_sac.config import Odd, Requirement
from risk_sac.records import NO_CONTACT
from risk_sac.scenario.limits import GRAVITY_MPS2

MIN_TTC_S = 1.5  # below it a conflict counts as serious in traffic conflict studies
UNDISTURBED_ENCOUNTER_S = 4.25  # what the signal encounter_s says in undisturbed traffic
CONTACT_SCALE_M = 10.0
PEDESTRIAN_GAP_M = 0.5  # what a driver leaves beside a pedestrian at walking pace, at the very least,
PEDESTRIAN_GAP_PER_MPS = 0.1  # and so much more for each m/s: 1.9 m at 50 km/h
PEDESTRIAN_SCALE_M = 11.0
STANDING_MPS = 0.5  # slower than that, an ego counts as standing,
STANDING_M = 10.0  # which is worth as much as this gap
EMERGENCY_BRAKING_MPS2 = 9.0  # of SUMO's default passenger car, on dry asphalt
RED_LIGHT_SCALE = 0.8  # of the grip, and so 1.25 without braking and about 0.5 with gentle braking
RED_LIGHT_HOLD_S = 1.0
CARRIAGEWAY_SCALE_M = 2.0  # a car reaches 1.65 m into a road of one lane, and 2.6 m or more into a wider one
BRAKING_HOLD_S = 0.5  # braking shorter than that is a correction, not an emergency stop

# Names of all that `requirements_from_odd` makes of one ODD or another.
SHIPPED_REQUIREMENTS = (
    NO_CONTACT,
    "on_carriageway",
    "safe_ttc",
    "rss_margin",
    "pedestrian_gap",
    "no_red_light_entry",
    "bounded_braking",
)


def requirements_from_odd(odd: Odd, response_s: float) -> tuple[Requirement, ...]:
    """Derives the ego's STL requirements, with their thresholds, from an ODD.

    Contacts and entering on red make an episode a failure; the others are reported, unless a user lets them count.

    Choice: each scale is what undisturbed traffic leaves, so that its robustness is about 1 there and falls without
    a clip as danger grows; else the one with the smallest scale would be the soft minimum whatever happens.

    - Contact: the bodies do not touch. It is no part of φ, since TTC, RSS and gaps lead up to it.
    - TTC: a second of margin after the ego's response time, and never under MIN_TTC_S. It is asked of the time to
      encounter, in which near misses count: the bare TTC is flat at its cap until a collision course begins, and then
      jumps.
    - RSS: the signal is scaled already, and is negative where the situation is dangerous.
    - Pedestrians: a minimum gap that grows with the ego's speed; a standing ego has the margin of a gap of STANDING_M.
    - Red light: the braking that it takes to stop at the line must be within what the car, or the worst friction of
      the ODD, friction · g, can give; the step that crosses the line on red is far beyond it. That is held for
      RED_LIGHT_HOLD_S, not for good, or it would stay the worst margin of the episode.
    - Carriageway: a part of the ego's body is on the carriageway of its own direction. That falls from the moment when
      the ego begins to leave it.
    - Braking: BRAKING_HOLD_S on end at nine tenths of what car and road can give means that the ego had no reserve
      left. It is flat until then, and so no part of φ.

    Args:
      odd: complete, as `intersect` returns it; pedestrians and red light count where it has them.
      response_s: within which the ego responds.

    Source: Hayward 1972 for TTC; the scales are medians over undisturbed episodes.
    """
    ttc_s = max(MIN_TTC_S, response_s + 1.0)
    ttc_scale_s = max(UNDISTURBED_ENCOUNTER_S - ttc_s, 1.0)
    friction = odd.environment.friction
    grip_mps2 = EMERGENCY_BRAKING_MPS2 if friction is None else friction.low * GRAVITY_MPS2
    grip_mps2 = round(min(grip_mps2, EMERGENCY_BRAKING_MPS2), 2)
    apart = "vehicle_gap_m > 0 and pedestrian_gap_m > 0"
    requirements = [
        Requirement(name=NO_CONTACT, formula=apart, scale=CONTACT_SCALE_M, shapes=False),
        Requirement(name="on_carriageway", formula="carriageway_m >= 0", scale=CARRIAGEWAY_SCALE_M),
        Requirement(name="safe_ttc", formula=f"encounter_s >= {ttc_s:g}", scale=ttc_scale_s, counts="report"),
        Requirement(name="rss_margin", formula="rss_margin >= 0", scale=1.0, counts="report"),
    ]
    if "pedestrian" in (odd.dynamic.actor_kinds or ()):
        moving = f"pedestrian_gap_m >= {PEDESTRIAN_GAP_M:g} + {PEDESTRIAN_GAP_PER_MPS:g} * ego_speed_mps"
        standing = f"{STANDING_M / STANDING_MPS:g} * ego_speed_mps <= {STANDING_M:g}"
        formula = f"{moving} or {standing}"
        requirements.append(
            Requirement(name="pedestrian_gap", formula=formula, scale=PEDESTRIAN_SCALE_M, counts="report")
        )
    if set(odd.scenery.signal_types or ()) - {"none"}:
        formula = f"historically[0,{RED_LIGHT_HOLD_S:g}] (red_light_braking_mps2 <= {grip_mps2:g})"
        scale = round(RED_LIGHT_SCALE * grip_mps2, 2)
        requirements.append(Requirement(name="no_red_light_entry", formula=formula, scale=scale))
    braking_mps2 = round(0.9 * grip_mps2, 2)
    formula = f"not historically[0,{BRAKING_HOLD_S:g}] (ego_braking_mps2 >= {braking_mps2:g})"
    requirements.append(
        Requirement(name="bounded_braking", formula=formula, scale=braking_mps2, shapes=False, counts="report")
    )
    return tuple(requirements)


@dataclass(frozen=True, slots=True)
class SignalInfo:
    """Unit, range and meaning of one published signal."""

    unit: str
    low: float
    high: float
    meaning: str


SIGNALS: dict[str, SignalInfo] = {
    "ttc_s": SignalInfo("s", 0.0, 10.0, "smallest time to collision of the ego with any actor"),
    "encounter_s": SignalInfo(
        "s",
        0.0,
        8.0,
        "smallest time to encounter of the ego with any actor: a time to collision in which a near miss counts as the "
        "time that unforeseen motion takes to close the gap; it falls steadily before a contact",
    ),
    "rss_margin": SignalInfo(
        "1",
        -3.0,
        2.0,
        "smallest RSS margin to any actor, about 1 in undisturbed traffic: of the longitudinal and the lateral margin, "
        "each in its scale, the larger; negative where the situation is dangerous",
    ),
    "pedestrian_gap_m": SignalInfo("m", 0.0, 30.0, "distance from the ego's body to the nearest pedestrian"),
    "vehicle_gap_m": SignalInfo("m", 0.0, 50.0, "distance from the ego's body to the nearest vehicle"),
    "red_light_m": SignalInfo(
        "m", -5.0, 50.0, "distance to the stop line while its signal is red; negative once it was crossed on red"
    ),
    "red_light_braking_mps2": SignalInfo(
        "m/s²",
        0.0,
        12.0,
        "braking that stops the ego at a red signal's line; 12 once it was crossed on red, 0 without one",
    ),
    "ego_speed_mps": SignalInfo("m/s", 0.0, 60.0, "speed of the ego"),
    "ego_braking_mps2": SignalInfo("m/s²", 0.0, 12.0, "deceleration of the ego; 0 while it accelerates"),
    "ego_jerk_mps3": SignalInfo("m/s³", 0.0, 60.0, "size of the ego's jerk: its change of acceleration over 0.3 s"),
    "ego_lateral_accel_mps2": SignalInfo(
        "m/s²", 0.0, 20.0, "size of the ego's lateral acceleration: its speed times its change of heading over 0.3 s"
    ),
    "lane_offset_m": SignalInfo(
        "m", 0.0, 10.0, "distance of the ego's centre from the middle of the nearest lane of its direction"
    ),
    "over_limit_mps": SignalInfo(
        "m/s", -60.0, 60.0, "speed of the ego above the limit of the lane where it is; negative below the limit"
    ),
    "edge_m": SignalInfo(
        "m",
        -10.0,
        5.0,
        "smallest distance from the ego's body to the edge of the carriageway of its direction; negative by how far a "
        "part of its body is beyond. Oncoming lanes count only while it overtakes",
    ),
    "carriageway_m": SignalInfo(
        "m",
        -10.0,
        3.0,
        "how deep the ego's body reaches into the carriageway of its direction: positive while a part of it is on it, "
        "else the gap to it, negative. Oncoming lanes count only while it overtakes",
    ),
    "headway_s": SignalInfo(
        "s", 0.0, 10.0, "time gap from the ego's front to the vehicle that it follows, along the arc that it drives"
    ),
}
