"""Scenario families, and the code that all patterns share."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from risk_sac.config import (
    CrossingType,
    DynamicElements,
    Environment,
    FamilyName,
    Interval,
    JudgeConfig,
    Odd,
    Requirement,
    Scenery,
    SignalType,
)
from risk_sac.config.scenario import Like
from risk_sac.scenario.behaviour import preset
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.place import FixedSignal, Place
from risk_sac.scenario.space import Parameter, SceneSpace

EGO = "ego"
MOST_OVER_LIMIT = 1.2  # fastest vehicles, as a share of the limit; choice
WALK_OFFSET_M = 1.9  # of a pedestrian from the middle of its way, along the road, at most


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """One scenario family."""

    name: FamilyName
    summary: str
    space: SceneSpace
    odd: Odd  # complete: every field is set
    vehicles: tuple[str, ...]  # adversary vehicles, in the order of the action vector
    pedestrians: tuple[str, ...]  # adversary pedestrians, after the vehicles
    layout: Callable[[Mapping[str, float]], Layout]
    horizon_steps: int = 150  # of 0.1 s
    like: Like | None = None  # shipped family whose prior fits
    requirements: tuple[Requirement, ...] = ()  # of the scenario, beside the ODD's
    judge: JudgeConfig | None = None  # None: the campaign's
    mirrored: bool = False  # whether what is on the left at the pattern's shipped family is on the right, or vice versa

    @property
    def adversaries(self) -> tuple[str, ...]:
        """All adversaries in the order of the action vector, two entries each."""
        return self.vehicles + self.pedestrians


def friction() -> Parameter:
    """The parameter of the road's surface."""
    return Parameter("friction", "1", 0.6, 1.0, "tyre-road friction coefficient", "environment.friction")


def top_speed(limit_mps: float) -> float:
    """Computes the highest initial speed, the limit rounded down to 0.1 m/s."""
    return math.floor(limit_mps * 10 + 1e-9) / 10


def initial_speed(name: str, low: float, limit_mps: float, meaning: str) -> Parameter:
    """The parameter of a vehicle's initial speed, from `low`, or half the road's limit if that is lower."""
    odd = "dynamic.ego_speed_mps" if name.startswith("ego") else "dynamic.vehicle_speed_mps"
    high = top_speed(limit_mps)
    return Parameter(name, "m/s", at_most(low, high / 2), at_most(high, high), meaning, odd)


def walking(offset: str) -> tuple[Parameter, ...]:
    """The parameters of the pedestrian: along the road, from the kerb, and how fast."""
    return (
        Parameter("pedestrian_offset_m", "m", -WALK_OFFSET_M, WALK_OFFSET_M, offset),
        Parameter("pedestrian_setback_m", "m", 0.3, 5, "pedestrian's distance from the kerb"),
        Parameter("pedestrian_speed_mps", "m/s", 0, 2.0, "initial walking speed", "dynamic.pedestrian_speed_mps"),
    )


def offset_of(signal: FixedSignal | None) -> tuple[Parameter, ...]:
    """The parameter of where in its cycle the signal is, if there is one."""
    if signal is None:
        return ()
    meaning = "position in the signal's cycle at the start"
    return (Parameter("signal_offset_s", "s", 0, signal.cycle_s, meaning),)


def at_most(usual: float, room: float) -> float:
    """The usual bound, or what a place has room for, to a tenth."""
    return usual if usual <= room else math.floor(room * 10 + 1e-9) / 10


def road_odd(place: Place, signals: tuple[SignalType, ...], crossings: tuple[CrossingType, ...]) -> Odd:
    """A family's default ODD at a place."""
    lanes, limit_mps = (Interval(low=value, high=value) for value in (place.lanes, place.speed_limit_mps))
    return usual_odd(lanes, limit_mps, signals, crossings, walked=crossings != ("none",))


def usual_odd(
    lanes: Interval,
    limit_mps: Interval,
    signals: tuple[SignalType, ...],
    crossings: tuple[CrossingType, ...],
    *,
    walked: bool,
) -> Odd:
    """A family's default ODD: its own roads, and what drivers, pedestrians and the weather do anywhere."""
    return Odd(
        scenery=Scenery(lanes=lanes, speed_limit_mps=limit_mps, signal_types=signals, crossing_types=crossings),
        environment=Environment(
            friction=Interval(low=0.6, high=1.0),
            visibility_m=Interval(low=100, high=2000),
            precipitation=("none",),
            time_of_day=("day",),
        ),
        dynamic=DynamicElements(
            actor_kinds=("pedestrian", "vehicle") if walked else ("vehicle",),
            ego_speed_mps=Interval(low=0, high=limit_mps.high),
            vehicle_speed_mps=Interval(low=0, high=limit_mps.high * MOST_OVER_LIMIT),
            **preset("ordinary"),
        ),
    )
