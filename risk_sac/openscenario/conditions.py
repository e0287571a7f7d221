"""Conditions and triggers of the storyboard."""

from collections.abc import Callable, Mapping
from typing import Any

from risk_sac.config.story_conditions import (
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
    SpeedCondition,
    StandStillCondition,
    StateCondition,
    TimeCondition,
    TravelledCondition,
    Trigger,
)
from risk_sac.config.values import MOST_MAGNITUDE
from risk_sac.openscenario.actions import COORDINATES
from risk_sac.openscenario.elements import Unread
from risk_sac.openscenario.entities import Entities
from risk_sac.openscenario.positions import Positions
from risk_sac.openscenario.scope import At
from risk_sac.openscenario.variables import RULES, Variables

_EDGES = {
    "none": "none",
    "rising": "rising",
    "falling": "falling",
    "risingOrFalling": "rising_or_falling",
}
_WHICH = {"any": "any", "all": "all"}
_ALONG = {"longitudinal": "longitudinal", "lateral": "lateral", "euclidianDistance": "euclidean"}
_ALONG |= {"cartesianDistance": "euclidean", "euclideanDistance": "euclidean"}
_DIRECTIONS = {name: name for name in ("longitudinal", "lateral", "vertical")}
_KINDS = {
    "story": "story",
    "act": "act",
    "maneuverGroup": "maneuver_group",
    "maneuver": "maneuver",
    "event": "event",
    "action": "action",
}
_STATES = {
    "standbyState": "standby",
    "runningState": "running",
    "completeState": "complete",
    "startTransition": "start",
    "endTransition": "end",
    "stopTransition": "stop",
    "skipTransition": "skip",
}
_READ = "a condition on time, distance, speed, place, collision, state, a variable or a parameter"
_NEVER = "the condition never holds"


