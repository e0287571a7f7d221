"""Declared distribution of a scenario's parameters, over the scene space's unit cube.

Independent standard normal numbers s become correlated ones, z = L s, and these shares, Φ(z). A value is where the
parameter's distribution, truncated to the scene space, has that share. L Lᵀ is the copula's correlation matrix.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from statistics import NormalDist

import numpy as np

from risk_sac.config.campaign import BoundaryConfig
from risk_sac.config.distribution import LEAST_MASS, NumberLaw, PoissonLaw, RankCorrelation
from risk_sac.config.scenario import ScenarioParameter
from risk_sac.errors import ConfigError, did_you_mean
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.world.types import Floats

LEAST_SHARE = 1e-12  # of either end, within which a double no longer tells shares apart
WINDOW = 0.02  # of an axis, over which its density is taken; choice
_STANDARD = NormalDist()


@dataclass(frozen=True)
class DeclaredAxis:
    """One parameter's distribution over its axis of the scene space."""

    name: str
    low: float
    high: float
    law: NumberLaw | None  # None: all values alike, or one value

    @property
    def tells(self) -> bool:
        """Whether a value determines its share, so that searches may prefer values."""
        return self.low < self.high and not isinstance(self.law, PoissonLaw)

    def unit(self, share: float) -> float:
        """Returns the coordinate in [0, 1] at a share of the distribution."""
        if self.low == self.high:
            return 0.0
        if self.law is None:
            return share
        value = self.law.quantile(share, self.low, self.high)
        return min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)

    def density(self, unit: float) -> float:
        """Returns the density at a coordinate, relative to the uniform one."""
        if not self.tells or self.law is None:
            return 1.0
        low = min(max(unit - WINDOW / 2.0, 0.0), 1.0 - WINDOW)
        ends = (self.low + end * (self.high - self.low) for end in (low, low + WINDOW))
        return self.law.mass(*ends) / self.law.mass(self.low, self.high) / WINDOW

    def share(self, unit: float) -> float:
        """Returns the share at a coordinate in [0, 1]; inverts `unit`."""
        if self.law is None:
            return unit
        value = self.low + unit * (self.high - self.low)
        return self.law.mass(self.low, value) / self.law.mass(self.low, self.high)


