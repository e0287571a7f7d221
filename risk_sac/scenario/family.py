"""What a scenario family is, and what the shipped ones have in common."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from risk_sac.config import CrossingType, DynamicElements, Environment, FamilyName, Interval, Odd, Scenery, SignalType
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.space import Parameter, SceneSpace

LEAD_IN_S = 1.5  # in which SUMO drives everybody, before the adversaries are released to the policy
EGO = "ego"


@dataclass(frozen=True, slots=True)
class Family:
    """One scenario family."""

    name: FamilyName
    summary: str
    horizon_steps: int  # of 0.1 s
    space: SceneSpace
    odd: Odd  # complete: every field is set
    vehicles: tuple[str, ...]  # adversary vehicles, in the order of the action vector
    pedestrians: tuple[str, ...]  # adversary pedestrians, after the vehicles
    layout: Callable[[Mapping[str, float]], Layout]

    @property
    def adversaries(self) -> tuple[str, ...]:
        """All adversaries in the order of the action vector, two entries each."""
        return self.vehicles + self.pedestrians


def friction() -> Parameter:
    """Of the whole road, the same for everybody."""
    return Parameter("friction", "1", 0.6, 1.0, "tyre-road friction coefficient", "environment.friction")


def initial_speed(name: str, low: float, high: float, meaning: str) -> Parameter:
    """Of a vehicle, m/s; that of the ego, by its name, is bounded apart from the others'."""
    odd = "dynamic.ego_speed_mps" if name.startswith("ego") else "dynamic.vehicle_speed_mps"
    return Parameter(name, "m/s", low, high, meaning, odd)


def walking_speed(low: float, high: float) -> Parameter:
    """Of the pedestrian, m/s."""
    return Parameter("pedestrian_speed_mps", "m/s", low, high, "initial walking speed", "dynamic.pedestrian_speed_mps")


def road_odd(
    *, lanes: float, limit_mps: float, signals: tuple[SignalType, ...], crossings: tuple[CrossingType, ...]
) -> Odd:
    """A family's default: its own roads, and what a driver, a walker and the weather do anywhere."""
    pedestrians = crossings != ("none",)
    return Odd(
        scenery=Scenery(
            lanes=Interval(low=lanes, high=lanes),
            speed_limit_mps=Interval(low=limit_mps, high=limit_mps),
            signal_types=signals,
            crossing_types=crossings,
        ),
        environment=Environment(friction=Interval(low=0.6, high=1.0), visibility_m=Interval(low=100, high=2000)),
        dynamic=DynamicElements(
            actor_kinds=("pedestrian", "vehicle") if pedestrians else ("vehicle",),
            ego_speed_mps=Interval(low=0, high=limit_mps),
            vehicle_speed_mps=Interval(low=0, high=limit_mps * 1.2),
            vehicle_accel_mps2=Interval(low=-8, high=3.5),
            vehicle_lateral_speed_mps=Interval(low=0, high=1.2),
            vehicle_lateral_accel_mps2=Interval(low=0, high=1.5),
            pedestrian_speed_mps=Interval(low=0, high=2),  # walking; who wants them to run says so
            pedestrian_accel_mps2=Interval(low=-1.5, high=1.5),
        ),
    )
