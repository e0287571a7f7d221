"""Actions of the storyboard."""

from collections.abc import Callable, Mapping
from typing import Any

from risk_sac.config import story_actions as act
from risk_sac.config.scenario import EGO
from risk_sac.config.story import VariableCondition
from risk_sac.config.values import Expression
from risk_sac.errors import ConfigError
from risk_sac.openscenario.entities import Entities
from risk_sac.openscenario.parameters import TEXTS, Parameters
from risk_sac.openscenario.positions import Positions
from risk_sac.openscenario.scope import At
from risk_sac.openscenario.sources import Unread

RULES = {
    "greaterThan": "greater",
    "greaterOrEqual": "greater_or_equal",
    "lessThan": "less",
    "lessOrEqual": "less_or_equal",
    "equalTo": "equal",
    "notEqualTo": "not_equal",
}


class Variables:
    """Variables, and parameters that actions set, which are variables too."""

    def __init__(self, declarations: list[At], parameters: Parameters) -> None:
        """Reads `VariableDeclaration` elements; raises `ConfigError` for a missing value or duplicate."""
        self.numbers: dict[str, Expression] = {}
        self.words: dict[str, str] = {}
        self._parameters = parameters
        for at in declarations:
            name = at.constant("name")
            if name in self.numbers or name in self.words:
                raise at.refusal(f"the variable {name[:80]!r} once more", "each name once")
            meaning = at.meaning("value")
            if at.constant("variableType") in TEXTS:
                self.words[name] = meaning.text[:200] or "none"
            else:
                self.numbers[name] = at.number("value")

    def action(self, at: At) -> act.VariableAction:
        """Reads a `VariableAction`; a `ParameterAction` makes its parameter a variable."""
        name = self._name(at, "variableRef" if at.tag == "VariableAction" else "parameterRef")
        setting, change = at.maybe("SetAction"), at.maybe("ModifyAction")
        if setting is not None:
            return at.build(act.VariableAction, variable=name, **self._value(setting, name))
        if change is None:
            raise at.refusal("neither SetAction nor ModifyAction", "one of them")
        step = change.one("Rule").one("AddValue", "MultiplyByValue")
        how = "add" if step.tag == "AddValue" else "multiply"
        return at.build(act.VariableAction, variable=name, value=step.number("value"), how=how)

    def _name(self, at: At, attribute: str) -> str:
        name = at.constant(attribute)
        if attribute == "parameterRef":
            self.add(name)
        if name not in self.numbers and name not in self.words:
            raise at.unknown(attribute, name, [*self.numbers, *self.words])
        return name

    def begin(self, actions: list[act.VariableAction]) -> None:
        """Sets variables at time 0; raises `ConfigError` for other changes."""
        for action in actions:
            if action.how != "set":
                raise ConfigError("Init", f"a change of the variable {action.variable!r}", "a SetAction")
            if action.word is not None:
                self.words[action.variable] = action.word
            else:
                self.numbers[action.variable] = action.value

    def add(self, parameter: str) -> None:
        """Makes a variable of a parameter."""
        meaning = self._parameters.meaning(parameter)
        if meaning is not None and meaning.expression is not None:
            self.numbers.setdefault(parameter, meaning.expression)
        elif meaning is not None:
            self.words.setdefault(parameter, meaning.text[:200] or "none")

    def _value(self, at: At, name: str) -> dict[str, Any]:
        if name in self.words:
            return {"word": at.meaning("value").text[:200] or "none"}
        return {"value": at.number("value")}

    def condition(self, at: At, common: dict[str, Any]) -> VariableCondition:
        """Reads a `VariableCondition` or `ParameterCondition`; `common` has all conditions' fields."""
        rule = at.one_of("rule", RULES)
        if at.tag == "VariableCondition":
            name = self._name(at, "variableRef")
            return at.build(
                VariableCondition, kind="variable", variable=name, rule=rule, **self._value(at, name), **common
            )
        name = at.constant("parameterRef")
        meaning = self._parameters.meaning(name)
        if meaning is None:
            raise at.unknown("parameterRef", name, self._parameters.declared)
        fields = {"variable": name, "rule": rule, **common}
        if name in self.numbers or name in self.words:  # an action sets it
            return at.build(VariableCondition, kind="variable", **self._value(at, name), **fields)
        if self._parameters.is_number(name):
            return at.build(VariableCondition, kind="parameter", value=at.number("value"), **fields)
        wanted = at.meaning("value").text
        if meaning.words:
            return at.build(VariableCondition, kind="parameter", word=self._parameters.word(name, wanted), **fields)
        self.words[name] = meaning.text[:200] or "none"  # a constant text, which the document has as a variable alone
        return at.build(VariableCondition, kind="variable", word=wanted[:200] or "none", **fields)


