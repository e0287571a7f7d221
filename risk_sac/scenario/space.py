"""Scene space of a family: its named, bounded parameters ξ.

Also the grid of their steps.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from risk_sac.config import Interval
from risk_sac.config.base import Chosen
from risk_sac.config.scenario import AllOf, AnyOf, Constraint, ScenarioParameter
from risk_sac.config.values import Comparison, Expression, comparison, term
from risk_sac.errors import ConfigError, SceneError
from risk_sac.world.types import Floats, Scene

POOL = 4096  # points among which one is looked for that keeps all constraints


@dataclass(frozen=True, slots=True)
class Parameter:
    """One scene parameter and its bounds."""

    name: str
    unit: str
    low: float
    high: float
    meaning: str
    odd: str | None = None  # the ODD field that bounds it too, such as "dynamic.vehicle_speed_mps"
    categories: tuple[str, ...] = ()  # where that field is a set: what the lower and the upper half stand for

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low <= self.high):
            raise SceneError(
                f"parameter {self.name!r} has bounds [{self.low:g}, {self.high:g}]; wanted finite low <= high"
            )
        # Of three, an ODD could leave out the middle one, and a box has no holes.
        if len(self.categories) not in (0, 2):
            raise SceneError(f"parameter {self.name!r} has categories {self.categories}; wanted none or two")


@dataclass(frozen=True)
class SceneSpace:
    """A box of scenes, and the constraints that they keep."""

    family: str
    parameters: tuple[Parameter, ...]
    holds: Callable[[Mapping[str, float]], bool] | None = field(default=None, compare=False)
    """Whether the values of a scene keep the scenario's constraints; None: it has none."""

    @property
    def dimension(self) -> int:
        """Number of parameters, `d`."""
        return len(self.parameters)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameter names, in the order of the unit cube's axes."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def low(self) -> Floats:
        """Lower bounds, `d`."""
        return np.array([parameter.low for parameter in self.parameters])

    @cached_property
    def high(self) -> Floats:
        """Upper bounds, `d`."""
        return np.array([parameter.high for parameter in self.parameters])

    def from_unit(self, point: Floats) -> Scene:
        """Returns the scene at a unit point, `d`; raises `SceneError` for others."""
        point = np.asarray(point, dtype=np.float64)
        if point.shape != (self.dimension,):
            raise SceneError(f"point has shape {point.shape}; the {self.family!r} family wants ({self.dimension},)")
        if not np.all((point >= 0) & (point <= 1)):  # NaN fails both
            raise SceneError(f"point is {point.tolist()}; wanted every coordinate in [0, 1]")
        values = np.minimum(self.low + point * (self.high - self.low), self.high)  # rounding may pass the bound
        return Scene(self.family, dict(zip(self.names, values.tolist(), strict=True)))

    def allows(self, point: Floats) -> bool:
        """Whether the scene at a unit point, `d`, keeps the constraints."""
        return self.holds is None or self.holds(self.from_unit(point).values)

    def nearest_allowed(self, point: Floats) -> Floats:
        """Returns the point, `d`, or the pool's nearest that keeps the constraints.

        Raises:
          SceneError: no point of the pool does.
        """
        if self.allows(point):
            return point
        if not len(self._allowed):
            raise SceneError(f"none of {POOL} scenes of {self.family!r} keeps the constraints")
        nearest: Floats = self._allowed[((self._allowed - point) ** 2).sum(axis=1).argmin()]
        return nearest

    @cached_property
    def _allowed(self) -> Floats:
        """Points of a fixed pool that keep the constraints, `n x d`."""
        points = np.random.default_rng(0).random((POOL, self.dimension))
        return points[[self.allows(point) for point in points]]

    def to_unit(self, scene: Scene) -> Floats:
        """Maps a scene to a unit point, `d`; constant parameters to 0."""
        self.check(scene)
        offset = np.array([scene.values[name] for name in self.names]) - self.low
        width = self.high - self.low
        return np.clip(np.divide(offset, width, out=np.zeros_like(offset), where=width > 0), 0.0, 1.0)

    def check(self, scene: Scene) -> None:
        """Raises `SceneError` for a scene that is no point of this space."""
        if scene.family != self.family:
            raise SceneError(f"scene is of family {scene.family!r}; wanted {self.family!r}")
        if scene.values.keys() != set(self.names):
            unknown, missing = sorted(scene.values.keys() - set(self.names)), sorted(self.names - scene.values.keys())
            raise SceneError(f"scene has unknown parameters {unknown} and lacks {missing}; wanted {list(self.names)}")
        for parameter in self.parameters:
            value = scene.values[parameter.name]
            if not parameter.low <= value <= parameter.high:  # NaN is in no interval
                raise SceneError(
                    f"{parameter.name} is {value:g} {parameter.unit}; "
                    f"the {self.family!r} family allows [{parameter.low:g}, {parameter.high:g}]"
                )

    def narrow(self, bounds: Mapping[str, Interval]) -> "SceneSpace":
        """Narrows the space to bounds by parameter; raises `SceneError` if empty."""
        if unknown := sorted(bounds.keys() - set(self.names)):
            raise SceneError(f"unknown parameters {unknown}; the {self.family!r} family has {list(self.names)}")
        return replace(self, parameters=tuple(_narrowed(p, bounds.get(p.name)) for p in self.parameters))


