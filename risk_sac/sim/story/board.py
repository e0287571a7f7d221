"""Storyboard: acts, groups, maneuvers, events and actions, and their states.

Source: ASAM OpenSCENARIO XML 1.3, "Storyboard and entities": states and transitions, priorities, execution counts.
"""

from collections.abc import Iterator, Mapping, Sequence

from risk_sac.config.story import (
    ElementKind,
    Maneuver,
    ManeuverGroup,
    NamedAction,
    StateCondition,
    Story,
    StoryAct,
    StoryEvent,
)
from risk_sac.config.story_actions import DeleteAction, VariableAction
from risk_sac.sim.story.actions import doing_of, set_variable
from risk_sac.sim.story.stage import ALONG, Doing, Stage
from risk_sac.sim.story.triggers import EventStart, TriggerWatch

PATH = "::"  # between the names of nested elements


class Running:
    """Running actions, at most one per actor and thing that it controls."""

    def __init__(self, stage: Stage) -> None:
        """Nothing runs yet."""
        self._stage = stage
        self._by_actor: dict[str, list[Doing]] = {}

    def begin(self, actor: str, doing: Doing) -> bool:
        """Starts an action, ends conflicting ones; returns whether it is over already."""
        mover = self._stage.movers.get(actor)
        if mover is None or mover.gone:
            return True
        others = self._by_actor.setdefault(actor, [])
        others[:] = [other for other in others if not other.controls & doing.controls]
        over = doing.begin(mover, self._stage)
        if not over:
            others.append(doing)
        return over

    def stop(self, actor: str, doing: Doing) -> None:
        """Ends an action."""
        if actor in self._by_actor:
            self._by_actor[actor] = [other for other in self._by_actor[actor] if other is not doing]

    def runs(self, actor: str, doing: Doing) -> bool:
        """Whether an action still runs."""
        return any(other is doing for other in self._by_actor.get(actor, ()))

    def step(self) -> None:
        """Lets all actions say what their actors do in the next step."""
        for actor, doings in self._by_actor.items():
            mover = self._stage.movers[actor]
            if mover.gone:
                doings.clear()
                continue
            # A speed counts for what happens across in the same step.
            for doing in sorted(doings, key=lambda doing: not doing.controls & ALONG):
                if doing.step(mover, self._stage):
                    doings.remove(doing)


class Element:
    """Part of a storyboard.

    Attributes:
      state: standby, running or complete.
    """

    def __init__(self, board: "Storyboard", kind: ElementKind, path: str, parts: Sequence["Element"] = ()) -> None:
        """Stands by."""
        self.kind, self.path, self.state = kind, path, "standby"
        self._board, self.parts = board, parts
        self._transition, self._tick = "", -1
        self.actors: frozenset[str] = frozenset()

    def enter(self, transition: str) -> None:
        """Makes a transition: start, end, stop or skip."""
        self._transition, self._tick = transition, self._board.tick
        self.state = {"start": "running", "end": "complete", "stop": "complete"}.get(transition, self.state)

    def is_in(self, state: str) -> bool:
        """Whether it is in a state, or made this transition just now."""
        return self.state == state or (self._transition == state and self._board.tick - self._tick <= 1)

    def stand_by(self) -> None:
        """Returns it to where it begins."""
        self.state = "standby"
        for part in self.parts:
            part.stand_by()

    def start(self) -> None:
        """Starts it with its parts."""
        self.enter("start")
        for part in self.parts:
            part.actors = part.actors or self.actors
            part.start()

    def step(self) -> None:
        """Evaluates its parts now; it ends with the last of them."""
        for part in self.parts:
            if part.state != "complete":
                part.step()
        if self.state == "running" and all(part.state == "complete" for part in self.parts):
            self.finish()

    def finish(self) -> None:
        """Ends it."""
        self.enter("end")

    def stop(self) -> None:
        """Stops it with its parts."""
        if self.state != "complete":
            for part in self.parts:
                part.stop()
            self.enter("stop")

    def walk(self) -> Iterator["Element"]:
        """It and all of its parts."""
        yield self
        for part in self.parts:
            yield from part.walk()


class ActElement(Element):
    """An act, which starts and stops by its triggers."""

    def __init__(self, board: "Storyboard", act: StoryAct, path: str) -> None:
        """Stands by."""
        super().__init__(
            board, "act", path, [GroupElement(board, group, f"{path}{PATH}{group.name}") for group in act.groups]
        )
        self._start = TriggerWatch(act.start) if act.start else None
        self._stop = TriggerWatch(act.stop) if act.stop else None

    def step(self) -> None:
        """See `Element.step`."""
        if self.state == "standby":
            fires, self.actors = (True, frozenset()) if self._start is None else self._board.check(self._start)
            if fires:
                self.start()
        if self.state == "running" and self._stop is not None and self._board.check(self._stop)[0]:
            self.stop()
        if self.state == "running":
            super().step()


