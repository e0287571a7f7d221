"""The storyboard: entities' starts and actions, and the end of the episode."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from risk_sac.config.scenario import EGO, LONGEST_HORIZON_S
from risk_sac.config.story import (
    InitAction,
    Maneuver,
    ManeuverGroup,
    NamedAction,
    StoryAct,
    StoryEvent,
    TimeCondition,
    Trigger,
)
from risk_sac.config.story_actions import (
    AcquirePositionAction,
    AssignRouteAction,
    DeleteAction,
    FollowTrajectoryAction,
    NoAction,
    Position,
    RelativeTarget,
    SpeedAction,
    TeleportAction,
    TrajectoryPosition,
    VariableAction,
)
from risk_sac.config.values import Expression
from risk_sac.openscenario.actions import EGO_EFFECT, ActionReader
from risk_sac.openscenario.conditions import ConditionReader
from risk_sac.openscenario.entities import Catalogs, Entities, parametrised
from risk_sac.openscenario.scope import At, coded, combined, simplest
from risk_sac.openscenario.sources import Unread

USUAL_HORIZON_S = 60.0  # where no time ends the episode; choice
_LEAST_HORIZON_S = 1.0
_PRIORITIES = {"override": "override", "overwrite": "override", "skip": "skip", "parallel": "parallel"}
_PLACES = ("TeleportAction", "FollowTrajectoryAction")


@dataclass
class Begun:
    """Start of an entity."""

    position: Position | None = None
    speed: Expression = 0.0
    relative: RelativeTarget | None = None
    """Speed relative to that of another entity, in place of `speed`."""
    at: At | None = None
    """Where its speed is stated."""
    place: str = ""
    """File, line and element of its position."""


@dataclass
class Init:
    """Element `Init`: entities' starts by document name, and actions at time 0."""

    starts: dict[str, Begun] = field(default_factory=dict)
    actions: list[InitAction] = field(default_factory=list)
    variables: list[VariableAction] = field(default_factory=list)


class StoryboardReader:
    """Reads the element `Storyboard`."""

    def __init__(
        self,
        actions: ActionReader,
        conditions: ConditionReader,
        entities: Entities,
        catalogs: Catalogs,
        remarks: list[str],
    ) -> None:
        """Prepares to read; `remarks` gets what is not read."""
        self._actions, self._conditions, self._entities = actions, conditions, entities
        self._catalogs, self._remarks = catalogs, remarks

    # Init

    def init(self, block: At) -> Init:
        """Reads `Init`; raises `ConfigError` for an entity without a readable start."""
        init = Init({entity.name: Begun() for entity in self._entities.all.values()})
        for holder in block.all("Actions"):
            for at in holder.all("GlobalAction"):
                action = self._actions.on_all(at)
                if isinstance(action, VariableAction):
                    init.variables.append(action)
                elif not isinstance(action, NoAction):
                    raise at.refusal("an entity that leaves at time 0", "an entity that is there", "leave it out")
            for at in holder.all("Private"):
                for name in self._entities.members(at):
                    for inner in at.all("PrivateAction"):
                        self._begin(inner, name, init)
            for at in holder.all("UserDefinedAction"):
                at.element.use_all()
                self._remarks.append(f"{at.element.place}: not read; the command is not carried out")
        for entity in self._entities.all.values():
            if init.starts[entity.name].position is None:
                wanted = "a TeleportAction or FollowTrajectoryAction of it within Init"
                raise entity.at.refusal("an entity without a start", wanted)
        _resolve_speeds(init.starts)
        _refuse_cycles(init.starts, block)
        return init

    def _begin(self, at: At, name: str, init: Init) -> None:
        start = init.starts[name]
        try:
            action = self._actions.private(at)
        except Unread as error:
            if any(child.tag in _PLACES for child in at.element.below()):
                raise
            self._remarks.append(f"{error.field}: not read; {error.effect}")
            return
        if isinstance(action, TeleportAction):
            start.position, start.place = action.position, at.element.place
            return
        if isinstance(action, SpeedAction) and _at_once(action):
            start.at = at
            if isinstance(action.target, RelativeTarget):
                start.relative = action.target
            else:
                start.speed, start.relative = action.target, None
            return
        if isinstance(action, FollowTrajectoryAction) and start.position is None:
            place = {"trajectory": action.trajectory, "s_m": action.from_m}
            start.position, start.place = at.build(TrajectoryPosition, **place), at.element.place
        way = isinstance(action, FollowTrajectoryAction | AssignRouteAction | AcquirePositionAction)
        if name == EGO and not way and not isinstance(action, NoAction):
            self._remarks.append(f"{at.element.place}: not read; {EGO_EFFECT}")
        elif not isinstance(action, NoAction):
            init.actions.append(InitAction(actor=name, do=action))

    # Story

    def stories(self, block: At) -> Mapping[str, tuple[StoryAct, ...]]:
        """Reads all elements `Story`."""
        stories: dict[str, tuple[StoryAct, ...]] = {}
        for number, at in enumerate(block.all("Story"), 1):
            inner = parametrised(at, {})
            name = at.constant("name", f"story {number}")[:200] or f"story {number}"
            if name in stories:
                raise at.refusal(f"the story {name[:80]!r} once more", "each name once")
            stories[name] = tuple(self._act(act) for act in inner.all("Act"))
        return stories

    def _act(self, at: At) -> StoryAct:
        return at.build(
            StoryAct,
            name=at.constant("name")[:200],
            groups=tuple(self._group(group) for group in at.all("ManeuverGroup")),
            start=self._conditions.trigger(at.maybe("StartTrigger")),
            stop=self._conditions.trigger(at.maybe("StopTrigger")),
        )

    def _group(self, at: At) -> ManeuverGroup:
        holder = at.one("Actors")
        actors = tuple(dict.fromkeys(name for ref in holder.all("EntityRef") for name in self._entities.members(ref)))
        maneuvers = []
        for inner in at.all("Maneuver", "CatalogReference"):
            if inner.tag == "CatalogReference":
                inner = self._catalogs.constant_entry(inner, "Maneuver")
            else:
                inner = parametrised(inner, {})
            maneuvers.append(self._maneuver(inner, actors))
        return at.build(
            ManeuverGroup,
            name=at.constant("name")[:200],
            actors=actors,
            triggering=holder.flag("selectTriggeringEntities", False),
            maneuvers=tuple(maneuvers),
            most=_count(at),
        )

    def _maneuver(self, at: At, actors: tuple[str, ...]) -> Maneuver:
        events = tuple(self._event(event, actors) for event in at.all("Event"))
        return at.build(Maneuver, name=at.constant("name")[:200], events=events)

    def _event(self, at: At, actors: tuple[str, ...]) -> StoryEvent:
        actions = [
            one.build(NamedAction, name=one.constant("name", "action")[:200], do=self._actions.of_event(one, actors))
            for one in at.all("Action")
        ]
        return at.build(
            StoryEvent,
            name=at.constant("name")[:200],
            start=self._conditions.trigger(at.maybe("StartTrigger")),
            actions=tuple(actions),
            priority=at.one_of("priority", _PRIORITIES),
            most=_count(at),
        )

    def stop(self, block: At) -> Trigger | None:
        """Reads the storyboard's `StopTrigger`."""
        return self._conditions.trigger(block.maybe("StopTrigger"))