_SHAPES = {name: name for name in ("step", "linear", "sinusoidal", "cubic")}
_BY = {name: name for name in ("time", "rate", "distance")}
_HOW = {name: name for name in ("delta", "factor")}
_MODES = {name: name for name in ("position", "follow")}
COORDINATES = {name: name for name in ("entity", "lane", "road", "trajectory")}
_SIDES = {
    "any": "any",
    "leadingReferencedEntity": "ahead",
    "trailingReferencedEntity": "behind",
    "leftToReferencedEntity": "left",
    "rightToReferencedEntity": "right",
}
_ONLY_EGO = ("ControllerAction", "ActivateControllerAction", "AssignControllerAction")
_EFFECTS = {
    "EnvironmentAction": "weather, light and friction stay as the document has them",
    "AppearanceAction": "lights and animations are not shown",
    "InfrastructureAction": "signals keep the program of the road",
    "TrafficAction": "this traffic does not appear",
    "ParameterAction": "the parameter keeps its value",
    "MonitorAction": "nothing is monitored",
    "TrailerAction": "no trailer is coupled",
    "UserDefinedAction": "the command is not carried out",
    "SetMonitorAction": "nothing is monitored",
}
_READ = "an action on speed, lane, distance, route, place, visibility or a variable"
WAYS = act.AssignRouteAction | act.FollowTrajectoryAction | act.AcquirePositionAction
"""Actions that say where an actor goes; the ego drives there."""
EGO_EFFECT = "the ego drives by itself"


