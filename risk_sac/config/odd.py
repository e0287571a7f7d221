"""Operational design domain as users write it, by ISO 34503's three branches.

Every field may be left out: a family's default ODD fills it. What an ODD does to the search is in
`risk_sac.scenario.odd`.
"""

from typing import Annotated, Literal

from pydantic import AfterValidator

from risk_sac.config.base import Interval, Settings

SignalType = Literal["none", "fixed_time"]
CrossingType = Literal["none", "zebra", "signalised"]
ActorKind = Literal["vehicle", "pedestrian"]
Precipitation = Literal["none", "rain", "heavy_rain"]
TimeOfDay = Literal["day", "night"]
Behaviour = Literal["ordinary", "emergency", "extreme"]


def _as_sorted_set(values: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted(set(values)))  # a frozenset has no stable JSON, and so no stable digest


SetOf = AfterValidator(_as_sorted_set)


class Scenery(Settings):
    """The road and what regulates it."""

    lanes: Interval | None = None
    """Lanes per direction on the ego's road."""
    speed_limit_mps: Interval | None = None
    """Posted limit, m/s."""
    signal_types: Annotated[tuple[SignalType, ...], SetOf] | None = None
    """Kinds of traffic signal the ego may meet."""
    crossing_types: Annotated[tuple[CrossingType, ...], SetOf] | None = None
    """Kinds of pedestrian crossing the ego may meet."""


class Environment(Settings):
    """Weather and light that act on an episode: see `risk_sac.scenario.limits`."""

    friction: Interval | None = None
    """Tyre-road friction coefficient, in (0, 1.2]; each scene has one value of it."""
    visibility_m: Interval | None = None
    """Meteorological visibility, m; where it is stated, each scene has one value, and the ego sees no farther."""
    precipitation: Annotated[tuple[Precipitation, ...], SetOf] | None = None
    """Rain wets the road: it bounds the friction. `rain` is up to 7.6 mm/h, `heavy_rain` up to 50 mm/h."""
    time_of_day: Annotated[tuple[TimeOfDay, ...], SetOf] | None = None
    """At night the ego sees a pedestrian within its low beam only; vehicles carry lights."""


class DynamicElements(Settings):
    """Other actors and the limits they keep."""

    behaviour: Behaviour = "ordinary"
    """Preset of the adversaries' limits below; a limit that is stated takes its place. `ordinary` is what people do in
    daily traffic, `emergency` what they do to avoid an accident, `extreme` what vehicles and persons can do at all."""

    actor_kinds: Annotated[tuple[ActorKind, ...], SetOf] | None = None
    """Kinds of actor that may be present."""
    ego_speed_mps: Interval | None = None
    """Initial speed of the ego, m/s."""
    vehicle_speed_mps: Interval | None = None
    """Speed of the adversary vehicles, m/s; the low end holds for their start, after which they may brake."""
    vehicle_accel_mps2: Interval | None = None
    """Longitudinal acceleration of the adversary vehicles, m/s²; low is the hardest braking."""
    vehicle_jerk_mps3: Interval | None = None
    """Change of the adversary vehicles' longitudinal acceleration, m/s³, up or down, from 0."""
    vehicle_lateral_speed_mps: Interval | None = None
    """Speed of the adversary vehicles across their lane, m/s, to either side, from 0."""
    vehicle_lateral_accel_mps2: Interval | None = None
    """Acceleration of the adversary vehicles across their lane, m/s², to either side, from 0, without the lane's own
    curve."""
    pedestrian_speed_mps: Interval | None = None
    """Speed of pedestrians, m/s; the low end holds for their start. A high above 2 lets them run."""
    pedestrian_accel_mps2: Interval | None = None
    """Acceleration of pedestrians, m/s², along their heading; the larger end also bounds it in any direction."""
    pedestrian_turn_radps: Interval | None = None
    """Rate at which standing pedestrians turn, rad/s, to either side, from 0; walking, they turn more slowly."""


class Odd(Settings):
    """Operational design domain (ISO 34503)."""

    scenery: Scenery = Scenery()
    environment: Environment = Environment()
    dynamic: DynamicElements = DynamicElements()
