"""From an ODD to the scene space that it bounds.

Source: RISK-SAC, Sec. II-A; ISO 34503 for the ODD's branches.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from risk_sac.config import Behaviour, Environment, Interval, Odd, Precipitation, Scenery, SignalType
from risk_sac.errors import OddError
from risk_sac.scenario.limits import WET_FRICTION, behaving, preset
from risk_sac.scenario.space import Parameter, SceneSpace

TINY = 1e-6  # in any unit; SUMO refuses a speed of 1e-320
LEAST_ACCEL_MPS2 = 0.1  # below it an actor that has stopped never starts again
# Field whose bounds hold to either side → least high end that leaves an actor able to move.
EITHER_SIDE = {
    "dynamic.vehicle_jerk_mps3": 1.0,  # braking of 4 m/s² builds up in 4 s
    "dynamic.vehicle_lateral_speed_mps": 0.0,  # a vehicle may keep to its lane
    "dynamic.vehicle_lateral_accel_mps2": LEAST_ACCEL_MPS2,
    "dynamic.pedestrian_turn_radps": 0.1,
}

# What every value of a field must lie in; an ODD outside it describes no road on Earth.
SENSIBLE: dict[str, Interval] = {
    "scenery.lanes": Interval(low=1, high=10),
    "scenery.speed_limit_mps": Interval(low=1, high=60),
    "environment.friction": Interval(low=0.05, high=1.2),
    "environment.visibility_m": Interval(low=1, high=100_000),
    "dynamic.ego_speed_mps": Interval(low=0, high=60),
    "dynamic.vehicle_speed_mps": Interval(low=0, high=60),
    "dynamic.vehicle_accel_mps2": Interval(low=-12, high=12),
    "dynamic.vehicle_jerk_mps3": Interval(low=0, high=50),
    "dynamic.vehicle_lateral_speed_mps": Interval(low=0, high=1.8),
    "dynamic.vehicle_lateral_accel_mps2": Interval(low=0, high=3),
    "dynamic.pedestrian_speed_mps": Interval(low=0, high=10),
    "dynamic.pedestrian_accel_mps2": Interval(low=-10, high=10),
    "dynamic.pedestrian_turn_radps": Interval(low=0, high=10),
}

FRICTION = Interval(low=0.4, high=1.0)
"""Least, on worn tyres in heavy rain, and greatest friction that is simulated."""

# Widest values that every family supports if a campaign asks for them; a family's defaults are usual values.
EXTREME: dict[str, Interval | tuple[str, ...]] = {
    "environment.friction": FRICTION,
    "environment.visibility_m": Interval(low=40, high=2000),
    "environment.precipitation": ("heavy_rain", "none", "rain"),
    "environment.time_of_day": ("day", "night"),
    **{f"dynamic.{name}": interval for name, interval in preset("extreme").items()},
}

SIGNAL_OF: Mapping[str, SignalType] = {"zebra": "none", "signalised": "fixed_time"}
"""Kind of crossing → the kind of signal that an ego meets there."""


def intersect(default: Odd, user: Odd, space: SceneSpace | None = None) -> Odd:
    """Intersects a family's default ODD with the user's, field by field.

    The user's narrows the default, or widens a field of `EXTREME` up to that; a field left out keeps the default's.
    The default's limits of adversaries are those of the user's behaviour where that is the wider one.

    Args:
      default: of the family.
      user: as posted.
      space: of the family; messages state the values of the scene parameters that a field bounds, as `narrow` does.

    Raises:
      OddError: a field of the user's is physically senseless, or leaves nothing of what the family supports.
    """
    check(user)
    behaviour, dynamic = wider_behaviour(default, user), default.dynamic
    if behaviour != dynamic.behaviour:
        dynamic = behaving(dynamic, behaviour)
    default, limits = default.model_copy(update={"dynamic": dynamic}), widest(default)
    return Odd(
        scenery=_with_their_signals(_intersect_branch("scenery", default, user, limits)),
        environment=_rained_on(_intersect_branch("environment", default, user, limits), user.environment),
        dynamic=_intersect_branch("dynamic", default, user, limits, space),
    )


def wider_behaviour(default: Odd, user: Odd) -> Behaviour:
    """Returns the behaviour that allows more: the scenario's or the campaign's."""
    return max((default.dynamic.behaviour, user.dynamic.behaviour), key=get_args(Behaviour).index)


def widest(default: Odd) -> Odd:
    """Returns the most that users may ask of families with this default."""
    for path, extreme in EXTREME.items():
        branch, name = path.split(".")
        if name == "time_of_day" and "pedestrian" not in (default.dynamic.actor_kinds or ()):
            continue  # vehicles carry lights: night would change nothing
        widened = getattr(default, branch).model_copy(update={name: extreme})
        default = default.model_copy(update={branch: widened})
    return default


def check(odd: Odd) -> None:
    """Raises `OddError` for an ODD that contradicts physics, whatever the family."""
    for path, sensible in SENSIBLE.items():
        interval = field(odd, path)
        if interval is not None and not (interval.low in sensible and interval.high in sensible):
            raise _error(path, interval, f"bounds within {text_of(sensible)}")
        if interval is not None and any(0 < abs(bound) < TINY for bound in (interval.low, interval.high)):
            raise _error(path, interval, f"bounds that are 0 or at least {TINY:g} in size")
    for path in ("dynamic.vehicle_accel_mps2", "dynamic.pedestrian_accel_mps2"):
        interval = field(odd, path)
        if interval is not None and not (interval.low <= -LEAST_ACCEL_MPS2 and interval.high >= LEAST_ACCEL_MPS2):
            wanted = f"low <= -{LEAST_ACCEL_MPS2:g} and high >= {LEAST_ACCEL_MPS2:g}"
            raise _error(path, interval, f"{wanted}, so that actors can both brake and accelerate")
    for path, least in EITHER_SIDE.items():
        interval = field(odd, path)
        if interval is not None and (interval.low > 0 or interval.high < least):
            wanted = f"a low of 0 and a high of at least {least:g}"
            raise _error(path, interval, wanted, "the bounds hold to either side; a lateral speed of 0 forbids moving")
    for path in paths(odd):
        if field(odd, path) == ():
            raise _error(path, (), "at least one kind, or the field left out")


def narrow(space: SceneSpace, odd: Odd) -> SceneSpace:
    """Narrows a space to the ODD; raises `OddError` if nothing is left."""
    bounds = {}
    for parameter in space.parameters:
        allowed = field(odd, parameter.odd) if parameter.odd else None
        if allowed is None:
            continue
        interval = _share(parameter, allowed) if parameter.categories else allowed
        if interval is None or interval.low > parameter.high or interval.high < parameter.low:
            raise _no_scene(str(parameter.odd), allowed, space)
        bounds[parameter.name] = interval
    return space.narrow(bounds)


def paths(odd: Odd) -> Iterator[str]:
    """The fields of an ODD, each as `branch.name`."""
    for branch in type(odd).model_fields:
        yield from (f"{branch}.{name}" for name in type(getattr(odd, branch)).model_fields)


def field(odd: Odd, path: str) -> Any:
    """Returns the value of an ODD field, such as "dynamic.ego_speed_mps"."""
    branch, name = path.split(".")
    return getattr(getattr(odd, branch), name)


def _share(parameter: Parameter, allowed: tuple[str, ...]) -> Interval | None:
    """Returns the part of a parameter's bounds with allowed categories, or None."""
    middle = (parameter.low + parameter.high) / 2  # belongs to the upper half
    lower, upper = (category in allowed for category in parameter.categories)
    if not lower and not upper:
        return None
    return Interval(
        low=parameter.low if lower else middle, high=parameter.high if upper else math.nextafter(middle, parameter.low)
    )


