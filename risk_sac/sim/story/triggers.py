"""Triggers of a story: conditions with edges and delays, in groups.

Source: ASAM OpenSCENARIO XML 1.3, "Conditions and triggers". A condition with an edge is false where it is evaluated
first; one with a delay is as it was that time before, and false before it was evaluated.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

import shapely

from risk_sac.config.story import (
    AccelerationCondition,
    AngleCondition,
    CollisionCondition,
    CollisionTimeCondition,
    Condition,
    DistanceCondition,
    HeadwayCondition,
    OffroadCondition,
    ReachCondition,
    RelativeSpeedCondition,
    Rule,
    SpeedCondition,
    StandStillCondition,
    StateCondition,
    StoryEvent,
    TimeCondition,
    TravelledCondition,
    Trigger,
    VariableCondition,
)
from risk_sac.scenario.layout import is_shifted
from risk_sac.sim.story.stage import Stage, box
from risk_sac.world.types import STEP_S

EPS = 1e-6  # numbers that differ by less are equal
NOBODY: frozenset[str] = frozenset()


class StoryState(Protocol):
    """The story's elements, as a condition sees them."""

    def is_in(self, condition: StateCondition) -> bool:
        """Whether an element is in a state, or makes a transition now."""


def holds(rule: Rule, value: float, than: float) -> bool:
    """Whether a value keeps a rule."""
    if math.isnan(value):
        return False
    if rule == "equal":
        return abs(value - than) <= EPS
    if rule == "not_equal":
        return abs(value - than) > EPS
    if rule in ("greater", "greater_or_equal"):
        return value > than + (EPS if rule == "greater" else -EPS)
    return value < than + (-EPS if rule == "less" else EPS)


class Watch:
    """A condition, and what it was before."""

    def __init__(self, condition: Condition) -> None:
        """Prepares; nothing was evaluated yet."""
        self._condition = condition
        self._before: bool | None = None
        self._past: deque[tuple[float, bool]] = deque()

    def check(self, stage: Stage, board: StoryState) -> tuple[bool, frozenset[str]]:
        """Evaluates it now: whether it holds, and for which of its actors."""
        condition = self._condition
        now, actors = evaluate(condition, stage, board)
        before, self._before = self._before, now
        rising, falling = before is False and now, before is True and not now
        edge = condition.edge
        if edge != "none":
            now = (rising and edge != "falling") or (falling and edge != "rising")
        delay_s = float(condition.delay_s)
        if delay_s <= 0.0:
            return now, actors
        self._past.append((stage.time_s, now))
        if edge == "none":
            return self._was(stage.time_s - delay_s), actors
        return self._happened(stage.time_s - delay_s), actors

    def _was(self, time_s: float) -> bool:
        """Whether it held at a time."""
        while len(self._past) > 1 and self._past[1][0] <= time_s + EPS:
            self._past.popleft()
        return self._past[0][0] <= time_s + EPS and self._past[0][1]

    def _happened(self, time_s: float) -> bool:
        """Whether its edge came in the step up to a time."""
        happened = False
        while self._past and self._past[0][0] <= time_s + EPS:
            happened |= self._past.popleft()[1]
        return happened


class TriggerWatch:
    """A trigger, and what its conditions were before."""

    def __init__(self, trigger: Trigger) -> None:
        """Prepares; nothing was evaluated yet."""
        self._groups = [[Watch(condition) for condition in group] for group in trigger]

    def check(self, stage: Stage, board: StoryState) -> tuple[bool, frozenset[str]]:
        """Evaluates all conditions: whether a group holds, and such groups' actors."""
        fires, actors = False, set[str]()
        for group in self._groups:
            checks = [watch.check(stage, board) for watch in group]
            if checks and all(holding for holding, _ in checks):
                fires = True
                actors.update(*(of for _, of in checks))
        return fires, frozenset(actors)


def evaluate(condition: Condition, stage: Stage, board: StoryState) -> tuple[bool, frozenset[str]]:
    """Evaluates a condition without its edge and its delay."""
    if isinstance(condition, StateCondition):
        return board.is_in(condition), NOBODY
    if isinstance(condition, TimeCondition):
        return holds(condition.rule, stage.time_s, float(condition.value)), NOBODY
    if isinstance(condition, VariableCondition):
        return _variable(condition, stage), NOBODY
    test = TESTS[condition.kind]
    actors = frozenset(name for name in condition.of if name in stage.present and test(condition, name, stage))
    return (len(actors) == len(set(condition.of)) if condition.which == "all" else bool(actors)), actors


def _variable(condition: VariableCondition, stage: Stage) -> bool:
    own = condition.kind == "variable"
    words: Mapping[str, str] = stage.words if own else stage.plan.words
    numbers: Mapping[str, float] = stage.numbers if own else stage.plan.numbers
    name = condition.variable
    if condition.word is not None:
        same = words.get(name) == condition.word
        return same if condition.rule == "equal" else not same if condition.rule == "not_equal" else False
    return name in numbers and holds(condition.rule, numbers[name], float(condition.value))


def _distance(condition: DistanceCondition, name: str, stage: Stage) -> bool:
    other = stage.target(condition.to)
    if other is None:
        return False
    one, along = stage.present[name], condition.along
    apart_m, _ = stage.distance(one, other, along, condition.coordinates, freespace=condition.freespace)
    return holds(condition.rule, apart_m, float(condition.value))


