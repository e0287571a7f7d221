"""Actions of a story: what changes the motion of an actor, or a variable.

Source: ASAM OpenSCENARIO XML 1.3, class reference.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from risk_sac.config.base import Settings
from risk_sac.config.story_places import ActorName, AnyName, ElementName, Position
from risk_sac.config.values import Expression
from risk_sac.errors import ConfigError

Coordinates = Literal["entity", "lane", "road", "trajectory"]
Shape = Literal["step", "linear", "sinusoidal", "cubic"]


class Dynamics(Settings):
    """Course of a value from its present to its target."""

    shape: Shape = "step"
    by: Literal["time", "rate", "distance"] = "time"
    value: Expression = 0.0
    """s, change per second (its size counts), or m."""


class RelativeTarget(Settings):
    """Value relative to that of another actor."""

    to: ActorName
    value: Expression = 0.0
    how: Literal["delta", "factor"] = "delta"
    continuous: bool = False
    """Whether the target follows the other actor's value, without an end."""


class SpeedAction(Settings):
    """Brings actors to a speed, m/s."""

    kind: Literal["speed"]
    target: Expression | RelativeTarget
    dynamics: Dynamics = Dynamics()


class SpeedEntry(Settings):
    """Speed of a profile, and how long it takes from the entry before."""

    speed: Expression
    """m/s."""
    time_s: Expression | None = None


class SpeedProfileAction(Settings):
    """Brings actors through a series of speeds."""

    kind: Literal["speed_profile"]
    entries: Annotated[tuple[SpeedEntry, ...], Field(min_length=1, max_length=10_000)]
    to: ActorName | None = None
    """Actor that the speeds are relative to."""
    mode: Literal["position", "follow"] = "position"
    accel_mps2: Expression | None = None
    """Largest acceleration where an entry has no time."""
    brake_mps2: Expression | None = None


class LaneTarget(Settings):
    """Lane relative to that of an actor."""

    to: ActorName
    lanes: Expression
    """Positive to the left in the direction of the actor `to`."""


class LaneChangeAction(Settings):
    """Changes the lane."""

    kind: Literal["lane_change"]
    target: Expression | LaneTarget
    """OpenDRIVE's lane id, or lanes beside an actor's."""
    offset_m: Expression = 0.0
    """To the target lane's middle."""
    dynamics: Dynamics


class LaneOffsetAction(Settings):
    """Changes the offset from the lane's middle."""

    kind: Literal["lane_offset"]
    target: Expression | RelativeTarget
    """m, positive to the left."""
    shape: Shape = "step"
    lateral_mps2: Expression | None = None
    """Largest lateral acceleration, by which the duration follows from the shape."""
    continuous: bool = False


class DistanceAction(Settings):
    """Keeps a distance to another actor, along or across."""

    kind: Literal["longitudinal_distance", "lateral_distance"]
    to: ActorName
    distance_m: Expression | None = None
    time_gap_s: Expression | None = None
    """Of a longitudinal distance: over the own speed."""
    freespace: bool = False
    continuous: bool = False
    displacement: Literal["any", "ahead", "behind", "left", "right"] = "any"
    """On which side of the other actor."""
    coordinates: Coordinates = "entity"
    accel_mps2: Expression | None = None
    """Without bounds the distance is reached at once."""
    brake_mps2: Expression | None = None
    speed_mps: Expression | None = None

    @model_validator(mode="after")
    def _one_gap(self) -> Self:
        if self.distance_m is not None and self.time_gap_s is not None:
            raise ConfigError("", "distance_m and time_gap_s", "one of them at most")
        return self


class FinalSpeed(Settings):
    """Speed at the target of a synchronisation, and how long before it is kept."""

    speed: Expression | RelativeTarget
    steady_m: Expression | None = None
    steady_s: Expression | None = None


class SynchroniseAction(Settings):
    """Arrives at a place when another actor arrives at its own."""

    kind: Literal["synchronise"]
    master: ActorName
    master_target: Position
    target: Position
    final_speed: FinalSpeed | None = None
    master_tolerance_m: Expression = 0.0
    tolerance_m: Expression = 0.0


class TrajectoryTiming(Settings):
    """Meaning of the times of a trajectory's points."""

    domain: Literal["absolute", "relative"] = "absolute"
    scale: Expression = 1.0
    offset_s: Expression = 0.0


class FollowTrajectoryAction(Settings):
    """Follows a trajectory, at its own speed or at the times of its points."""

    kind: Literal["follow_trajectory"]
    trajectory: AnyName
    timing: TrajectoryTiming | None = None
    mode: Literal["position", "follow"] = "position"
    from_m: Expression = 0.0
    """Where on the trajectory it begins."""


class AssignRouteAction(Settings):
    """Follows a route from now on."""

    kind: Literal["assign_route"]
    route: AnyName


class AcquirePositionAction(Settings):
    """Drives to a place, by the shortest way."""

    kind: Literal["acquire_position"]
    position: Position


class TeleportAction(Settings):
    """Is moved to a place."""

    kind: Literal["teleport"]
    position: Position


class VisibilityAction(Settings):
    """Appears to traffic and sensors, or vanishes."""

    kind: Literal["visibility"]
    traffic: bool
    sensors: bool


class DeleteAction(Settings):
    """Leaves the scenario."""

    kind: Literal["delete"]
    actor: ActorName | None = None
    """Without it the actors of the group."""


class VariableAction(Settings):
    """Sets or changes a variable; a truth value is 1 or 0."""

    kind: Literal["variable"]
    variable: ElementName
    value: Expression = 0.0
    word: ElementName | None = None
    """In place of a number."""
    how: Literal["set", "add", "multiply"] = "set"


class NoAction(Settings):
    """Ends at once; stands for an action that has no effect here."""

    kind: Literal["none"]


Action = Annotated[
    SpeedAction
    | SpeedProfileAction
    | LaneChangeAction
    | LaneOffsetAction
    | DistanceAction
    | SynchroniseAction
    | FollowTrajectoryAction
    | AssignRouteAction
    | AcquirePositionAction
    | TeleportAction
    | VisibilityAction
    | DeleteAction
    | VariableAction
    | NoAction,
    Field(discriminator="kind"),
]
