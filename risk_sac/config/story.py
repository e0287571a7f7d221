"""Story of a scenario document: what its actors do, and when.

The model follows OpenSCENARIO XML 1.3. A story has acts, an act has maneuver groups, a group has maneuvers, a maneuver
has events, and an event has actions and a start trigger. Values are arithmetic over the document's parameters.
Source: ASAM OpenSCENARIO XML 1.3, class reference.
"""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from risk_sac.config.base import Settings
from risk_sac.config.story_actions import Action, ActorName, Coordinates, ElementName, Position, RoutePath, Trajectory
from risk_sac.config.values import Expression

Rule = Literal["greater", "greater_or_equal", "less", "less_or_equal", "equal", "not_equal"]
Along = Literal["euclidean", "longitudinal", "lateral"]
Direction = Literal["longitudinal", "lateral", "vertical"]
ElementKind = Literal["story", "act", "maneuver_group", "maneuver", "event", "action"]
ElementState = Literal["standby", "running", "complete", "start", "end", "stop", "skip"]


class _Condition(Settings):
    name: ElementName = "condition"
    delay_s: Expression = 0.0
    edge: Literal["none", "rising", "falling", "rising_or_falling"] = "none"


class _EntityCondition(_Condition):
    of: Annotated[tuple[ActorName, ...], Field(min_length=1, max_length=100)]
    """Actors whose values are compared."""
    which: Literal["any", "all"] = "any"


class TimeCondition(_Condition):
    """Compares the time since the story's start, s."""

    kind: Literal["time"]
    rule: Rule
    value: Expression


class DistanceCondition(_EntityCondition):
    """Compares the distance to an actor or a place, m."""

    kind: Literal["distance"]
    to: ActorName | Position
    rule: Rule
    value: Expression
    along: Along = "euclidean"
    freespace: bool = False
    coordinates: Coordinates = "entity"


class HeadwayCondition(_EntityCondition):
    """Compares the distance to an actor over the own speed, s."""

    kind: Literal["time_headway"]
    to: ActorName
    rule: Rule
    value: Expression
    along: Along = "longitudinal"
    freespace: bool = False
    coordinates: Coordinates = "entity"


class CollisionTimeCondition(_EntityCondition):
    """Compares the time to collision with an actor or a place, s."""

    kind: Literal["time_to_collision"]
    to: ActorName | Position
    rule: Rule
    value: Expression
    along: Along = "longitudinal"
    freespace: bool = True
    coordinates: Coordinates = "entity"


class SpeedCondition(_EntityCondition):
    """Compares speeds, m/s."""

    kind: Literal["speed"]
    rule: Rule
    value: Expression
    direction: Direction | None = None
    """Without it the size of the velocity."""


class RelativeSpeedCondition(_EntityCondition):
    """Compares the speed less that of another actor, m/s."""

    kind: Literal["relative_speed"]
    to: ActorName
    rule: Rule
    value: Expression
    direction: Direction | None = None


class AccelerationCondition(_EntityCondition):
    """Compares accelerations, m/s²."""

    kind: Literal["acceleration"]
    rule: Rule
    value: Expression
    direction: Direction | None = None


class TravelledCondition(_EntityCondition):
    """Holds once an actor travelled so far, m."""

    kind: Literal["travelled"]
    value: Expression


class ReachCondition(_EntityCondition):
    """Holds within a tolerance around a place."""

    kind: Literal["reach"]
    position: Position
    tolerance_m: Expression


class StandStillCondition(_EntityCondition):
    """Holds once an actor stood so long, s."""

    kind: Literal["stand_still"]
    duration_s: Expression


class CollisionCondition(_EntityCondition):
    """Holds while an actor touches another one."""

    kind: Literal["collision"]
    partner: ActorName | None = None
    """Without it any other actor."""


class AngleCondition(_EntityCondition):
    """Holds while a heading is within a tolerance of an angle, rad."""

    kind: Literal["angle"]
    angle_rad: Expression
    tolerance_rad: Expression
    relative: bool = False
    """To the lane; else absolute."""


class OffroadCondition(_EntityCondition):
    """Holds after `duration_s` off the road, or at its end."""

    kind: Literal["offroad", "end_of_road"]
    duration_s: Expression


class StateCondition(_Condition):
    """Holds once a part of the story is in a state."""

    kind: Literal["state"]
    element: ElementName
    of_kind: ElementKind
    state: ElementState


class VariableCondition(_Condition):
    """Compares a variable, or a parameter, with a number or a word."""

    kind: Literal["variable", "parameter"]
    variable: ElementName
    rule: Rule
    value: Expression = 0.0
    word: ElementName | None = None
    """In place of a number."""


Condition = Annotated[
    TimeCondition
    | DistanceCondition
    | HeadwayCondition
    | CollisionTimeCondition
    | SpeedCondition
    | RelativeSpeedCondition
    | AccelerationCondition
    | TravelledCondition
    | ReachCondition
    | StandStillCondition
    | CollisionCondition
    | AngleCondition
    | OffroadCondition
    | StateCondition
    | VariableCondition,
    Field(discriminator="kind"),
]

Trigger = Annotated[tuple[Annotated[tuple[Condition, ...], Field(max_length=100)], ...], Field(max_length=100)]
"""Groups of conditions; it fires once all conditions of one group hold."""


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
    """Bounds of what a search adds to a story; zeros change nothing."""

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