class ConditionReader:
    """Reads conditions and triggers."""

    def __init__(self, positions: Positions, entities: Entities, variables: Variables, remarks: list[str]) -> None:
        """Prepares to read.

        Args:
          positions: reads places.
          entities: that conditions name.
          variables: that conditions compare.
          remarks: to which conditions that are not read are added.
        """
        self._positions, self._entities, self._variables, self._remarks = positions, entities, variables, remarks
        self._of_entities: Mapping[str, Callable[[At, dict[str, Any]], Any]] = {
            "TimeHeadwayCondition": self._headway,
            "TimeToCollisionCondition": self._collision_time,
            "AccelerationCondition": self._acceleration,
            "StandStillCondition": self._stand_still,
            "SpeedCondition": self._speed,
            "RelativeSpeedCondition": self._relative_speed,
            "TraveledDistanceCondition": self._travelled,
            "ReachPositionCondition": self._reach,
            "DistanceCondition": self._distance,
            "RelativeDistanceCondition": self._relative_distance,
            "CollisionCondition": self._collision,
            "AngleCondition": self._angle,
            "OffroadCondition": self._offroad,
            "EndOfRoadCondition": self._offroad,
        }

    def trigger(self, at: At | None) -> Trigger | None:
        """Reads a `StartTrigger` or `StopTrigger`; None if it is not there or has no group."""
        if at is None:
            return None
        groups = tuple(tuple(map(self._condition, group.all("Condition"))) for group in at.all("ConditionGroup"))
        return tuple(group for group in groups if group) or None

    def _condition(self, at: At) -> Condition:
        common = {
            "name": at.constant("name", "condition")[:200] or "condition",
            "delay_s": at.number_or("delay", 0.0),
            "edge": at.one_of("conditionEdge", _EDGES, "none"),
        }
        holder = at.one("ByEntityCondition", "ByValueCondition")
        try:
            condition: Condition
            if holder.tag == "ByEntityCondition":
                condition = self._by_entity(holder, common)
            else:
                condition = self._by_value(holder, common)
        except Unread as error:
            self._remarks.append(f"{error.field}: not read; {error.effect}")
            return at.build(TimeCondition, kind="time", rule="greater", value=MOST_MAGNITUDE, **common)
        return condition

    def _by_value(self, holder: At, common: dict[str, Any]) -> Condition:
        if (at := holder.maybe("SimulationTimeCondition")) is not None:
            return at.build(
                TimeCondition, kind="time", rule=at.one_of("rule", RULES), value=at.number("value"), **common
            )
        if (at := holder.maybe("StoryboardElementStateCondition")) is not None:
            return at.build(
                StateCondition,
                kind="state",
                element=at.constant("storyboardElementRef"),
                of_kind=at.one_of("storyboardElementType", _KINDS),
                state=at.one_of("state", _STATES),
                **common,
            )
        if (at := holder.maybe("VariableCondition", "ParameterCondition")) is not None:
            return self._variables.condition(at, common)
        raise _unread(holder)

    def _by_entity(self, holder: At, common: dict[str, Any]) -> Condition:
        triggering = holder.one("TriggeringEntities")
        names = [name for ref in triggering.all("EntityRef") for name in self._entities.members(ref)]
        common |= {
            "of": tuple(dict.fromkeys(names)),
            "which": triggering.one_of("triggeringEntitiesRule", _WHICH, "any"),
        }
        if not names:
            raise triggering.refusal("no entity", "an EntityRef at least")
        inner = holder.one("EntityCondition")
        if len(inner.element.children) != 1:
            raise inner.refusal(f"{len(inner.element.children)} conditions", "one")
        at = At(inner.element.children[0], inner.scope)
        at.element.used = True
        if at.tag not in self._of_entities:
            raise _unread(inner)
        condition: Condition = self._of_entities[at.tag](at, common)
        return condition

    def _compared(self, at: At) -> dict[str, Any]:
        return {"rule": at.one_of("rule", RULES), "value": at.number("value")}

    def _measured(self, at: At, along: str) -> dict[str, Any]:
        """How a distance is measured; `along` where the element does not say."""
        fields = self._compared(at) | {"freespace": at.flag("freespace", False)}
        fields["coordinates"] = at.one_of("coordinateSystem", COORDINATES, "entity")
        if at.flag("alongRoute", False):  # of version 1.0
            fields |= {"coordinates": "lane"}
        return fields | {"along": at.one_of("relativeDistanceType", _ALONG, along)}

    def _headway(self, at: At, common: dict[str, Any]) -> HeadwayCondition:
        measured = self._measured(at, "euclidianDistance")
        return at.build(HeadwayCondition, kind="time_headway", to=self._entities.named(at), **measured, **common)

    def _collision_time(self, at: At, common: dict[str, Any]) -> CollisionTimeCondition:
        goal = at.one("TimeToCollisionConditionTarget")
        place = goal.maybe("Position")
        to = self._positions.position(place) if place is not None else self._entities.named(goal.one("EntityRef"))
        measured = self._measured(at, "euclidianDistance")
        return at.build(CollisionTimeCondition, kind="time_to_collision", to=to, **measured, **common)

    def _distance(self, at: At, common: dict[str, Any]) -> DistanceCondition:
        to = self._positions.position(at.one("Position"))
        measured = self._measured(at, "euclidianDistance")
        return at.build(DistanceCondition, kind="distance", to=to, **measured, **common)

    def _relative_distance(self, at: At, common: dict[str, Any]) -> DistanceCondition:
        measured = self._measured(at, "euclidianDistance")
        return at.build(DistanceCondition, kind="distance", to=self._entities.named(at), **measured, **common)

    def _acceleration(self, at: At, common: dict[str, Any]) -> AccelerationCondition:
        return at.build(
            AccelerationCondition, kind="acceleration", **self._compared(at), **self._direction(at), **common
        )

    def _speed(self, at: At, common: dict[str, Any]) -> SpeedCondition:
        return at.build(SpeedCondition, kind="speed", **self._compared(at), **self._direction(at), **common)

    def _relative_speed(self, at: At, common: dict[str, Any]) -> RelativeSpeedCondition:
        fields = self._compared(at) | self._direction(at) | common
        return at.build(RelativeSpeedCondition, kind="relative_speed", to=self._entities.named(at), **fields)

    def _direction(self, at: At) -> dict[str, Any]:
        return {"direction": at.one_of("direction", _DIRECTIONS)} if "direction" in at.element.attributes else {}

    def _travelled(self, at: At, common: dict[str, Any]) -> TravelledCondition:
        return at.build(TravelledCondition, kind="travelled", value=at.number("value"), **common)

    def _reach(self, at: At, common: dict[str, Any]) -> ReachCondition:
        position = self._positions.position(at.one("Position"))
        return at.build(ReachCondition, kind="reach", position=position, tolerance_m=at.number("tolerance"), **common)

    def _stand_still(self, at: At, common: dict[str, Any]) -> StandStillCondition:
        return at.build(StandStillCondition, kind="stand_still", duration_s=at.number("duration"), **common)

    def _collision(self, at: At, common: dict[str, Any]) -> CollisionCondition:
        if (partner := at.maybe("EntityRef")) is not None:
            return at.build(CollisionCondition, kind="collision", partner=self._entities.named(partner), **common)
        for by_type in at.all("ByType", "ByObjectType"):  # any partner: what is touched is nearly always the one meant
            by_type.element.use_all()
            self._remarks.append(f"{by_type.element.place}: not read; a contact with any actor counts")
        return at.build(CollisionCondition, kind="collision", **common)

    def _angle(self, at: At, common: dict[str, Any]) -> AngleCondition:
        if at.constant("angleType") != "heading":
            raise at.unread("angleType heading", _NEVER)
        return at.build(
            AngleCondition,
            kind="angle",
            angle_rad=at.number("angle"),
            tolerance_rad=at.number("angleTolerance"),
            relative=at.constant("coordinateSystem", "world") in ("lane", "road", "trajectory"),
            **common,
        )

    def _offroad(self, at: At, common: dict[str, Any]) -> OffroadCondition:
        kind = "offroad" if at.tag == "OffroadCondition" else "end_of_road"
        return at.build(OffroadCondition, kind=kind, duration_s=at.number("duration"), **common)


def _unread(holder: At) -> Unread:
    for child in holder.element.children:
        child.use_all()
    inner = At(holder.element.children[0], holder.scope) if holder.element.children else holder
    return inner.unread(_READ, _NEVER)