class GroupElement(Element):
    """Maneuvers of some actors, which may be done several times."""

    def __init__(self, board: "Storyboard", group: ManeuverGroup, path: str) -> None:
        """Stands by."""
        maneuvers = [ManeuverElement(board, one, f"{path}{PATH}{one.name}") for one in group.maneuvers]
        super().__init__(board, "maneuver_group", path, maneuvers)
        self._group, self._done = group, 0

    def start(self) -> None:
        """See `Element.start`."""
        triggering = self.actors if self._group.triggering else frozenset[str]()
        names = dict.fromkeys((*self._group.actors, *sorted(triggering)))
        for event in self.walk():
            if isinstance(event, EventElement):
                event.names = tuple(names)
        super().start()

    def finish(self) -> None:
        """See `Element.finish`."""
        self._done += 1
        super().finish()
        if self._done < self._group.most and self.parts:
            self.stand_by()
            self.start()


class ManeuverElement(Element):
    """Events in a named group."""

    def __init__(self, board: "Storyboard", maneuver: Maneuver, path: str) -> None:
        """Stands by."""
        events = [EventElement(board, event, f"{path}{PATH}{event.name}", self) for event in maneuver.events]
        super().__init__(board, "maneuver", path, events)

    def start(self) -> None:
        """See `Element.start`; its events wait for their triggers."""
        self.enter("start")


class EventElement(Element):
    """Actions that begin together.

    Attributes:
      names: of its actors.
    """

    names: tuple[str, ...] = ()

    def __init__(self, board: "Storyboard", event: StoryEvent, path: str, maneuver: "ManeuverElement") -> None:
        """Stands by."""
        super().__init__(
            board, "event", path, [ActionElement(board, one, f"{path}{PATH}{one.name}") for one in event.actions]
        )
        self._event, self._maneuver, self._done = event, maneuver, 0
        self._start = EventStart(event)

    def stand_by(self) -> None:
        """See `Element.stand_by`."""
        super().stand_by()
        self._done, self._start = 0, EventStart(self._event)

    def step(self) -> None:
        """See `Element.step`."""
        if self.state == "running":
            super().step()
            return
        if not self._start.fires(self._board.stage, self._board, self.names):
            return
        others = [part for part in self._maneuver.parts if part is not self and part.state == "running"]
        if others and self._event.priority == "skip":
            self.enter("skip")
            return
        if self._event.priority == "override":
            for other in others:
                other.stop()
        self.enter("start")
        for part in self.parts:
            assert isinstance(part, ActionElement)
            part.begin(self.names)
        super().step()

    def finish(self) -> None:
        """See `Element.finish`."""
        self._done += 1
        super().finish()
        if self._done < self._event.most:
            self.state, self._start = "standby", EventStart(self._event)


class ActionElement(Element):
    """An action, of each of its event's actors."""

    def __init__(self, board: "Storyboard", action: NamedAction, path: str) -> None:
        """Stands by."""
        super().__init__(board, "action", path)
        self._action = action
        self._doings: list[tuple[str, Doing]] = []

    def begin(self, actors: Sequence[str]) -> None:
        """Starts it for its actors."""
        self.enter("start")
        do = self._action.do
        if isinstance(do, VariableAction):
            set_variable(do, self._board.stage)
            self._doings = []
        else:
            others = (do.actor,) if isinstance(do, DeleteAction) and do.actor else actors
            started = [(actor, doing_of(do)) for actor in others]
            self._doings = [pair for pair in started if not self._board.running.begin(*pair)]
        self.step()

    def step(self) -> None:
        """See `Element.step`; it ends once none of its actors does it."""
        if self.state == "running" and not any(self._board.running.runs(*pair) for pair in self._doings):
            self.enter("end")

    def stop(self) -> None:
        """See `Element.stop`."""
        if self.state == "running":
            for pair in self._doings:
                self._board.running.stop(*pair)
        super().stop()


class Storyboard:
    """The elements of a story.

    Attributes:
      stage: the story's present.
      running: the actions that run.
      tick: number of the evaluation.
      stopped: whether the story's stop trigger fired.
    """

    def __init__(self, story: Story, stage: Stage, running: Running) -> None:
        """Does the actions of time 0's beginning; nothing is evaluated yet."""
        self.stage, self.running, self.tick, self.stopped = stage, running, 0, False
        self._stop = TriggerWatch(story.stop) if story.stop else None
        self._stories = [
            Element(self, "story", name, [ActElement(self, act, f"{name}{PATH}{act.name}") for act in acts])
            for name, acts in story.stories.items()
        ]
        self._elements = [element for part in self._stories for element in part.walk()]
        for part in self._stories:
            part.enter("start")

    def evaluate(self) -> None:
        """Evaluates all triggers now, and starts and ends what they say."""
        for part in self._stories:
            if part.state == "running":
                part.step()
        if self._stop is not None and self.check(self._stop)[0]:
            self.stopped = True
        self.tick += 1

    def check(self, watch: TriggerWatch) -> tuple[bool, frozenset[str]]:
        """Evaluates a trigger now."""
        return watch.check(self.stage, self)

    def is_in(self, condition: StateCondition) -> bool:
        """See `triggers.Board.is_in`; parents' names may precede an element's name."""
        return any(
            element.is_in(condition.state)
            for element in self._elements
            if element.kind == condition.of_kind and _is_named(element.path, condition.element)
        )

    @property
    def states(self) -> Mapping[str, str]:
        """State of each element, by its path."""
        return {element.path: element.state for element in self._elements}


def _is_named(path: str, name: str) -> bool:
    return path == name or path.endswith(PATH + name)
