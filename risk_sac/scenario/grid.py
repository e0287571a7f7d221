"""Grid of a scene space: the steps of its ranges, and its words and rows, point by point.

A point has a number, in which the last parameter varies fastest. No grid is ever held as a whole.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError
from risk_sac.scenario.space import Parameter, SceneSpace

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
        """Parameter → value of the point with a number; raises `IndexError` beyond the last one."""
        return self.of_levels(self.levels(number))

    def levels(self, number: int) -> tuple[int, ...]:
        """The levels of the point with a number, one for each axis; raises `IndexError` beyond the last one."""
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
    """Makes the grid of a scene space.

    Args:
      space: the scenario's, narrowed by an ODD.
      parameters: of the scenario's document; a parameter of the space that is not among them has a range without step.

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