class ActionReader:
    """Reads actions."""

    def __init__(self, positions: Positions, entities: Entities, variables: Variables, remarks: list[str]) -> None:
        """Prepares to read; actions that are not read are added to `remarks`."""
        self._positions, self._entities, self._variables, self._remarks = positions, entities, variables, remarks
        self._readers: Mapping[str, Callable[[At], Any]] = {
            "SpeedAction": self._speed,
            "SpeedProfileAction": self._profile,
            "LaneChangeAction": self._lane_change,
            "LaneOffsetAction": self._lane_offset,
            "LongitudinalDistanceAction": self._distance,
            "LateralDistanceAction": self._distance,
            "SynchronizeAction": self._synchronise,
            "FollowTrajectoryAction": self._follow,
            "AssignRouteAction": lambda at: at.build(act.AssignRouteAction, route=positions.route(at)),
            "AcquirePositionAction": lambda at: at.build(
                act.AcquirePositionAction, position=positions.position(at.one("Position"))
            ),
            "TeleportAction": lambda at: at.build(act.TeleportAction, position=positions.position(at.one("Position"))),
            "VisibilityAction": self._visibility,
        }

    def of_event(self, at: At, actors: tuple[str, ...]) -> act.Action:
        """Reads an event's `Action`; an unread one is reported and does nothing."""
        holder = at.one("PrivateAction", "GlobalAction", "UserDefinedAction")
        if holder.tag == "UserDefinedAction":
            return self._none(holder, _EFFECTS[holder.tag])
        try:
            if holder.tag == "GlobalAction":
                return self.on_all(holder)
            action = self.private(holder)
        except Unread as error:
            return self._reported(error)
        if actors == (EGO,) and not isinstance(action, WAYS | act.NoAction):
            return self._none(holder, EGO_EFFECT)
        return action

    def private(self, holder: At) -> act.Action:
        """Reads an element `PrivateAction`.

        Raises:
          ConfigError: it is wrong.
          Unread: something in it is not read, and matters.
        """
        here = holder
        while here.tag in ("PrivateAction", "LongitudinalAction", "LateralAction", "RoutingAction"):
            here = here.only("actions")
        if here.tag in self._readers:
            action: act.Action = self._readers[here.tag](here)
            return action
        if here.tag in _ONLY_EGO:
            return self._none(here, "controllers are ignored: the ego is the one that is tested")
        if here.tag in _EFFECTS:
            return self._none(here, _EFFECTS[here.tag])
        here.element.use_all()
        raise here.unread(_READ, "the action does nothing")

    def on_all(self, holder: At) -> act.Action:
        """Reads a `GlobalAction`; an unread one is reported and does nothing."""
        here = holder.only("actions")
        if here.tag == "EntityAction":
            if here.maybe("DeleteEntityAction") is not None:
                name = self._entities.named(here)
                return here.build(act.DeleteAction, actor=name)
            here.element.use_all()
            raise here.unread("DeleteEntityAction", "the entity does not appear")
        if here.tag in ("VariableAction", "ParameterAction"):
            return self._variables.action(here)
        return self._none(here, _EFFECTS.get(here.tag, "the action does nothing"))

    def _none(self, at: At, effect: str) -> act.NoAction:
        at.element.use_all()
        return self._reported(at.unread(_READ, effect))

    def _reported(self, error: Unread) -> act.NoAction:
        self._remarks.append(f"{error.field}: not read; {error.effect}")
        return act.NoAction(kind="none")

    # Along

    def _speed(self, at: At) -> act.SpeedAction:
        dynamics = self._dynamics(at.one("SpeedActionDynamics"))
        target = self._target(at.one("SpeedActionTarget"), "TargetSpeed")
        return at.build(act.SpeedAction, target=target, dynamics=dynamics)

    def _target(self, at: At, what: str) -> Any:
        """Reads the child `Absolute…` as a number, `Relative…` as an actor-relative target."""
        if (absolute := at.maybe(f"Absolute{what}")) is not None:
            return absolute.number("value")
        relative = at.one(f"Relative{what}")
        to, value = self._entities.named(relative), relative.number("value")
        if what == "TargetLane":
            return relative.build(act.LaneTarget, to=to, lanes=value)
        how, continuous = relative.one_of("speedTargetValueType", _HOW, "delta"), relative.flag("continuous", False)
        return relative.build(act.RelativeTarget, to=to, value=value, how=how, continuous=continuous)

    def _dynamics(self, at: At) -> act.Dynamics:
        at.constant("followingMode", "position")
        return at.build(
            act.Dynamics,
            shape=at.one_of("dynamicsShape", _SHAPES),
            by=at.one_of("dynamicsDimension", _BY, "time"),
            value=at.number_or("value", 0.0),
        )

    def _profile(self, at: At) -> act.SpeedProfileAction:
        entries = [
            entry.build(act.SpeedEntry, speed=entry.number("speed"), time_s=entry.number_or("time", None))
            for entry in at.all("SpeedProfileEntry")
        ]
        return at.build(
            act.SpeedProfileAction,
            entries=tuple(entries),
            to=self._entities.named(at) if "entityRef" in at.element.attributes else None,
            mode=at.one_of("followingMode", _MODES, "position"),
            **{name: value for name, value in self._bounds(at).items() if name != "speed_mps"},
        )

    def _bounds(self, at: At) -> dict[str, Any]:
        """Bounds of an element with a child `DynamicConstraints`."""
        if (bounds := at.maybe("DynamicConstraints")) is None:
            return {}
        for name in ("maxAccelerationRate", "maxDecelerationRate"):
            bounds.number_or(name, 0.0)
        names = {"accel_mps2": "maxAcceleration", "brake_mps2": "maxDeceleration", "speed_mps": "maxSpeed"}
        return {name: bounds.number_or(attribute, None) for name, attribute in names.items()}

    def _distance(self, at: At) -> act.DistanceAction:
        along = at.tag == "LongitudinalDistanceAction"
        default = "trailingReferencedEntity" if along else "any"
        return at.build(
            act.DistanceAction,
            kind="longitudinal_distance" if along else "lateral_distance",
            to=self._entities.named(at),
            distance_m=at.number_or("distance", None),
            time_gap_s=at.number_or("timeGap", None),
            freespace=at.flag("freespace"),
            continuous=at.flag("continuous"),
            displacement=at.one_of("displacement", _SIDES, default),
            coordinates=at.one_of("coordinateSystem", COORDINATES, "entity"),
            **self._bounds(at),
        )

    def _synchronise(self, at: At) -> act.SynchroniseAction:
        goal = at.maybe("FinalSpeed")
        return at.build(
            act.SynchroniseAction,
            master=self._entities.named(at, "masterEntityRef"),
            master_target=self._positions.position(at.one("TargetPositionMaster")),
            target=self._positions.position(at.one("TargetPosition")),
            final_speed=self._final_speed(goal, at) if goal is not None else None,
            master_tolerance_m=at.number_or("targetToleranceMaster", 0.0),
            tolerance_m=at.number_or("targetTolerance", 0.0),
        )

    def _final_speed(self, at: At, action: At) -> act.FinalSpeed:
        inner = at.one("AbsoluteSpeed", "RelativeSpeedToMaster")
        speed: Any = inner.number("value")
        if inner.tag == "RelativeSpeedToMaster":
            how = inner.one_of("speedTargetValueType", _HOW, "delta")
            speed = inner.build(
                act.RelativeTarget, to=self._entities.named(action, "masterEntityRef"), value=speed, how=how
            )
        holder = inner.maybe("SteadyState") or inner
        metres, seconds = holder.maybe("TargetDistanceSteadyState"), holder.maybe("TargetTimeSteadyState")
        return inner.build(
            act.FinalSpeed,
            speed=speed,
            steady_m=metres.number("distance") if metres is not None else None,
            steady_s=seconds.number("time") if seconds is not None else None,
        )

    # Across

    def _lane_change(self, at: At) -> act.LaneChangeAction:
        return at.build(
            act.LaneChangeAction,
            target=self._target(at.one("LaneChangeTarget"), "TargetLane"),
            offset_m=at.number_or("targetLaneOffset", 0.0),
            dynamics=self._dynamics(at.one("LaneChangeActionDynamics")),
        )

    def _lane_offset(self, at: At) -> act.LaneOffsetAction:
        goal, dynamics = at.one("LaneOffsetTarget"), at.one("LaneOffsetActionDynamics")
        return at.build(
            act.LaneOffsetAction,
            target=self._target(goal, "TargetLaneOffset"),
            shape=dynamics.one_of("dynamicsShape", _SHAPES),
            lateral_mps2=dynamics.number_or("maxLateralAcc", None),
            continuous=at.flag("continuous", False),
        )

    # Ways and places

    def _follow(self, at: At) -> act.FollowTrajectoryAction:
        holder = at.maybe("TrajectoryRef") or at
        times, mode = at.maybe("TimeReference"), at.maybe("TrajectoryFollowingMode")
        timing = times.maybe("Timing") if times is not None else None
        if times is not None:
            times.maybe("None")
        return at.build(
            act.FollowTrajectoryAction,
            trajectory=self._positions.trajectory(holder),
            timing=self._timing(timing) if timing is not None else None,
            mode=mode.one_of("followingMode", _MODES) if mode is not None else "position",
            from_m=at.number_or("initialDistanceOffset", 0.0),
        )

    def _timing(self, at: At) -> act.TrajectoryTiming:
        domains = {"absolute": "absolute", "relative": "relative"}
        return at.build(
            act.TrajectoryTiming,
            domain=at.one_of("domainAbsoluteRelative", domains, "absolute"),
            scale=at.number_or("scale", 1.0),
            offset_s=at.number_or("offset", 0.0),
        )

    def _visibility(self, at: At) -> act.VisibilityAction:
        at.flag("graphics", True)
        return at.build(act.VisibilityAction, traffic=at.flag("traffic"), sensors=at.flag("sensors"))
