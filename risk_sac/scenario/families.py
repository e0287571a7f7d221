"""Scenario families by name: the shipped ones, and those of the library."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from risk_sac.config import (
    CrossingType,
    DeviationBounds,
    DynamicElements,
    Environment,
    FamilyName,
    Interval,
    JudgeConfig,
    Like,
    Odd,
    Requirement,
    Scenario,
    Scenery,
    SignalType,
)
from risk_sac.config.distribution import RankCorrelation
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError, InfeasibleScene, did_you_mean
from risk_sac.scenario.declared import SceneLaw
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.interpret import Interpreter
from risk_sac.scenario.layout import Layout
from risk_sac.scenario.library import DOCUMENT, kept
from risk_sac.scenario.limits import behaving, preset
from risk_sac.scenario.odd import SIGNAL_OF
from risk_sac.scenario.reading import FOLDER, PAPER_FAMILIES, nets_of, scenario_file, shipped_document, shipped_names
from risk_sac.scenario.scene import steps_of
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
        """The family without scene parameters that disturb its story (then 0)."""
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
        """Adversaries' names in the family `like`, or their own without it."""
        alike = {} if self.like is None else self.like.actors
        return tuple(alike.get(name, name) for name in self.adversaries)

    @property
    def mirrored(self) -> bool:
        """Whether left and right are swapped compared with the family `like`."""
        return self.like is not None and self.like.mirrored


def usual_odd(
    lanes: Interval,
    limit_mps: Interval,
    signals: tuple[SignalType, ...],
    crossings: tuple[CrossingType, ...],
    *,
    walked: bool,
) -> Odd:
    """Returns a default ODD: the family's roads, usual behaviour and weather."""
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


SAMPLED = 64  # scenes whose layouts say which roads a scenario has


def family_of(document: Scenario, nets: Mapping[str, str], name: str = "") -> Family:
    """Returns the family of a document, by its own name or another.

    Its nets lie below `sumo_nets/` or anywhere.

    Raises:
      ConfigError: the document does not fit its nets.
    """
    of = Interpreter(document, nets)
    vehicles, pedestrians = of.adversaries
    if document.like is not None:
        check_like(document.like, vehicles, pedestrians)
    space = replace(of.space, family=name or document.name)
    return Family(
        name=name or document.name,
        summary=document.summary,
        space=space,
        odd=_odd(of),
        vehicles=vehicles,
        pedestrians=pedestrians,
        statics=tuple(name for name, actor in document.actors.items() if actor.role == "static"),
        layout=of.layout,
        horizon_steps=steps_of(of.horizon_s),
        like=document.like,
        requirements=document.requirements,
        judge=document.judge,
        parameters=document.parameters,
        shifts=tuple(of.shifts),
        rank_correlation=document.rank_correlation,
    )


def check_like(like: Like, vehicles: Sequence[str], pedestrians: Sequence[str]) -> None:
    """Refuses `like` families without a library, and adversaries without counterpart there."""
    if like.family not in PAPER_FAMILIES:
        remedy = did_you_mean(like.family, PAPER_FAMILIES) or "leave `like` out to search without a library"
        raise ConfigError("like.family", repr(like.family), f"one of {', '.join(PAPER_FAMILIES)}", remedy)
    if unknown := sorted(like.actors.keys() - {*vehicles, *pedestrians}):
        wanted = f"one of {', '.join((*vehicles, *pedestrians))}"
        raise ConfigError(f"like.actors.{unknown[0]}", "the name of no adversary", wanted)
    document = shipped_document(like.family)
    for own, known in zip((vehicles, pedestrians), Interpreter(document, nets_of(document)).adversaries, strict=True):
        for name in own:
            if (other := like.actors.get(name, name)) not in known:
                wanted = f"one of {', '.join(known)}" if known else f"a family with an actor that moves as {name} does"
                got = repr(other) if name in like.actors else "nothing"
                raise ConfigError(f"like.actors.{name}", got, wanted, did_you_mean(other, known))


def sampled(of: Interpreter, count: int = SAMPLED) -> Iterator[Layout | InfeasibleScene]:
    """Yields layouts over a whole scene space, and errors of refused scenes."""
    for point in np.random.default_rng(0).random((count, of.space.dimension)):
        try:
            yield of.layout(of.space.from_unit(point).values)
        except InfeasibleScene as refused:
            yield refused