def _narrowed(parameter: Parameter, bounds: Interval | None) -> Parameter:
    if bounds is None:
        return parameter
    low, high = max(parameter.low, bounds.low), min(parameter.high, bounds.high)
    if low > high:
        raise SceneError(
            f"{parameter.name} is bounded to [{bounds.low:g}, {bounds.high:g}] {parameter.unit}; "
            f"wanted an overlap with [{parameter.low:g}, {parameter.high:g}]"
        )
    return replace(parameter, low=low, high=high)


class Value(NamedTuple):
    """Values and words of a scene's parameters."""

    numbers: Mapping[str, float]
    words: Mapping[str, str]

    def of(self, expression: Expression, path: str = "") -> float:
        """Evaluates an expression; raises `ConfigError` with its path if undefined."""
        try:
            return term(expression).value(self.numbers)
        except ConfigError as error:
            raise ConfigError(path, error.got, error.expected, error.remedy) from error

    def choose(self, choice: Any) -> Any:
        """Resolves a choice by a parameter's word; returns anything else unchanged."""
        return choice.of[self.words[choice.by]] if isinstance(choice, Chosen) else choice

    def word(self, name: Any) -> Any:
        """Returns the word of a parameter of this name, or the name."""
        name = self.choose(name)
        return self.words.get(name, name)

    def holds(self, constraint: Constraint) -> bool:
        """Whether a constraint holds."""
        if isinstance(constraint, AllOf):
            return all(map(self.holds, constraint.all))
        if isinstance(constraint, AnyOf):
            return any(map(self.holds, constraint.any))
        return self.true(constraint)

    def true(self, text: Comparison) -> bool:
        """Whether a comparison holds."""
        return bool(comparison(text).value(self.numbers))


DEFAULT_LEVELS = 5  # of a range without a step; choice
SLACK = 1e-9  # share of a step by which rounding may miss the upper bound
DIGITS = 12  # significant ones of a level, so that 3 · 0.1 is 0.3


class GridAxis(NamedTuple):
    """Values of one parameter on the grid."""

    name: str
    size: int
    low: float  # first value
    step: float  # 0 where there is one value
    stated: bool  # whether the scenario states them; else `DEFAULT_LEVELS` spread over the range

    def level(self, number: int) -> float:
        """The value with a number, from 0."""
        return float(f"{self.low + number * self.step:.{DIGITS}g}")

    def nearest(self, value: float) -> int:
        """The number of the level nearest to a value."""
        return 0 if self.step == 0.0 else min(max(round((value - self.low) / self.step), 0), self.size - 1)


@dataclass(frozen=True)
class Grid:
    """All combinations of the axes' values."""

    axes: tuple[GridAxis, ...]

    @cached_property
    def size(self) -> int:
        """Number of points."""
        return math.prod(axis.size for axis in self.axes)

    def values(self, number: int) -> dict[str, float]:
        """Returns a numbered point's values by parameter; raises `IndexError` beyond the last."""
        return self.of_levels(self.levels(number))

    def levels(self, number: int) -> tuple[int, ...]:
        """Returns a numbered point's level on each axis; raises `IndexError` beyond."""
        if not 0 <= number < self.size:
            raise IndexError(f"point {number} of a grid of {self.size}")
        levels = []
        for axis in reversed(self.axes):
            number, level = divmod(number, axis.size)
            levels.append(level)
        return tuple(reversed(levels))

    def number(self, levels: tuple[int, ...]) -> int:
        """The number of the point with these levels."""
        number = 0
        for axis, level in zip(self.axes, levels, strict=True):
            number = number * axis.size + level
        return number

    def of_levels(self, levels: tuple[int, ...]) -> dict[str, float]:
        """Parameter → value at these levels."""
        return {axis.name: axis.level(level) for axis, level in zip(self.axes, levels, strict=True)}

    @property
    def unstated(self) -> tuple[str, ...]:
        """Parameters whose values the scenario does not state."""
        return tuple(axis.name for axis in self.axes if not axis.stated)


def grid_of(space: SceneSpace, parameters: Mapping[str, ScenarioParameter]) -> Grid:
    """Makes the grid of a scene space that an ODD narrowed.

    A parameter that the document lacks has a range without step.

    Raises:
      ConfigError: the ODD leaves none of a parameter's values.
    """
    return Grid(tuple(_axis(parameter, parameters.get(parameter.name)) for parameter in space.parameters))


def _axis(parameter: Parameter, stated: ScenarioParameter | None) -> GridAxis:
    low, high = parameter.low, parameter.high
    if stated is not None and stated.alternatives:
        first, step = 0.5 / stated.alternatives, 1.0 / stated.alternatives
    elif stated is not None and stated.step is not None and stated.range is not None:
        first, step = stated.range[0], stated.step
    elif low == high:
        return GridAxis(parameter.name, 1, low, 0.0, True)
    else:
        return GridAxis(parameter.name, DEFAULT_LEVELS, low, (high - low) / (DEFAULT_LEVELS - 1), False)
    below = max(math.ceil((low - first) / step - SLACK), 0)
    last = math.floor((high - first) / step + SLACK)
    if stated.range is not None:
        last = min(last, math.floor((stated.range[1] - first) / step + SLACK))
    if last < below:
        got = f"{parameter.name} from {low:g} to {high:g}, where none of its values lies"
        raise ConfigError("odd", got, f"one of {first:g}, {first + step:g} and so on")
    count = last - below + 1
    return GridAxis(parameter.name, count, first + below * step, step if count > 1 else 0.0, True)
