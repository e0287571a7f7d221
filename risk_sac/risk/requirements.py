"""STL requirements that an ODD implies for the ego.

Source: RISK-SAC, Sec. II-A.
"""

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