def _odd(of: Interpreter) -> Odd:
    """Returns the default ODD: the ego's roads, and what the document says."""
    drawn = list(sampled(of))
    layouts = [layout for layout in drawn if isinstance(layout, Layout)]
    if not layouts:
        raise ConfigError("constraints", f"none of {SAMPLED} scenes is possible; in the first, {drawn[0]}")
    lanes = [(net_of(layout.net), f"{layout.ego.route[0]}_{layout.ego.lane}") for layout in layouts]
    limits_mps = [net.lanes[lane].limit_mps for net, lane in lanes]
    driven = {(layout.net, edge) for layout in layouts for edge in layout.ego.route}
    fastest_mps = max(lane.limit_mps for file, edge in driven for lane in net_of(file).edges[edge].drivable)
    counts = [len(net.edges[net.lanes[lane].edge].drivable) for net, lane in lanes]
    kinds: dict[bool, SignalType] = {False: "none", True: "fixed_time"}
    crossings: set[CrossingType] = {kind for layout in layouts for kind in of.crossings(layout.net)} or {"none"}
    met = {SIGNAL_OF[kind] for kind in crossings if kind in SIGNAL_OF}
    usual = usual_odd(
        lanes=Interval(low=min(counts), high=max(counts)),
        limit_mps=Interval(low=min(limits_mps), high=fastest_mps),
        signals=tuple(sorted({kinds[layout.signal is not None] for layout in layouts} | met)),
        crossings=tuple(sorted(crossings)),
        walked=any(layout.pedestrians for layout in layouts),
    )
    said = of.document.odd
    usual = usual.model_copy(update={"dynamic": behaving(usual.dynamic, said.dynamic.behaviour)})
    branches = {}
    for branch in type(said).model_fields:
        own = getattr(said, branch)
        fields = {name: getattr(own, name) for name in type(own).model_fields if getattr(own, name) is not None}
        branches[branch] = getattr(usual, branch).model_copy(update=fields)
    return Odd(**branches)


class _Families(Mapping[str, Family]):
    """Shipped families by name, each read when it is first asked for."""

    def __getitem__(self, name: str) -> Family:
        if name not in shipped_names():
            raise KeyError(name)
        return _shipped(name)

    def __iter__(self) -> Iterator[str]:
        return iter(shipped_names())

    def __len__(self) -> int:
        return len(shipped_names())


FAMILIES: Mapping[str, Family] = _Families()


@cache
def _shipped(name: str) -> Family:
    document = shipped_document(name)
    return family_of(document, nets_of(document))


def family_named(name: str, deviation: DeviationBounds | None = None) -> Family:
    """Returns a family, shipped or kept; `deviation` replaces its story's bounds.

    Raises:
      ConfigError: no family has this name.
    """
    return FAMILIES[name] if name in FAMILIES else _kept(name, deviation)


@cache  # a name holds a digest of what it stands for
def _kept(name: str, deviation: DeviationBounds | None) -> Family:
    document, folder = kept(name)
    if document.story is not None and deviation is not None:
        story = document.story.model_copy(update={"deviation": deviation})
        document = document.model_copy(update={"story": story})
    return family_of(document, nets_of(document, folder), name)


def density_of(name: str) -> Callable[[Mapping[str, float]], float]:
    """Returns the declared density of a family's scenes, or 1 without one."""
    try:
        declared = family_named(name).declared
    except ConfigError:
        return lambda scene: 1.0
    return (lambda scene: 1.0) if declared.alike else declared.density_of


def document_named(name: str) -> Scenario:
    """Returns a family's document, shipped or kept; raises `ConfigError` if unknown."""
    return shipped_document(name) if name in shipped_names() else kept(name)[0]


def sources_named(name: str) -> Mapping[str, bytes]:
    """Reads a family's document and nets by file; raises as `document_named`."""
    if name in shipped_names():
        document, folder, file = shipped_document(name), None, scenario_file(name)
    else:
        document, folder = kept(name)
        file = folder / DOCUMENT
    nets = [FOLDER / net for net in nets_of(document, folder).values()]
    return {path.name: path.read_bytes() for path in (file, *nets)}