@dataclass(frozen=True)
class SceneLaw:
    """Distribution of the scenes of a space."""

    axes: tuple[DeclaredAxis, ...]
    correlation: RankCorrelation | None = None

    @classmethod
    def of(
        cls, space: SceneSpace, parameters: Mapping[str, ScenarioParameter], correlation: RankCorrelation | None
    ) -> "SceneLaw":
        """The distribution over a scene space that an ODD may have narrowed.

        A parameter that the document lacks, such as friction, has all values alike.

        Raises:
          ConfigError: a distribution has no mass between its parameter's bounds.
        """
        axes = []
        for bounded in space.parameters:
            stated = parameters.get(bounded.name)
            law = None if stated is None or stated.distribution is None else stated.law(bounded.low, bounded.high)
            if law is not None and bounded.low < bounded.high and law.mass(bounded.low, bounded.high) < LEAST_MASS:
                raise ConfigError(
                    f"parameters.{bounded.name}.distribution",
                    f"no mass between {bounded.low:g} and {bounded.high:g}, which the ODD leaves",
                    "bounds that overlap its usual values, {:g} to {:g}".format(*law.usual_range),
                )
            axes.append(DeclaredAxis(bounded.name, bounded.low, bounded.high, law))
        return cls(tuple(axes), correlation)

    @property
    def alike(self) -> bool:
        """Whether all scenes are as likely."""
        return self.correlation is None and all(axis.law is None for axis in self.axes)

    def unit(self, shares: Floats) -> Floats:
        """The point of the unit cube, `d`, at independent uniform numbers, `d`."""
        return shares if self.alike else self.point(np.array([_normal(share) for share in shares]))

    def point(self, normal: Floats) -> Floats:
        """Returns the unit cube's point, `d`, of standard normal numbers, `d`."""
        correlated = np.empty_like(normal)
        correlated[self._order] = self._factor @ normal[self._order]
        pairs = zip(self.axes, correlated.tolist(), strict=True)
        return np.array([axis.unit(_STANDARD.cdf(z)) for axis, z in pairs])

    def normal(self, point: Floats) -> Floats:
        """Returns standard normal numbers, `d`, of a point, `d`; inverts `point`.

        Those of axes that do not tell their share are 0.
        """
        pairs = zip(self.axes, point.tolist(), strict=True)
        correlated = np.array([_normal(axis.share(unit)) if axis.tells else 0.0 for axis, unit in pairs])
        count, normal = int(self.telling.sum()), np.zeros(len(self.axes))
        known = self._order[:count]
        normal[known] = np.linalg.solve(self._factor[:count, :count], correlated[known])
        return normal

    def density(self, point: Floats) -> float:
        """Returns the density at a unit point, `d`, relative to uniform.

        Π_i f_i(x_i) · N(z; 0, L Lᵀ) / Π_i N(z_i; 0, 1)

        Axes that do not tell their share count as uniform.
        """
        margins = math.prod(axis.density(unit) for axis, unit in zip(self.axes, point.tolist(), strict=True))
        if self.correlation is None:
            return margins
        count = int(self.telling.sum())
        factor, normal = self._factor[:count, :count], self.normal(point)[self._order[:count]]
        correlated = factor @ normal
        copula = math.exp(0.5 * float(correlated @ correlated - normal @ normal)) / float(np.prod(np.diag(factor)))
        return margins * copula

    def density_of(self, values: Mapping[str, float]) -> float:
        """Density of a scene by its parameters' values.

        Those beyond the bounds count as on them, and a missing one as the least: a story that nothing disturbs lacks
        its shifts.
        """
        offsets = np.array([values.get(axis.name, axis.low) - axis.low for axis in self.axes])
        widths = np.array([max(axis.high - axis.low, 1e-12) for axis in self.axes])
        return self.density(np.clip(offsets / widths, 0.0, 1.0))

    def normals(self, scenes: Iterable[Mapping[str, float]]) -> Floats:
        """Returns standard normal numbers, `n x t`, of axes that tell shares."""
        low, high = (np.array([getattr(axis, end) for axis in self.axes]) for end in ("low", "high"))
        values = np.array([[scene.get(axis.name, math.nan) for axis in self.axes] for scene in scenes])
        inside = values[((low <= values) & (values <= high)).all(axis=1)]
        points = (inside - low) / np.maximum(high - low, 1e-12)
        normals = [self.normal(point)[self.telling] for point in points]
        return np.array(normals).reshape(len(points), int(self.telling.sum()))

    @cached_property
    def telling(self) -> np.typing.NDArray[np.bool_]:
        """Returns which axes tell their share, `d`."""
        return np.array([axis.tells for axis in self.axes], dtype=bool)

    @cached_property
    def _order(self) -> np.typing.NDArray[np.intp]:
        """Axes in the factor's order: those that tell their share first."""
        return np.argsort(~self.telling, kind="stable")

    @cached_property
    def _factor(self) -> Floats:
        """L, `d x d`, in that order."""
        matrix = np.eye(len(self.axes))
        if self.correlation is not None:
            names = [axis.name for axis in self.axes]
            rows = [names.index(name) for name in self.correlation.parameters]
            matrix[np.ix_(rows, rows)] = self.correlation.normal
        factor: Floats = np.linalg.cholesky(matrix[np.ix_(self._order, self._order)]).astype(np.float64)
        return factor


def _normal(share: float) -> float:
    """Φ⁻¹ of a share, kept away from 0 and 1."""
    return _STANDARD.inv_cdf(min(max(share, LEAST_SHARE), 1.0 - LEAST_SHARE))


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
        """Values that are the same in all scenes, in the space's units."""
        chosen = {name: self._value(name) for name in self.config.at}
        if self.config.others == "fixed":
            chosen |= {name: self._drawn(name, 0.5) for name in self.space.names if name not in chosen}
        return {name: value for name, value in chosen.items() if name not in self.config.over}

    def whole(self, point: Floats, random: np.random.Generator) -> Floats:
        """Returns the space's unit point, `d`, at a slice's point, `k`."""
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
        """Returns the number that `at` sets; a word's is its interval's middle."""
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
