"""Coordinates of points: scenes and scripts by the names of parameters and adversaries.

A point is a scene in the unit cube of a space, and behind it the genes of each adversary's script.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from risk_sac.env.problem import Problem
from risk_sac.scenario.families import Family
from risk_sac.scenario.space import SceneSpace
from risk_sac.search.scripts import SIZE, Genes
from risk_sac.world.types import Floats

MIDDLE = 0.5  # value of a scene parameter or gene that the source lacks
PASSIVE = Genes(*[MIDDLE] * SIZE)._replace(active=0.0)  # genes of an adversary that the source lacks: it does nothing
STEER = Genes._fields.index("steer")
OTHER_SIDE = {"left": "right", "right": "left"}


class Scripted(NamedTuple):
    """Scenes and scripts of one family."""

    parameters: Sequence[str]  # k
    values: Floats  # n x k, in their units
    adversaries: Sequence[str]  # a
    genes: Floats  # n x SIZE a
    mirrored: bool

    def reflected(self) -> "Scripted":
        """Returns the same, seen in a mirror that lies along the ego's way.

        Vehicles steer towards the ego or away from it, so their genes stay. Pedestrians turn to the left or right.
        """
        values, genes = self.values.copy(), self.genes.copy()
        if "pedestrian_offset_m" in self.parameters:  # to the right of where the pedestrian faces
            values[:, self.parameters.index("pedestrian_offset_m")] *= -1.0
        if "pedestrian" in self.adversaries:
            steer = SIZE * self.adversaries.index("pedestrian") + STEER
            genes[:, steer] = 1.0 - genes[:, steer]
        parameters = [other_side(name) for name in self.parameters]
        adversaries = [other_side(name) for name in self.adversaries]
        return Scripted(parameters, values, adversaries, genes, not self.mirrored)


class Coordinates(NamedTuple):
    """Meaning of a point's coordinates."""

    space: SceneSpace
    adversaries: tuple[str, ...]  # those of the shipped family that they stand for
    mirrored: bool

    @classmethod
    def of(cls, posed: Problem | Family) -> Self:
        """Returns the coordinates of a problem's points, or of a family's."""
        family = posed.family if isinstance(posed, Problem) else posed
        return cls(posed.space, family.stand_ins, family.mirrored)

    @property
    def dimension(self) -> int:
        """Numbers of a point."""
        return self.space.dimension + SIZE * len(self.adversaries)

    @property
    def symmetric(self) -> bool:
        """Whether the mirror image of a point is a point too: names on the left have their like on the right."""
        names, adversaries = self.space.names, self.adversaries
        sides = [name for name in names if other_side(name) != name]
        both = bool(sides) and all(other_side(name) in names for name in sides)
        return both and set(OTHER_SIDE) <= set(adversaries) and len(set(adversaries)) == len(adversaries)

    def reflected(self, points: Floats) -> Floats:
        """Returns the mirror images of points, `n x dimension`; the coordinates are symmetric."""
        return self.placed(self.scripted(points).reflected()._replace(mirrored=self.mirrored))

    def scripted(self, points: Floats) -> Scripted:
        """Returns the scenes and scripts of points, `n x dimension`."""
        low, high, size = self.space.low, self.space.high, self.space.dimension
        values = low + points[:, :size] * (high - low)
        return Scripted(self.space.names, values, self.adversaries, points[:, size:], self.mirrored)

    def placed(self, scripted: Scripted) -> Floats:
        """Returns the points of scenes and scripts of similar families, `n x dimension`.

        Values are clipped to the bounds. A missing parameter is put to its middle, and a missing adversary is passive.
        """
        if scripted.mirrored != self.mirrored:
            scripted = scripted.reflected()
        points = np.full((len(scripted.values), self.dimension), MIDDLE)
        low, width, size = self.space.low, self.space.high - self.space.low, self.space.dimension
        shared = [(i, scripted.parameters.index(n)) for i, n in enumerate(self.space.names) if n in scripted.parameters]
        own, other = [i for i, _ in shared], [j for _, j in shared]
        points[:, own] = _unit(scripted.values[:, other], low[own], width[own])
        for i, adversary in enumerate(self.adversaries):
            genes: Floats | Genes = PASSIVE
            if adversary in scripted.adversaries:
                same = tuple(scripted.adversaries) == self.adversaries  # of which several may have one name
                first = SIZE * (i if same else scripted.adversaries.index(adversary))
                genes = scripted.genes[:, first : first + SIZE]
            points[:, size + SIZE * i : size + SIZE * (i + 1)] = genes
        return points


def other_side(name: str) -> str:
    """Exchanges left and right at the beginning of a name."""
    side, _, rest = name.partition("_")
    return "_".join(filter(None, (OTHER_SIDE.get(side, side), rest)))


def _unit(values: Floats, low: Floats, width: Floats) -> Floats:
    offset = values - low
    return np.clip(np.divide(offset, width, out=np.zeros_like(offset), where=width > 0), 0.0, 1.0)
