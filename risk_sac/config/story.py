"""Story of a scenario document: what its actors do besides the search, and when.

The model follows OpenSCENARIO XML 1.3. A story has acts, an act has maneuver groups, a group has maneuvers, a maneuver
has events, and an event has actions and a start trigger. Values are arithmetic over the document's parameters.
Source: ASAM OpenSCENARIO XML 1.3, class reference.
"""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from risk_sac.config.base import Settings
from risk_sac.config.story_actions import Action
from risk_sac.config.story_conditions import Trigger
from risk_sac.config.story_places import ActorName, ElementName, RoutePath, Trajectory
from risk_sac.config.values import Expression


class NamedAction(Settings):
    """Action of an event."""

    name: ElementName = "action"
    do: Action


class StoryEvent(Settings):
    """Actions that begin together."""

    name: ElementName
    start: Trigger | None = None
    """Without it the event starts with its act."""
    actions: Annotated[tuple[NamedAction, ...], Field(min_length=1, max_length=100)]
    priority: Literal["override", "skip", "parallel"] = "override"
    most: Annotated[int, Field(ge=1, le=1000)] = 1
    """Executions."""


class Maneuver(Settings):
    """Events in a named group."""

    name: ElementName = "maneuver"
    events: Annotated[tuple[StoryEvent, ...], Field(max_length=1000)]


class ManeuverGroup(Settings):
    """Maneuvers of some actors."""

    name: ElementName = "group"
    actors: Annotated[tuple[ActorName, ...], Field(max_length=100)] = ()
    triggering: bool = False
    """Whether the actors that triggered the act are actors too."""
    maneuvers: Annotated[tuple[Maneuver, ...], Field(max_length=100)] = ()
    most: Annotated[int, Field(ge=1, le=1000)] = 1


class StoryAct(Settings):
    """Part of a story with a start and an end."""

    name: ElementName = "act"
    groups: Annotated[tuple[ManeuverGroup, ...], Field(min_length=1, max_length=100)]
    start: Trigger | None = None
    """Without it at time 0."""
    stop: Trigger | None = None


class InitAction(Settings):
    """Action of one actor at time 0."""

    actor: ActorName
    do: Action


class DeviationBounds(Settings):
    """Bounds of what a search adds to a story; with zeros it is followed exactly."""

    accel_mps2: Annotated[float, Field(ge=0, le=10)] = 1.5
    """Added to the acceleration."""
    lateral_mps: Annotated[float, Field(ge=0, le=3)] = 0.5
    """Added to the speed across."""
    trigger_s: Annotated[float, Field(ge=0, le=10)] = 0.5
    """How much later or earlier a search lets the triggers of an actor's events fire."""


class Story(Settings):
    """Actions of story actors from time 0 on, and the episode's end."""

    routes: Annotated[Mapping[ElementName, RoutePath], Field(max_length=200)] = {}
    trajectories: Annotated[Mapping[ElementName, Trajectory], Field(max_length=200)] = {}
    variables: Annotated[Mapping[ElementName, Expression], Field(max_length=200)] = {}
    """Name → number at time 0; a truth value is 1 or 0."""
    words: Annotated[Mapping[ElementName, ElementName], Field(max_length=200)] = {}
    """Name → word at time 0, of variables that hold words."""
    init: Annotated[tuple[InitAction, ...], Field(max_length=1000)] = ()
    """Beside starts and speeds of the actors themselves."""
    stories: Annotated[Mapping[ElementName, tuple[StoryAct, ...]], Field(max_length=100)] = {}
    stop: Trigger | None = None
    """Ends the episode."""
    deviation: DeviationBounds = DeviationBounds()
    """Of methods that act; a zero action is the story."""