def _headway(condition: HeadwayCondition, name: str, stage: Stage) -> bool:
    other = stage.present.get(condition.to)
    if other is None:
        return False
    one, along = stage.present[name], condition.along
    apart_m, _ = stage.distance(one, other, along, condition.coordinates, freespace=condition.freespace)
    headway_s = apart_m / one.speed_mps if one.speed_mps > EPS else math.inf
    return holds(condition.rule, headway_s, float(condition.value))


def _collision_time(condition: CollisionTimeCondition, name: str, stage: Stage) -> bool:
    other = stage.target(condition.to)
    if other is None:
        return False
    one, along = stage.present[name], condition.along
    apart_m, closing = stage.distance(one, other, along, condition.coordinates, freespace=condition.freespace)
    ttc_s = apart_m / closing if closing > EPS else math.inf
    return holds(condition.rule, ttc_s, float(condition.value))


def _speed(condition: SpeedCondition, name: str, stage: Stage) -> bool:
    return holds(condition.rule, _in_direction(condition.direction, name, stage), float(condition.value))


def _relative_speed(condition: RelativeSpeedCondition, name: str, stage: Stage) -> bool:
    if condition.to not in stage.present:
        return False
    if condition.direction is None:
        apart = stage.present[name].speed_mps - stage.present[condition.to].speed_mps
    else:
        one, other = stage.present[name], stage.present[condition.to]
        side = _side(condition.direction)
        apart = (*one.along(one.heading_rad), 0.0)[side] - (*other.along(one.heading_rad), 0.0)[side]
    return holds(condition.rule, apart, float(condition.value))


def _side(direction: str) -> int:
    return ("longitudinal", "lateral", "vertical").index(direction)


def _in_direction(direction: str | None, name: str, stage: Stage) -> float:
    actor = stage.present[name]
    if direction is None:
        return actor.speed_mps
    return (*actor.along(actor.heading_rad), 0.0)[_side(direction)]


def _acceleration(condition: AccelerationCondition, name: str, stage: Stage) -> bool:
    across = condition.direction in ("lateral", "vertical")
    return holds(condition.rule, 0.0 if across else stage.present[name].accel_mps2, float(condition.value))


def _travelled(condition: TravelledCondition, name: str, stage: Stage) -> bool:
    return stage.travelled_m[name] >= float(condition.value) - EPS


def _reach(condition: ReachCondition, name: str, stage: Stage) -> bool:
    there, here = stage.pose(condition.position), stage.present[name]
    return math.dist(there[:2], here[:2]) <= float(condition.tolerance_m) + EPS


def _stands(condition: StandStillCondition, name: str, stage: Stage) -> bool:
    return stage.stood_s[name] >= float(condition.duration_s) - EPS and stage.stands(name)


def _collides(condition: CollisionCondition, name: str, stage: Stage) -> bool:
    own = box(stage.present[name])
    others: Iterable[str] = stage.present if condition.partner is None else (condition.partner,)
    return any(
        bool(shapely.intersects(own, box(stage.present[other])))
        for other in others
        if other != name and other in stage.present
    )


def _angle(condition: AngleCondition, name: str, stage: Stage) -> bool:
    heading = stage.present[name].heading_rad - (stage.lane_heading(name) if condition.relative else 0.0)
    apart = math.remainder(heading - float(condition.angle_rad), math.tau)
    return abs(apart) <= float(condition.tolerance_rad) + EPS


def _offroad(condition: OffroadCondition, name: str, stage: Stage) -> bool:
    since_s = stage.off_road_s(name) if condition.kind == "offroad" else stage.at_end_s(name)
    return since_s is not None and since_s >= float(condition.duration_s) - EPS


TESTS: Mapping[str, Callable[[Any, str, Stage], bool]] = {
    "distance": _distance,
    "time_headway": _headway,
    "time_to_collision": _collision_time,
    "speed": _speed,
    "relative_speed": _relative_speed,
    "acceleration": _acceleration,
    "travelled": _travelled,
    "reach": _reach,
    "stand_still": _stands,
    "collision": _collides,
    "angle": _angle,
    "offroad": _offroad,
    "end_of_road": _offroad,
}


class EventStart:
    """Start of one execution of an event.

    Choice: a trigger comes earlier by `s` where it would fire `s` from now if all actors went on at their velocities,
    and at the latest where it fires. One that would fire in this way only, and never does, has begun the event all the
    same.
    """

    def __init__(self, event: StoryEvent) -> None:
        """Prepares; nothing was evaluated yet."""
        self._event = event
        self._watch = TriggerWatch(event.start) if event.start else None
        self._early = TriggerWatch(event.start) if event.start else None
        self._due_s: float | None = None

    def fires(self, stage: Stage, board: StoryState, actors: Iterable[str]) -> bool:
        """Evaluates it now for the event's actors; the first shift counts."""
        if self._watch is None or self._early is None:
            return True
        fires = self._watch.check(stage, board)[0]
        shifts_s = stage.plan.shifts_s
        shift_s = next((shifts_s[name] for name in actors if name in shifts_s), 0.0)
        if abs(shift_s) < STEP_S / 2 or not is_shifted(self._event):
            return fires
        shifted = [stage.movers[name] for name in actors if name in stage.movers]
        if shift_s < 0.0:
            before = self._early.check(stage.after(-shift_s), board)[0] and not fires
            if before:
                for mover in shifted:
                    mover.note_shift(shift_s)
            return fires or before
        if fires and self._due_s is None:
            self._due_s = stage.time_s + shift_s
            for mover in shifted:
                mover.note_shift(shift_s)
        return self._due_s is not None and stage.time_s >= self._due_s - STEP_S / 2
