"""Presets of the adversaries' limits: what each behaviour allows, and why.

`ordinary` bounds what drivers and pedestrians do in daily traffic, `emergency` what they do to avoid an accident,
`extreme` what vehicles and persons can do at all. Each contains the one before it.
"""

from collections.abc import Mapping
from typing import NamedTuple, get_args

from risk_sac.config import Behaviour, DynamicElements, Interval


class PresetBounds(NamedTuple):
    """Bounds of one field of `odd.dynamic` under each behaviour, and where they come from."""

    ordinary: tuple[float, float]
    emergency: tuple[float, float]
    extreme: tuple[float, float]
    source: str


# Field → its bounds. Speeds, accelerations and rates are sizes that hold to either side.
BOUNDS: Mapping[str, PresetBounds] = {
    "vehicle_accel_mps2": PresetBounds(
        (-4.0, 2.0),
        (-8.0, 3.5),
        (-8.0, 3.5),
        "ordinary braking: between the 3.4 m/s² that AASHTO takes for comfortable and the 4.5 m/s² that most drivers "
        "exceed before an unexpected object (AASHTO, A Policy on Geometric Design, stopping sight distance); "
        "acceleration and emergency: choice",
    ),
    "vehicle_jerk_mps3": PresetBounds(
        (0.0, 10.0),
        (0.0, 20.0),
        (0.0, 20.0),
        "ordinary: the upper end of steady braking at 40 km/h (Sensors 2021, 21, 1427, Table 8); "
        "emergency: full braking builds up in 0.4 s, choice",
    ),
    "vehicle_lateral_speed_mps": PresetBounds(
        (0.0, 1.0),
        (0.0, 1.2),
        (0.0, 1.8),
        "ordinary: a lane of 3.5 m in about 4 s, which drivers take 5 to 6 s for (Toledo and Zohar 2007), choice; "
        "emergency: in 3 s, choice; extreme: UN R157, fastest cut-in of its reference scenarios",
    ),
    "vehicle_lateral_accel_mps2": PresetBounds(
        (0.0, 1.0),
        (0.0, 1.5),
        (0.0, 3.0),
        "ordinary: UN R79, lane changes of ACSF category C; emergency and extreme: choice",
    ),
    "pedestrian_speed_mps": PresetBounds(
        (0.0, 1.86),
        (0.0, 2.0),
        (0.0, 3.0),
        "ordinary: 1.34 m/s and two standard deviations of 0.26 m/s (Weidmann 1993); emergency: choice; "
        "extreme: running, choice",
    ),
    "pedestrian_accel_mps2": PresetBounds(
        (-1.0, 1.0),
        (-1.5, 1.5),
        (-1.5, 1.5),
        "choice: pedestrians start at a signal with 1.4 ± 0.9 m/s² on average (Fugger et al. 2001, SAE 2001-01-0896)",
    ),
    "pedestrian_turn_radps": PresetBounds(
        (0.0, 1.2),
        (0.0, 2.0),
        (0.0, 2.0),
        "choice: standing, a right angle in 1.3 s and 0.8 s; walking, the acceleration bounds it (arXiv 2506.15321)",
    ),
}


def preset(behaviour: Behaviour) -> dict[str, Interval]:
    """Returns the bounds of a behaviour, by field of `odd.dynamic`."""
    column = get_args(Behaviour).index(behaviour)
    return {field: Interval(low=bounds[column][0], high=bounds[column][1]) for field, bounds in BOUNDS.items()}


def behaving(default: DynamicElements, behaviour: Behaviour) -> DynamicElements:
    """Returns a family's default with the limits of a behaviour."""
    return default.model_copy(update={"behaviour": behaviour, **preset(behaviour)})
