"""What a search starts from at a problem: the shipped prior of its pattern, and perhaps an earlier run's scripts."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from risk_sac.prior.earlier import SHIPPED_OR_NONE, FamilyScripts, PlayedScript, kept
from risk_sac.prior.script_model import ScriptModel
from risk_sac.prior.shipped import shipped_prior
from risk_sac.prior.translation import Coordinates, Translation
from risk_sac.problem import Problem
from risk_sac.scenario.families import FAMILIES, shipped_alike
from risk_sac.types import Floats

DOUBT = 0.5  # share of the uniform belief beside what an earlier run showed: its ego may have been another


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """What a search starts from; points are the problem's own.

    Attributes:
      earlier: rows of the library, the first ones, that an earlier run has found.
    """

    model: ScriptModel
    translation: Translation
    library: Floats  # n x d
    library_kinds: tuple[str, ...]  # n
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
    start = Start(
        model=shipped.model,
        translation=translation,
        library=translation.own(shipped.library),
        library_kinds=shipped.library_kinds,
        belief=shipped.model.unknown(),
    )
    return start if prior in SHIPPED_OR_NONE else _after(start, own, kept(prior).alike(problem.family.name))


def _after(start: Start, own: Coordinates, found: tuple[FamilyScripts, ...]) -> Start:
    """Puts what earlier runs found before the shipped library, and believes in what their egos did."""
    model, belief = start.model, start.belief
    for each in found:
        known = start.translation.known(_points(own, each.adversaries, each.latest))
        for point, script in zip(known, each.latest, strict=True):
            belief = model.believe(belief, point, failed=bool(script.kind))
    failures = np.concatenate([_points(own, each.adversaries, each.failures) for each in found])
    kinds = tuple(script.kind for each in found for script in each.failures)
    return Start(
        model=model,
        translation=start.translation,
        library=np.concatenate([failures, start.library]),
        library_kinds=(*kinds, *start.library_kinds),
        belief=(1.0 - DOUBT) * belief + DOUBT * model.unknown(),
        earlier=len(kinds),
    )


def _points(own: Coordinates, adversaries: tuple[str, ...], scripts: Iterable[PlayedScript]) -> Floats:
    rows = [
        own.placed(tuple(each.scene), np.array([list(each.scene.values())]), adversaries, np.array([each.genes]))
        for each in scripts
    ]
    return np.concatenate([np.empty((0, own.dimension)), *rows])
