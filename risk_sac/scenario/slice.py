"""Slice of a scene space: some parameters vary, the others are fixed or drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from risk_sac.config.campaign import BoundaryConfig
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.scenario.declared import SceneLaw
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.world.types import Floats


@dataclass(frozen=True)
class Slice:
    """The part of a scene space that a boundary is sought in."""

    space: SceneSpace
    config: BoundaryConfig
    parameters: Mapping[str, ScenarioParameter]  # of the scenario's document

    @cached_property
    def axes(self) -> tuple[Parameter, ...]:
        """The parameters that vary, `k`."""
        return tuple(self.space.parameters[i] for i in self.columns)

    @cached_property
    def columns(self) -> tuple[int, ...]:
        """Their places among all parameters of the space."""
        return tuple(self.space.names.index(name) for name in self.config.over)

    @cached_property
    def fixed(self) -> Mapping[str, float]:
        """Value of each parameter that is the same in all scenes, in the space's units."""
        chosen = {name: self._value(name) for name in self.config.at}
        if self.config.others == "fixed":
            chosen |= {name: self._drawn(name, 0.5) for name in self.space.names if name not in chosen}
        return {name: value for name, value in chosen.items() if name not in self.config.over}

    def whole(self, point: Floats, random: np.random.Generator) -> Floats:
        """The point of the space's unit cube, `d`, at a point of the slice's, `k`."""
        values = {name: self._drawn(name, random.random()) for name in self.space.names} | dict(self.fixed)
        width = self.space.high - self.space.low
        offset = np.array([values[name] for name in self.space.names]) - self.space.low
        unit = np.clip(np.divide(offset, width, out=np.zeros_like(offset), where=width > 0), 0.0, 1.0)
        unit[list(self.columns)] = point
        return np.asarray(unit)

    def units(self, scene: Mapping[str, float]) -> Floats:
        """The slice's unit coordinates of a scene, `k`."""
        return np.array([(scene[axis.name] - axis.low) / (axis.high - axis.low) for axis in self.axes])

    def check(self) -> None:
        """Refuses parameters over which there is no boundary.

        Raises:
          ConfigError: a name is unknown, or stands for words or a constant; a value is out of its range.
        """
        known = [*self.space.names]
        for field, names in (("over", self.config.over), ("at", self.config.at)):
            for name in names:
                if name in known:
                    continue
                if name in self.parameters:
                    raise ConfigError(f"boundary.{field}", f"{name}, which is a constant", "a parameter with a range")
                varying = ", ".join(known)
                raise ConfigError(f"boundary.{field}", repr(name), f"one of {varying}", did_you_mean(name, known))
        for name, axis in zip(self.config.over, self.axes, strict=True):
            if name in self.parameters and self.parameters[name].alternatives:
                raise ConfigError("boundary.over", f"{name}, which has words or rows", "parameters with a range")
            if axis.low == axis.high:
                got = f"{name}, which is {axis.low:g} in all scenes"
                raise ConfigError("boundary.over", got, "parameters whose range the ODD leaves open")
        for name in self.config.at:
            self._value(name)

    def _value(self, name: str) -> float:
        """The number that `at` gives a parameter; a word's is the middle of its part of the axis."""
        given, parameter = self.config.at[name], self.space.parameters[self.space.names.index(name)]
        document = self.parameters.get(name)
        words = () if document is None else document.words or ()
        if words:
            if given not in words:
                raise ConfigError(f"boundary.at.{name}", repr(given), f"one of {', '.join(words)}")
            return (words.index(str(given)) + 0.5) / len(words)
        if not isinstance(given, float | int) or not parameter.low <= given <= parameter.high:
            raise ConfigError(f"boundary.at.{name}", repr(given), f"{parameter.low:g} to {parameter.high:g}")
        return float(given)

    @cached_property
    def _law(self) -> SceneLaw:
        return SceneLaw.of(self.space, self.parameters, None)

    def _drawn(self, name: str, share: float) -> float:
        """The value at a share of the parameter's distribution, within the space."""
        axis = self._law.axes[self.space.names.index(name)]
        return axis.low + axis.unit(share) * (axis.high - axis.low)