def _intersect_branch(branch: str, default: Odd, user: Odd, limits: Odd, space: SceneSpace | None = None) -> Any:
    values = {}
    usual, asked, ours = (getattr(odd, branch) for odd in (default, user, limits))
    for name in type(usual).model_fields:
        theirs, supported = getattr(asked, name), getattr(ours, name)
        if theirs is None or supported is None or name == "behaviour":
            values[name] = getattr(usual, name) if theirs is None or name == "behaviour" else theirs
            continue
        values[name] = common = _common(supported, theirs)
        bounded = [each for each in space.parameters if each.odd == f"{branch}.{name}"] if space else []
        if space and not all(_common(Interval(low=each.low, high=each.high), theirs) for each in bounded):
            raise _no_scene(f"{branch}.{name}", theirs, space)
        if not common:
            raise _error(f"{branch}.{name}", theirs, f"an overlap with {text_of(supported)}, which the family supports")
    return type(usual)(**values)


def _with_their_signals(scenery: Scenery) -> Scenery:
    """Keeps the crossings whose signal the ODD allows; a zebra has none."""
    signals, crossings = scenery.signal_types, scenery.crossing_types
    if signals is None or crossings is None:
        return scenery
    left = tuple(kind for kind in crossings if SIGNAL_OF.get(kind, signals[0]) in signals)
    if not left:
        expected = f"a crossing that goes with the signal_types {text_of(signals)}"
        raise _error("scenery.crossing_types", crossings, expected, "zebra goes with none, signalised with fixed_time")
    return scenery.model_copy(update={"crossing_types": left})


