"""Interprets a scenario document as a scene space and scenes' layouts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from risk_sac.config import CrossingType, Interval
from risk_sac.config.base import Chosen
from risk_sac.config.scenario import Scenario
from risk_sac.config.values import term
from risk_sac.errors import ConfigError, InfeasibleScene
from risk_sac.scenario.ground import net_of
from risk_sac.scenario.layout import Layout, shifted_groups
from risk_sac.scenario.reading import alternatives
from risk_sac.scenario.scene import SceneLayout, body_named, motion_of
from risk_sac.scenario.space import Parameter, SceneSpace, Value
from risk_sac.world.net import Net

SHIFT = "trigger_shift_"  # begins the name of a scene parameter that shifts an actor's triggers
LEAST_WAY_M = 20.0  # of road ahead of the ego; choice


@dataclass(frozen=True)
class Interpreter:
    """Makes layouts of a document's scenes."""

    document: Scenario
    nets: Mapping[str, str]  # network of the document -> file below `sumo_nets/`, or anywhere

    @cached_property
    def space(self) -> SceneSpace:
        """Scene space: ranges as they are, words and rows as [0, 1]."""
        parameters = []
        for name, parameter in self.document.parameters.items():
            if parameter.value is not None:
                continue
            low, high = parameter.range or (0.0, 1.0)
            binary = parameter.odd is not None and parameter.words is not None and len(parameter.words) == 2
            categories = parameter.words if binary and parameter.words else ()
            meaning = parameter.meaning or name.replace("_", " ")
            parameters.append(Parameter(name, parameter.unit, low, high, meaning, parameter.odd, categories))
        bound_s = self.document.story.deviation.trigger_s if self.document.story else 0.0
        for name, actor in self.shifts.items():
            if name in self.document.parameters:
                raise ConfigError(f"parameters.{name}", "the name of a trigger's shift", "another name")
            parameters.append(Parameter(name, "s", -bound_s, bound_s, f"how much later {actor}'s triggers fire"))
        return SceneSpace(self.document.name, tuple(parameters), self.holds if self.document.constraints else None)

    @cached_property
    def shifts(self) -> Mapping[str, str]:
        """Scene parameter → first deviating actor of the group that it shifts."""
        story = self.document.story
        if story is None or not story.deviation.trigger_s:
            return {}
        actors = self.document.actors
        following = {name for name, actor in actors.items() if actor.role == "story" and self._deviates(name)}
        first = (next((name for name in names if name in following), None) for names in shifted_groups(story))
        return {f"{SHIFT}{name}": name for name in first if name is not None}

    def holds(self, xi: Mapping[str, float]) -> bool:
        """Whether a scene keeps all constraints."""
        try:
            value = self.value(xi)
            return all(map(value.holds, self.document.constraints))
        except ConfigError:  # a value that does not exist there
            return False

    def value(self, xi: Mapping[str, float]) -> Value:
        """Returns the value of an expression in a scene."""
        numbers, words = dict[str, float](), dict[str, str]()
        for name, parameter in self.document.parameters.items():
            if parameter.value is not None:
                numbers[name] = Value(numbers, words).of(parameter.value, f"parameters.{name}.value")
            elif parameter.words is not None:
                words[name] = parameter.words[_part(xi[name], len(parameter.words))]
            elif parameter.rows is not None:
                for column, member in parameter.rows[_part(xi[name], len(parameter.rows))].items():
                    if isinstance(member, str):
                        words[column] = member
                    else:
                        numbers[column] = member
            else:
                numbers[name] = xi[name]
        return Value(numbers, words)

    def layout(self, xi: Mapping[str, float]) -> Layout:
        """Returns an episode's start; raises `InfeasibleScene` if constraints or values fail."""
        try:
            value = self.value(xi)
            for number, constraint in enumerate(self.document.constraints):
                if not value.holds(constraint):
                    raise InfeasibleScene(f"constraints[{number}] does not hold: {constraint}", reason="constraint")
        except ConfigError as error:
            raise InfeasibleScene(str(error), reason="constraint") from None
        try:
            layout = SceneLayout(self.document, value, *self.net(value), self.horizon_s).layout()
            _check_way(layout)
        except ConfigError as error:
            raise InfeasibleScene(str(error), reason="scenario") from error
        if layout.story is None or not self.shifts:
            return layout
        shifts_s = {actor: xi.get(name, 0.0) for name, actor in self.shifts.items()}
        return replace(layout, story=replace(layout.story, shifts_s=shifts_s))

    def net(self, value: Value) -> tuple[str, Net]:
        """The net of a scene: its file and its contents."""
        file = self.nets[value.word(self.document.network)]
        return file, net_of(file)

    @property
    def adversaries(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of adversaries in lanes, and of those that move freely."""
        driven, walking = list[str](), list[str]()
        for name, actor in self.document.actors.items():
            if actor.role == "adversary" or (actor.role == "story" and self._deviates(name)):
                bodies = alternatives(self.document, actor.body)
                motions = {motion_of(self.document, name, body_named(body, f"actors.{name}.body")) for body in bodies}
                if len(motions) > 1:
                    wanted = "bodies that all drive in lanes, or all move freely"
                    raise ConfigError(f"actors.{name}.body", ", ".join(bodies), wanted, "make two actors of it")
                (walking if motions == {"freely"} else driven).append(name)
        return tuple(driven), tuple(walking)

    def _deviates(self, name: str) -> bool:
        """Whether methods may lead an actor away from the document's story."""
        story, bodies = self.document.story, alternatives(self.document, self.document.actors[name].body)
        if story is None or not any(story.deviation.model_dump().values()):
            return False
        return all(motion_of(self.document, name, body_named(body, f"actors.{name}.body")) != "not" for body in bodies)

    def crossings(self, file: str) -> set[CrossingType]:
        """Kinds of crossings on a net at whose kerbs its actors start."""
        net, kinds = net_of(file), set[CrossingType]()
        for actor in self.document.actors.values():
            crossing = actor.start.crossing
            for edge in crossing.of.values() if isinstance(crossing, Chosen) else (crossing,) if crossing else ():
                for over in net.crossings_of.get((net.edges[edge].end, edge), ()) if edge in net.edges else ():
                    kinds.add("zebra" if over.signal is None else "signalised")
        return kinds

    @cached_property
    def horizon_s(self) -> float:
        """The longest episode, s."""
        horizon = self.document.horizon_s
        return horizon if isinstance(horizon, float) else term(horizon).range(self.ranges).high

    @cached_property
    def numbers(self) -> frozenset[str]:
        """Names of the document that stand for numbers."""
        names = {name for own, one in self.document.parameters.items() for name in one.names or (own,)}
        return frozenset(names - self.document.words.keys())

    @cached_property
    def ranges(self) -> Mapping[str, Any]:
        """Range of each number of the document."""
        ranges = dict[str, Interval]()
        for name, parameter in self.document.parameters.items():
            if parameter.value is not None:
                ranges[name] = term(parameter.value).range(ranges)
            elif parameter.range is not None:
                ranges[name] = Interval(low=parameter.range[0], high=parameter.range[1])
            for column in parameter.names:
                values = [member for row in parameter.rows or () if not isinstance(member := row[column], str)]
                if values:
                    ranges[column] = Interval(low=min(values), high=max(values))
        return ranges


def _check_way(layout: Layout) -> None:
    net, ego = net_of(layout.net), layout.ego
    first = net.edges[ego.route[0]].lanes[ego.lane]
    way_m = first.length_m - ego.position_m
    way_m += sum(net.edges[edge].lanes[0].length_m for edge in ego.route[1:])
    if way_m < LEAST_WAY_M:
        got = f"{way_m:.0f} m of road ahead of the ego on {' '.join(ego.route)}"
        raise ConfigError("ego.start", got, f"{LEAST_WAY_M:g} m or more", "start it earlier, or name a route")


def _part(share: float, parts: int) -> int:
    return min(int(share * parts), parts - 1)
