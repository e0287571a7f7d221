"""A document's story in one scene: numbers in place of expressions, and the actors that follow it."""

import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from risk_sac.config.base import Settings
from risk_sac.config.scenario import Chosen, is_expression
from risk_sac.config.story import Story, StoryEvent
from risk_sac.scenario.places import StoryPlaces
from risk_sac.scenario.travel_line import Pose


class Reach(NamedTuple):
    """Bounding box of an actor, seen from its reference point."""

    length_m: float
    width_m: float
    ahead_m: float = 0.0
    """From the reference point, such as the rear axle's middle, forward to the box's middle."""


class StoryActor(NamedTuple):
    """Start of an actor that follows the story."""

    pose: Pose  # of its reference point
    speed_mps: float
    reach: Reach
    free: bool = False  # whether it moves anywhere, and not along lanes


class Deviation(NamedTuple):
    """Bounds of what an adversary adds to its story; all 0 leave the story as it is written."""

    accel_mps2: float = 0.0
    lateral_mps: float = 0.0


AS_WRITTEN = Deviation()
TIMELESS_CONDITIONS = frozenset({"state", "variable", "parameter", "collision"})
TIMELESS_ACTIONS = frozenset({"none", "variable", "visibility", "delete"})


def is_shifted(event: StoryEvent) -> bool:
    """Whether a deviation may shift an event's start trigger.

    An event that begins with its act, or as another element changes, follows what went before.
    """
    return any(condition.kind not in TIMELESS_CONDITIONS for group in event.start or () for condition in group) and any(
        action.do.kind not in TIMELESS_ACTIONS for action in event.actions
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class StoryPlan:
    """Everything that the engine of a story needs for one episode."""

    story: Story  # without expressions and choices
    actors: Mapping[str, StoryActor]  # those that follow the story, in the document's order
    others: Mapping[str, StoryActor] = field(default_factory=dict)  # the ego, and all that the story does not move
    numbers: Mapping[str, float] = field(default_factory=dict)  # parameters
    words: Mapping[str, str] = field(default_factory=dict)
    edges: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # the ways of actors that have one
    places: StoryPlaces = field(compare=False)
    deviation: Deviation = AS_WRITTEN
    shifts_s: Mapping[str, float] = field(default_factory=dict)  # actor -> how much later its triggers fire


def shifted_groups(story: Story) -> Iterator[tuple[str, ...]]:
    """Yields the actors of each group that has events whose start triggers a deviation may shift."""
    for acts in story.stories.values():
        for group in (group for act in acts for group in act.groups):
            if any(is_shifted(event) for maneuver in group.maneuvers for event in maneuver.events):
                yield group.actors


def settled(part: Any, of: Callable[[Any, str], float], choose: Callable[[Any], Any], path: str = "") -> Any:
    """Replaces expressions by their values, and choices by what is chosen.

    Args:
      part: settings, or a mapping or tuple of some.
      of: the value of an expression, given its path.
      choose: what a choice stands for.
      path: of the part in its document.
    """
    if isinstance(part, Chosen):
        return settled(choose(part), of, choose, path)
    if isinstance(part, Settings):
        changed = {}
        for name, info in type(part).model_fields.items():
            before, here = getattr(part, name), f"{path}.{name}".removeprefix(".")
            after: Any = before
            if is_expression(info) and isinstance(before, str):
                after = of(before, here)
            elif is_expression(info) and isinstance(before, Mapping):
                after = {key: of(value, f"{here}.{key}") for key, value in before.items()}
            elif not isinstance(before, str):
                after = settled(before, of, choose, here)
            if after is not before:
                changed[name] = after
        return part.model_copy(update=changed) if changed else part
    if isinstance(part, tuple):
        members = tuple(settled(member, of, choose, f"{path}[{i}]") for i, member in enumerate(part))
        return part if all(map(operator.is_, members, part)) else members
    if isinstance(part, Mapping):
        return {key: settled(member, of, choose, f"{path}.{key}") for key, member in part.items()}
    return part