def _count(at: At) -> int:
    value = at.number_or("maximumExecutionCount", 1.0)
    if not isinstance(value, float) or value < 1.0:
        raise at.refusal(f"maximumExecutionCount {value}", "a number from 1 on")
    return min(int(value), 1000)


def _at_once(action: SpeedAction) -> bool:
    continuous = isinstance(action.target, RelativeTarget) and action.target.continuous
    return not continuous and (action.dynamics.shape == "step" or action.dynamics.value == 0.0)


def _resolve_speeds(starts: Mapping[str, Begun]) -> None:
    """Makes speeds relative to another entity absolute ones."""
    for name, start in starts.items():
        chain, here, steps = [name], start, list[RelativeTarget]()
        while here.relative is not None:
            steps.append(here.relative)
            if here.relative.to in chain:
                assert start.at is not None
                raise start.at.refusal(f"speeds relative to each other: {' → '.join(chain)}", "one that is absolute")
            chain.append(here.relative.to)
            here = starts[here.relative.to]
        speed: Expression = here.speed
        for step in reversed(steps):
            assert start.at is not None
            speed = start.at.combined(speed, "+" if step.how == "delta" else "*", step.value)
        start.speed = speed
    for start in starts.values():
        start.relative = None


def _refuse_cycles(starts: Mapping[str, Begun], block: At) -> None:
    for name in starts:
        chain, here = [name], name
        while (other := getattr(starts[here].position, "to", None)) is not None:
            if other in chain:
                got = f"starts relative to each other: {' → '.join([*chain, other])}"
                raise block.refusal(got[:300], "a chain that ends at a place")
            chain.append(other)
            here = other


def moving_actors(init: Init, stories: Mapping[str, tuple[StoryAct, ...]]) -> set[str]:
    """Returns names of actors that start with speed, move or are removed."""
    names = {name for name, start in init.starts.items() if start.speed != 0.0}
    names |= {action.actor for action in init.actions}
    for group in (group for acts in stories.values() for act in acts for group in act.groups):
        for do in (one.do for part in group.maneuvers for event in part.events for one in event.actions):
            if isinstance(do, DeleteAction) and do.actor is not None:
                names.add(do.actor)
            elif not isinstance(do, NoAction | VariableAction):
                names |= set(init.starts if group.triggering else group.actors)
    return names


def horizon_of(stop: Trigger | None, remarks: list[str]) -> Expression:
    """Returns an episode's length: the first time that alone ends it."""
    times = list[Expression]()
    for group in stop or ():
        if len(group) == 1 and isinstance(condition := group[0], TimeCondition) and "greater" in condition.rule:
            delay = condition.delay_s
            times.append(combined(condition.value, "+", delay) if delay != 0.0 else condition.value)
    if not times:
        remarks.append(f"no time ends the scenario: an episode lasts {USUAL_HORIZON_S:g} s at most")
        return USUAL_HORIZON_S
    texts = ", ".join(coded(time).text for time in times)
    first = f"min({texts})" if len(times) > 1 else texts
    return simplest(f"max({_LEAST_HORIZON_S:g}, min({LONGEST_HORIZON_S:g}, {first}))")
