"""An ego and an ODD in words."""

import math
from collections.abc import Iterator, Mapping

from risk_sac.config import EgoConfig, Interval, Odd
from risk_sac.scenario.family import Family
from risk_sac.scenario.odd import field, intersect, paths

PROFILES = {
    "default": "SUMO's driver with a delay and a line of sight",
    "perfect": "SUMO's driver, which reacts at once and sees everything",
    "careful": "the default with the braking of R157's driver on top",
    "defensive": "the default held back by the defensive reference driver",
}
# Field of the ODD → what it is called, and its unit.
FIELDS: Mapping[str, tuple[str, str]] = {
    "scenery.lanes": ("lanes of the ego's road, per direction", ""),
    "scenery.speed_limit_mps": ("posted limit", "m/s"),
    "scenery.signal_types": ("traffic signals", ""),
    "scenery.crossing_types": ("pedestrian crossings", ""),
    "environment.friction": ("friction between tyre and road", ""),
    "environment.visibility_m": ("visibility", "m"),
    "environment.precipitation": ("precipitation", ""),
    "environment.time_of_day": ("time of day", ""),
    "dynamic.actor_kinds": ("who is there beside the ego", ""),
    "dynamic.ego_speed_mps": ("the ego's speed at the start", "m/s"),
    "dynamic.vehicle_speed_mps": ("speed of other vehicles", "m/s"),
    "dynamic.vehicle_accel_mps2": ("acceleration of other vehicles", "m/s²"),
    "dynamic.vehicle_lateral_speed_mps": ("speed of other vehicles across their lane, to either side", "m/s"),
    "dynamic.vehicle_lateral_accel_mps2": ("acceleration of other vehicles across their lane, to either side", "m/s²"),
    "dynamic.pedestrian_speed_mps": ("speed of pedestrians", "m/s"),
    "dynamic.pedestrian_accel_mps2": ("acceleration of pedestrians", "m/s²"),
}


def ego_in_words(ego: EgoConfig) -> str:
    """Describes the ego's driver, its response time and its sight."""
    if ego.driver is not None:
        parts = [f"registered driver {ego.driver}", f"responds within {ego.response_s:g} s"]
    else:
        parts = [
            f"profile {ego.profile} ({PROFILES[ego.profile]})",
            f"car-following model {ego.car_following}",
            f"decides every {ego.reaction_time_s:g} s",
        ]
    planted = [f"with the planted defects {' and '.join(ego.defects)}"] if ego.defects else []
    return ", ".join([*parts, *_sight(ego), *planted])


def _sight(ego: EgoConfig) -> Iterator[str]:
    """Describes the ego's sensor."""
    if ego.sensor is None:
        yield "sees everything"
        return
    degrees = math.degrees(ego.sensor.field_of_view_rad)
    yield f"sees {ego.sensor.range_m:g} m far over {degrees:.0f}°"
    yield "not through vehicles" if ego.sensor.occlusion else "through vehicles too"
    yield f"extrapolates an actor that is out of sight for {ego.sensor.memory_s:g} s"


def odd_in_words(family: Family, odd: Odd) -> Iterator[tuple[str, str]]:
    """The fields of the ODD that a family and a campaign allow together, and what each allows."""
    whole = intersect(family.odd, odd)
    for path in paths(whole):
        words, unit = FIELDS.get(path, (path, ""))
        yield words, _allowed(field(whole, path), unit)


def _allowed(value: object, unit: str) -> str:
    if isinstance(value, Interval):
        text = f"{value.low:g}" if value.low == value.high else f"{value.low:g} to {value.high:g}"
        return f"{text} {unit}".strip()
    if isinstance(value, tuple):
        return ", ".join(str(each).replace("_", " ") for each in value)
    return "anything" if value is None else str(value)
