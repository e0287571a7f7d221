"""Translates points between two families of one pattern, by the names of scene parameters and adversaries.

A point is a scene in the unit cube of a space, and behind it the genes of each adversary's script.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from risk_sac.problem import Problem
from risk_sac.scenario.family import Family
from risk_sac.scenario.space import SceneSpace
from risk_sac.scripts.motions import SIZE, Genes
from risk_sac.types import Floats

MIDDLE = 0.5  # of a scene parameter or gene that the other side lacks
PASSIVE = Genes(*[MIDDLE] * SIZE)._replace(active=0.0)  # an adversary that the other side lacks does nothing


class Coordinates(NamedTuple):
    """What the coordinates of a point mean."""

    space: SceneSpace
    adversaries: tuple[str, ...]

    @classmethod
    def of(cls, posed: Problem | Family) -> Self:
        """Returns the coordinates of a problem's points, or of a family's."""
        family = posed.family if isinstance(posed, Problem) else posed
        return cls(posed.space, family.adversaries)

    @property
    def dimension(self) -> int:
        """Numbers of a point."""
        return self.space.dimension + SIZE * len(self.adversaries)

    def placed(self, names: Sequence[str], values: Floats, adversaries: Sequence[str], genes: Floats) -> Floats:
        """Returns the points of scenes and scripts that another family may have.

        Values are clipped to the bounds. A missing parameter is put to its middle, and a missing adversary is passive.

        Args:
          names: of the scene parameters, `k`.
          values: of these, `n x k`, in their units.
          adversaries: `a`.
          genes: of these, `n x SIZE a`.
        """
        points = np.full((len(values), self.dimension), MIDDLE)
        size = self.space.dimension
        rows = [(i, names.index(parameter)) for i, parameter in enumerate(self.space.names) if parameter in names]
        own, other = [i for i, _ in rows], [j for _, j in rows]
        points[:, own] = _unit(values[:, other], self.space.low[own], (self.space.high - self.space.low)[own])
        for i, adversary in enumerate(self.adversaries):
            block = points[:, size + SIZE * i : size + SIZE * (i + 1)]
            k = adversaries.index(adversary) if adversary in adversaries else None
            block[:] = PASSIVE if k is None else genes[:, SIZE * k : SIZE * (k + 1)]
        return points


class Translation:
    """Maps points of a problem onto those of a shipped family, and back.

    Attributes:
      scene_size: scene parameters of the problem.
    """

    def __init__(self, problem: Coordinates, shipped: Coordinates) -> None:
        self.scene_size = problem.space.dimension
        self._problem, self._shipped = problem, shipped

    def known(self, points: Floats) -> Floats:
        """Translates points of the problem, `n x (d + genes)`."""
        return _translated(points, self._problem, self._shipped)

    def own(self, known: Floats) -> Floats:
        """Translates points of the shipped family."""
        return _translated(known, self._shipped, self._problem)


def _translated(points: Floats, source: Coordinates, target: Coordinates) -> Floats:
    space = source.space
    values = space.low + points[:, : space.dimension] * (space.high - space.low)
    return target.placed(space.names, values, source.adversaries, points[:, space.dimension :])


def _unit(values: Floats, low: Floats, width: Floats) -> Floats:
    offset = values - low
    return np.clip(np.divide(offset, width, out=np.zeros_like(offset), where=width > 0), 0.0, 1.0)
