"""Scenario families, and their usual ODD."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from risk_sac.config import (
    CrossingType,
    DynamicElements,
    Environment,
    FamilyName,
    Interval,
    JudgeConfig,
    Like,
    Odd,
    Requirement,
    Scenery,
    SignalType,
)
from risk_sac.config.distribution import RankCorrelation
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.scenario.declared import SceneLaw
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.limits import preset
from risk_sac.scenario.space import SceneSpace

MOST_OVER_LIMIT = 1.2  # fastest vehicles, as a share of the limit; choice


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """One scenario family."""

    name: FamilyName
    summary: str
    space: SceneSpace
    odd: Odd  # complete: every field is set
    vehicles: tuple[str, ...]  # adversary vehicles, in the order of the action vector
    pedestrians: tuple[str, ...]  # adversary pedestrians, after the vehicles
    statics: tuple[str, ...] = ()  # bodies that never move
    layout: Callable[[Mapping[str, float]], Layout]
    horizon_steps: int = 150  # of 0.1 s
    like: Like | None = None  # shipped family whose prior fits
    requirements: tuple[Requirement, ...] = ()  # of the scenario, beside the ODD's
    judge: JudgeConfig | None = None  # None: the campaign's
    parameters: Mapping[str, ScenarioParameter] = field(default_factory=dict)  # of the document
    rank_correlation: RankCorrelation | None = None  # between them
    shifts: tuple[str, ...] = ()  # scene parameters that shift triggers of the story

    @property
    def undisturbed(self) -> "Family":
        """The family without the scene parameters that disturb its story; its layouts have them at 0."""
        kept = tuple(parameter for parameter in self.space.parameters if parameter.name not in self.shifts)
        return replace(self, space=replace(self.space, parameters=kept), shifts=()) if self.shifts else self

    @property
    def declared(self) -> SceneLaw:
        """The declared distribution of its scenes."""
        return SceneLaw.of(self.space, self.parameters, self.rank_correlation)

    @property
    def adversaries(self) -> tuple[str, ...]:
        """All adversaries in the order of the action vector, two entries each."""
        return self.vehicles + self.pedestrians

    @property
    def stand_ins(self) -> tuple[str, ...]:
        """For each adversary the one of the family `like` that it stands for; without `like` its own name."""
        alike = {} if self.like is None else self.like.actors
        return tuple(alike.get(name, name) for name in self.adversaries)

    @property
    def mirrored(self) -> bool:
        """Whether what is on the left at the family `like` is on the right here, or vice versa."""
        return self.like is not None and self.like.mirrored


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
