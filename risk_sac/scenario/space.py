"""The scene space of a family: the named, bounded parameters ξ of its episodes."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from risk_sac.config import Interval
from risk_sac.errors import SceneError
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
        """The scene at a point of the unit cube, `d`; raises `SceneError` for any other point."""
        point = np.asarray(point, dtype=np.float64)
        if point.shape != (self.dimension,):
            raise SceneError(f"point has shape {point.shape}; the {self.family!r} family wants ({self.dimension},)")
        if not np.all((point >= 0) & (point <= 1)):  # NaN fails both
            raise SceneError(f"point is {point.tolist()}; wanted every coordinate in [0, 1]")
        values = np.minimum(self.low + point * (self.high - self.low), self.high)  # rounding may pass the bound
        return Scene(self.family, dict(zip(self.names, values.tolist(), strict=True)))

    def allows(self, point: Floats) -> bool:
        """Whether the scene at a point of the unit cube, `d`, keeps the constraints."""
        return self.holds is None or self.holds(self.from_unit(point).values)

    def nearest_allowed(self, point: Floats) -> Floats:
        """Returns the point itself, `d`, or the nearest of a pool of points that keep the constraints.

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
        """Maps a scene into the unit cube, `d`.

        A parameter without room maps to 0.
        """
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
        """The part of this space inside further bounds, by parameter; raises `SceneError` if none is left."""
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
