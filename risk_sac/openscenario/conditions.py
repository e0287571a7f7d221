"""Conditions and triggers of the storyboard."""

from collections.abc import Callable, Mapping
from typing import Any

from risk_sac.config import story as when
from risk_sac.config.story_actions import Position
from risk_sac.config.values import MOST_MAGNITUDE
from risk_sac.openscenario.actions import COORDINATES, RULES, Variables
from risk_sac.openscenario.entities import Entities
from risk_sac.openscenario.positions import Positions
from risk_sac.openscenario.scope import At
from risk_sac.openscenario.sources import Unread

_EDGES = {name: name for name in ("none", "rising", "falling")} | {"risingOrFalling": "rising_or_falling"}
_WHICH = {"any": "any", "all": "all"}
_ALONG = {"longitudinal": "longitudinal", "lateral": "lateral", "euclidianDistance": "euclidean"}
_ALONG |= {"cartesianDistance": "euclidean", "euclideanDistance": "euclidean"}
_DIRECTIONS = {name: name for name in ("longitudinal", "lateral", "vertical")}
_KINDS = {name: name for name in ("story", "act", "maneuver", "event", "action")} | {"maneuverGroup": "maneuver_group"}
_STATES = {f"{name}State": name for name in ("standby", "running", "complete")}
_STATES |= {f"{name}Transition": name for name in ("start", "end", "stop", "skip")}
_READ = "a condition on time, distance, speed, place, collision, state, a variable or a parameter"
_NEVER = "the condition never holds"


