"""Weather and light of an ODD: what they do to scenes and to the ego's sight.

| field | rule |
|---|---|
| `friction` | each scene has one value |
| `visibility_m` | where a user's ODD states it, each scene has one value; the ego sees nothing beyond it |
| `precipitation` | bounds the friction, by the water on the road |
| `time_of_day` | at night the ego sees pedestrians within LOW_BEAM_M only; where both are stated, a scene has one |

Choice: rain does not shorten the sight. Rain of 50 mm/h attenuates light by 14.8 dB/km, which leaves a visibility of
880 m, far beyond usual sensors; spray and drops on a lens are stated as `visibility_m`.

Source: Bosch Automotive Handbook, tyre grip at 50 km/h, with new and with worn tyres, for friction; ITU-R P.1814
(k = 1.076, α = 0.67) for the attenuation, WMO-No. 8 for visibility as the distance that 5 % of the light passes;
Vienna Convention on Road Traffic (1968), Annex 5: passing lamps light the road for at least 40 m. Drivers recognise
pedestrians in dark clothes later still (Wood, Tyrrell and Carberry 2005).
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from risk_sac.config import Interval, Odd, Precipitation
from risk_sac.scenario.space import Parameter, SceneSpace

WET_FRICTION: Mapping[Precipitation, Interval] = {
    "rain": Interval(low=0.5, high=0.65),  # 0.2 mm of water: up to 7.6 mm/h
    "heavy_rain": Interval(low=0.4, high=0.55),  # 1 mm of water: up to 50 mm/h
}
LOW_BEAM_M = 40.0
VISIBILITY, NIGHT = "visibility_m", "night"
"""Scene parameters of an ODD that states the visibility, or day and night."""


class Conditions(NamedTuple):
    """Visibility in an episode, which bounds every sensor."""

    visibility_m: float
    unlit_m: float  # the same of a body without lights


def with_environment(space: SceneSpace, user: Odd, odd: Odd) -> SceneSpace:
    """Returns a family's space with the parameters that a user's environment adds or widens.

    Args:
      space: of the family.
      user: as the user stated it; the ego is no part of the rule, so that another ego can play the same scenes.
      odd: the user's and the family's together.
    """
    environment, parameters = odd.environment, list(space.parameters)
    for index, parameter in enumerate(parameters):
        if parameter.odd == "environment.friction" and environment.friction is not None:
            low, high = environment.friction.low, environment.friction.high
            parameters[index] = replace(parameter, low=low, high=high)
    visibility = environment.visibility_m
    if user.environment.visibility_m is not None and visibility is not None:
        meaning = "meteorological visibility, beyond which the ego sees nothing"
        parameters.append(
            Parameter(VISIBILITY, "m", visibility.low, visibility.high, meaning, "environment.visibility_m")
        )
    if environment.time_of_day == ("day", "night"):
        meaning, times = "day below 0.5, night from 0.5", ("day", "night")
        parameters.append(Parameter(NIGHT, "1", 0, 1, meaning, "environment.time_of_day", times))
    return replace(space, parameters=tuple(parameters))


def conditions(odd: Odd, scene: Mapping[str, float], *, sensor: bool) -> Conditions:
    """Returns how far can be seen in a scene of a complete ODD.

    Where the user's ODD does not state the visibility, the default's low end bounds a sensor; an ego without a sensor
    then sees everything.
    """
    usual = odd.environment.visibility_m
    usual_m = usual.low if sensor and usual is not None else math.inf
    night = scene[NIGHT] >= 0.5 if NIGHT in scene else odd.environment.time_of_day == ("night",)
    return Conditions(scene.get(VISIBILITY, usual_m), LOW_BEAM_M if night else math.inf)
