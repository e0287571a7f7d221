"""Start of a search from the shipped prior and earlier runs.

A point is a scene in the unit cube of a space, and behind it the genes of each adversary's script.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from risk_sac.env.problem import Problem
from risk_sac.scenario.families import FAMILIES, shipped_alike
from risk_sac.scenario.family import Family
from risk_sac.scenario.space import SceneSpace
from risk_sac.search.prior.earlier import SHIPPED_OR_NONE, FamilyScripts, PlayedScript, kept
from risk_sac.search.prior.script_model import ScriptModel
from risk_sac.search.prior.shipped import shipped_prior
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
    adversaries: tuple[str, ...]
    mirrored: bool

    @classmethod
    def of(cls, posed: Problem | Family) -> Self:
        """Returns the coordinates of a problem's points, or of a family's."""
        family = posed.family if isinstance(posed, Problem) else posed
        return cls(posed.space, family.adversaries, family.mirrored)

    @property
    def dimension(self) -> int:
        """Numbers of a point."""
        return self.space.dimension + SIZE * len(self.adversaries)

    def scripted(self, points: Floats) -> Scripted:
        """Returns the scenes and scripts of points, `n x dimension`."""
        low, high, size = self.space.low, self.space.high, self.space.dimension
        values = low + points[:, :size] * (high - low)
        return Scripted(self.space.names, values, self.adversaries, points[:, size:], self.mirrored)

    def placed(self, scripted: Scripted) -> Floats:
        """Returns the points of scenes and scripts of any family of the pattern, `n x dimension`.

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
                first = SIZE * scripted.adversaries.index(adversary)
                genes = scripted.genes[:, first : first + SIZE]
            points[:, size + SIZE * i : size + SIZE * (i + 1)] = genes
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
        return self._shipped.placed(self._problem.scripted(points))

    def own(self, known: Floats) -> Floats:
        """Translates points of the shipped family."""
        return self._problem.placed(self._shipped.scripted(known))


def other_side(name: str) -> str:
    """Exchanges left and right at the beginning of a name."""
    side, _, rest = name.partition("_")
    return "_".join(filter(None, (OTHER_SIDE.get(side, side), rest)))


def _unit(values: Floats, low: Floats, width: Floats) -> Floats:
    offset = values - low
    return np.clip(np.divide(offset, width, out=np.zeros_like(offset), where=width > 0), 0.0, 1.0)


DOUBT = 0.5  # share of the uniform belief beside an earlier run's, whose ego may have been another


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """What a search starts from; points are the problem's own.

    Attributes:
      earlier: rows of the library, the first ones, that an earlier run has found.
    """

    model: ScriptModel
    translation: Translation
    library: Floats  # n x d
    library_kinds: tuple[str, ...]  # n, names of variants
    library_worth: Floats  # n; less than 1 where a row fails less often here than where it was found
    belief: Floats  # E
    earlier: int = 0


def start_of(problem: Problem, prior: str) -> Start:
    """Returns what a search at a problem starts from.

    Args:
      problem: at a shipped family, or at a place of one's own.
      prior: `shipped`, or scripts that `pinned_prior` has copied.

    Raises:
      ConfigError: there is no such copy, or it has no scripts of the problem's pattern.
    """
    shipped = shipped_prior(shipped_alike(problem.family.name))
    own = Coordinates.of(problem)
    translation = Translation(own, Coordinates.of(FAMILIES[shipped.family]))
    model, library, unknown = shipped.model, translation.own(shipped.library), shipped.model.unknown()
    there, here = (model.predict(each, unknown).fails for each in (shipped.library, translation.known(library)))
    start = Start(
        model=model,
        translation=translation,
        library=library,
        library_kinds=shipped.library_kinds,
        library_worth=np.minimum(here / there, 1.0).astype(np.float64),
        belief=unknown,
    )
    return start if prior in SHIPPED_OR_NONE else _after(start, own, kept(prior).alike(problem.family.name))


def _after(start: Start, own: Coordinates, earlier: tuple[FamilyScripts, ...]) -> Start:
    """Puts what earlier runs found before the shipped library, and believes in what their egos did."""
    model, belief = start.model, start.belief
    for each in earlier:
        known = start.translation.known(_points(own, each, each.latest))
        for point, script in zip(known, each.latest, strict=True):
            belief = model.believe(belief, point, failed=bool(script.kind))
    failures = np.concatenate([_points(own, each, each.failures) for each in earlier])
    kinds = tuple(script.kind for each in earlier for script in each.failures)
    return Start(
        model=model,
        translation=start.translation,
        library=np.concatenate([failures, start.library]),
        library_kinds=(*kinds, *start.library_kinds),
        library_worth=np.concatenate([np.ones(len(kinds)), start.library_worth]),
        belief=(1.0 - DOUBT) * belief + DOUBT * model.unknown(),
        earlier=len(kinds),
    )


def _points(own: Coordinates, family: FamilyScripts, scripts: Iterable[PlayedScript]) -> Floats:
    points = [np.empty((0, own.dimension))]
    for each in scripts:
        values, genes = np.array([list(each.scene.values())]), np.array([each.genes])
        points.append(own.placed(Scripted(tuple(each.scene), values, family.adversaries, genes, family.mirrored)))
    return np.concatenate(points)