def _rained_on(environment: Environment, user: Environment) -> Environment:
    """Bounds the friction by the kinds of precipitation that a user states."""
    friction = environment.friction
    if user.precipitation is None or friction is None:
        return environment
    bounds = [
        _friction_in(kind, friction, stated=user.friction is not None) for kind in environment.precipitation or ()
    ]
    hull = Interval(low=min(each.low for each in bounds), high=max(each.high for each in bounds))
    return environment.model_copy(update={"friction": hull})


def _friction_in(precipitation: Precipitation, friction: Interval, *, stated: bool) -> Interval:
    wet = WET_FRICTION.get(precipitation)
    if wet is None:
        return friction
    common: Interval | None = _common(wet, friction) if stated else wet
    if common is None:
        expected = f"an overlap with {text_of(wet)}, the friction in {precipitation}"
        raise _error("environment.friction", friction, expected, "leave friction or that precipitation out")
    return common


def _common(ours: Any, theirs: Any) -> Any:
    """Intersects two intervals or two sets; returns None or () if empty."""
    if isinstance(ours, Interval):
        low, high = max(ours.low, theirs.low), min(ours.high, theirs.high)
        return Interval(low=low, high=high) if low <= high else None
    return tuple(kind for kind in ours if kind in theirs)


def _no_scene(path: str, got: Any, space: SceneSpace) -> OddError:
    """Returns the error of a field that leaves a parameter no value."""
    names: dict[str, list[str]] = {}
    for parameter in space.parameters:
        if parameter.odd == path:
            supported = parameter.categories or Interval(low=parameter.low, high=parameter.high)
            names.setdefault(text_of(supported), []).append(repr(parameter.name))
    bounds = " and with ".join(
        f"{values}, the values of scene parameter {' and '.join(of)}" for values, of in names.items()
    )
    return _error(path, got, f"an overlap with {bounds} in the {space.family!r} family")


def _error(path: str, got: Any, wanted: str, remedy: str = "") -> OddError:
    return OddError(f"odd.{path}", text_of(got), wanted, remedy)


def text_of(value: Any) -> str:
    """A word, an interval or a set, as messages write it."""
    if isinstance(value, str):
        return value
    return f"[{value.low:g}, {value.high:g}]" if isinstance(value, Interval) else f"{{{', '.join(value)}}}"