class ConditionReader:
    """Reads conditions and triggers."""

    def __init__(self, positions: Positions, entities: Entities, variables: Variables, remarks: list[str]) -> None:
        """Prepares to read; conditions that are not read are added to `remarks`."""
        self._positions, self._entities, self._variables, self._remarks = positions, entities, variables, remarks
        self._of_entities: Mapping[str, tuple[type[Any], Callable[[At], dict[str, Any]]]] = {
            "TimeHeadwayCondition": (when.HeadwayCondition, lambda at: self._to(at) | self._measured(at)),
            "TimeToCollisionCondition": (when.CollisionTimeCondition, self._collision_time),
            "AccelerationCondition": (when.AccelerationCondition, _directed),
            "StandStillCondition": (when.StandStillCondition, _lasting),
            "SpeedCondition": (when.SpeedCondition, _directed),
            "RelativeSpeedCondition": (when.RelativeSpeedCondition, lambda at: _directed(at) | self._to(at)),
            "TraveledDistanceCondition": (when.TravelledCondition, lambda at: {"value": at.number("value")}),
            "ReachPositionCondition": (
                when.ReachCondition,
                lambda at: {"position": self._place(at), "tolerance_m": at.number("tolerance")},
            ),
            "DistanceCondition": (when.DistanceCondition, lambda at: {"to": self._place(at)} | self._measured(at)),
            "RelativeDistanceCondition": (when.DistanceCondition, lambda at: self._to(at) | self._measured(at)),
            "CollisionCondition": (when.CollisionCondition, self._touched),
            "AngleCondition": (when.AngleCondition, _angle),
            "OffroadCondition": (when.OffroadCondition, lambda at: {"kind": "offroad"} | _lasting(at)),
            "EndOfRoadCondition": (when.OffroadCondition, lambda at: {"kind": "end_of_road"} | _lasting(at)),
        }
        """Element → model, and what reads the fields that other conditions do not have."""

    def trigger(self, at: At | None) -> when.Trigger | None:
        """Reads a `StartTrigger` or `StopTrigger`; None if absent or without groups."""
        if at is None:
            return None
        groups = tuple(tuple(map(self._condition, group.all("Condition"))) for group in at.all("ConditionGroup"))
        return tuple(group for group in groups if group) or None

    def _condition(self, at: At) -> when.Condition:
        common = {
            "name": at.constant("name", "condition")[:200] or "condition",
            "delay_s": at.number_or("delay", 0.0),
            "edge": at.one_of("conditionEdge", _EDGES, "none"),
        }
        holder = at.one("ByEntityCondition", "ByValueCondition")
        try:
            condition: when.Condition
            if holder.tag == "ByEntityCondition":
                condition = self._by_entity(holder, common)
            else:
                condition = self._by_value(holder, common)
        except Unread as error:
            self._remarks.append(f"{error.field}: not read; {error.effect}")
            return at.build(when.TimeCondition, rule="greater", value=MOST_MAGNITUDE, **common)
        return condition

    def _by_value(self, holder: At, common: dict[str, Any]) -> when.Condition:
        if (at := holder.maybe("SimulationTimeCondition")) is not None:
            return at.build(when.TimeCondition, rule=at.one_of("rule", RULES), value=at.number("value"), **common)
        if (at := holder.maybe("StoryboardElementStateCondition")) is not None:
            return at.build(
                when.StateCondition,
                element=at.constant("storyboardElementRef"),
                of_kind=at.one_of("storyboardElementType", _KINDS),
                state=at.one_of("state", _STATES),
                **common,
            )
        if (at := holder.maybe("VariableCondition", "ParameterCondition")) is not None:
            return self._variables.condition(at, common)
        raise _unread(holder)

    def _by_entity(self, holder: At, common: dict[str, Any]) -> when.Condition:
        triggering = holder.one("TriggeringEntities")
        names = [name for ref in triggering.all("EntityRef") for name in self._entities.members(ref)]
        common |= {
            "of": tuple(dict.fromkeys(names)),
            "which": triggering.one_of("triggeringEntitiesRule", _WHICH, "any"),
        }
        if not names:
            raise triggering.refusal("no entity", "an EntityRef at least")
        inner = holder.one("EntityCondition")
        at = inner.only("conditions")
        if at.tag not in self._of_entities:
            raise _unread(inner)
        model, fields = self._of_entities[at.tag]
        condition: when.Condition = at.build(model, **fields(at), **common)
        return condition

    def _to(self, at: At) -> dict[str, Any]:
        return {"to": self._entities.named(at)}

    def _place(self, at: At) -> Position:
        return self._positions.position(at.one("Position"))

    def _measured(self, at: At) -> dict[str, Any]:
        fields = _compared(at) | {"freespace": at.flag("freespace", False)}
        fields["coordinates"] = at.one_of("coordinateSystem", COORDINATES, "entity")
        if at.flag("alongRoute", False):  # of version 1.0
            fields |= {"coordinates": "lane"}
        return fields | {"along": at.one_of("relativeDistanceType", _ALONG, "euclidianDistance")}

    def _collision_time(self, at: At) -> dict[str, Any]:
        goal = at.one("TimeToCollisionConditionTarget")
        place = goal.maybe("Position")
        to = self._positions.position(place) if place is not None else self._entities.named(goal.one("EntityRef"))
        return {"to": to} | self._measured(at)

    def _touched(self, at: At) -> dict[str, Any]:
        if (partner := at.maybe("EntityRef")) is not None:
            return {"partner": self._entities.named(partner)}
        for by_type in at.all("ByType", "ByObjectType"):  # any partner: what is touched is nearly always the one meant
            by_type.element.use_all()
            self._remarks.append(f"{by_type.element.place}: not read; a contact with any actor counts")
        return {}


def _compared(at: At) -> dict[str, Any]:
    return {"rule": at.one_of("rule", RULES), "value": at.number("value")}


def _directed(at: At) -> dict[str, Any]:
    along = {"direction": at.one_of("direction", _DIRECTIONS)} if "direction" in at.element.attributes else {}
    return _compared(at) | along


def _lasting(at: At) -> dict[str, Any]:
    return {"duration_s": at.number("duration")}


def _angle(at: At) -> dict[str, Any]:
    if at.constant("angleType") != "heading":
        raise at.unread("angleType heading", _NEVER)
    relative = at.constant("coordinateSystem", "world") in ("lane", "road", "trajectory")
    return {"angle_rad": at.number("angle"), "tolerance_rad": at.number("angleTolerance"), "relative": relative}


def _unread(holder: At) -> Unread:
    for child in holder.element.children:
        child.use_all()
    inner = At(holder.element.children[0], holder.scope) if holder.element.children else holder
    return inner.unread(_READ, _NEVER)
