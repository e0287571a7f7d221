"""Kinematic limits and visibility, as ODD and road surface allow."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, get_args

from risk_sac.config import Behaviour, DynamicElements, Interval, Odd, Precipitation
from risk_sac.scenario.bodies import Body
from risk_sac.scenario.space import Parameter, SceneSpace


class PresetBounds(NamedTuple):
    """Bounds of an `odd.dynamic` field under each behaviour, with source."""

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


GRAVITY_MPS2 = 9.81
EMERGENCY_DECEL_MPS2 = 9.0  # SUMO's default for passenger cars
FIRM_BRAKING_MPS2 = 8.0  # that an adversary expects of others, as under emergency behaviour
HEADROOM = 0.95  # share of the friction circle that is used; the rest is for what a step of 0.1 s cannot resolve
CORNERING = 0.6  # of the circle, for the curve of the lane: drivers leave more, but brake in curves
CHANGING_LANE = 0.3  # of the circle at most, for moving across the lane; at least 0.43 are left for braking
SLIP = 0.2  # lateral over longitudinal speed: about 11 degrees against the lane


# Field of `Limits` → field of `odd.dynamic`, and which end of its range.
PRESETS: Mapping[str, tuple[str, int]] = {
    "accel_mps2": ("vehicle_accel_mps2", 1),
    "brake_mps2": ("vehicle_accel_mps2", 0),
    "walk_speed_mps": ("pedestrian_speed_mps", 1),
    "walk_accel_mps2": ("pedestrian_accel_mps2", 1),
    "walk_brake_mps2": ("pedestrian_accel_mps2", 0),
    "heading_rate_radps": ("pedestrian_turn_radps", 1),
}


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bounds that hold at every step; all positive."""

    # vehicles
    speed_mps: float
    accel_mps2: float
    brake_mps2: float
    grip_mps2: float  # of the longitudinal and the lateral acceleration together, cornering included
    jerk_mps3: float
    lateral_mps: float
    lateral_accel_mps2: float
    curvature_per_m: float = 0.2  # of a car that turns as tightly as it can
    # pedestrians
    walk_speed_mps: float
    walk_accel_mps2: float
    walk_brake_mps2: float
    walk_jerk_mps3: float = 5.0  # from rest to full acceleration in 0.3 s
    heading_rate_radps: float  # standing
    walk_curvature_per_m: float = math.inf  # of a body on wheels, which turns on the move alone
    behaviour: Behaviour = "ordinary"

    def of(self, body: Body) -> "Limits":
        """Returns a body's limits: its row's, narrowed as the ODD narrows presets."""
        own = {name: getattr(bound, self.behaviour) * self._narrowed(name) for name, bound in body.limits.items()}
        if "speed_mps" in own:
            own["speed_mps"] = min(own["speed_mps"], self.speed_mps)
        for name in own.keys() & {"accel_mps2", "brake_mps2"}:
            own[name] = min(own[name], self.grip_mps2)
        return replace(self, **own) if own else self

    def _narrowed(self, name: str) -> float:
        if name not in PRESETS:
            return 1.0
        field, end = PRESETS[name]
        preset = abs(float(getattr(BOUNDS[field], self.behaviour)[end]))
        return min(float(getattr(self, name)) / preset, 1.0)

    @cached_property
    def walk_disc_mps2(self) -> float:
        """Acceleration of a pedestrian along and across its heading together."""
        return max(self.walk_accel_mps2, self.walk_brake_mps2)

    @cached_property
    def cornering_mps2(self) -> float:
        """Lateral acceleration that is planned for in a curve."""
        return CORNERING * self.grip_mps2

    @cached_property
    def approach_mps2(self) -> float:
        """Computes the braking left for a lane change in a planned curve."""
        lateral = self.cornering_mps2 + self.lateral_accel_mps2
        return min(self.brake_mps2, math.sqrt(self.grip_mps2**2 - lateral**2))

    @cached_property
    def others_brake_mps2(self) -> float:
        """Hardest braking expected of others, whose limits may be wider."""
        return max(self.brake_mps2, min(FIRM_BRAKING_MPS2, self.grip_mps2))

    @cached_property
    def slip(self) -> float:
        """Largest lateral speed as a share of longitudinal, bounded for hard braking."""
        return min(SLIP, self.lateral_accel_mps2 / self.brake_mps2)


def limits_from_odd(odd: Odd, friction: float) -> Limits:
    """Returns a complete ODD's bounds, vehicle acceleration at most friction · g."""
    dynamic = odd.dynamic
    accel, jerk = dynamic.vehicle_accel_mps2, dynamic.vehicle_jerk_mps3
    lateral, lateral_accel = dynamic.vehicle_lateral_speed_mps, dynamic.vehicle_lateral_accel_mps2
    walk, walk_accel, turn = (
        dynamic.pedestrian_speed_mps,
        dynamic.pedestrian_accel_mps2,
        dynamic.pedestrian_turn_radps,
    )
    speed = dynamic.vehicle_speed_mps
    if not (speed and accel and jerk and lateral and lateral_accel and walk and walk_accel and turn):
        raise ValueError("the ODD is incomplete; intersect it with a family's default first")
    grip = HEADROOM * friction * GRAVITY_MPS2
    return Limits(
        speed_mps=speed.high,
        accel_mps2=min(accel.high, grip),
        brake_mps2=min(-accel.low, grip),
        grip_mps2=grip,
        jerk_mps3=jerk.high,
        lateral_mps=lateral.high,
        lateral_accel_mps2=min(lateral_accel.high, CHANGING_LANE * grip),
        walk_speed_mps=walk.high,
        walk_accel_mps2=walk_accel.high,
        walk_brake_mps2=-walk_accel.low,
        heading_rate_radps=turn.high,
        behaviour=dynamic.behaviour,
    )


def emergency_decel_mps2(friction: float) -> float:
    """Computes a car's hardest braking on a road of this friction."""
    return min(EMERGENCY_DECEL_MPS2, friction * GRAVITY_MPS2)


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
    """Adds or widens parameters of a family's space by a user's environment.

    The ego is no part of the rule, so that another ego can play the same scenes. `odd` is the user's and the family's.
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
    """Returns how far can be seen in a complete ODD's scene.

    Where the user's ODD does not state the visibility, the default's low end bounds a sensor; an ego without a sensor
    then sees everything.
    """
    usual = odd.environment.visibility_m
    usual_m = usual.low if sensor and usual is not None else math.inf
    night = scene[NIGHT] >= 0.5 if NIGHT in scene else odd.environment.time_of_day == ("night",)
    return Conditions(scene.get(VISIBILITY, usual_m), LOW_BEAM_M if night else math.inf)
