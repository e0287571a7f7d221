"""Start of a search from the shipped prior and earlier runs."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from risk_sac.env.problem import Problem
from risk_sac.scenario.families import FAMILIES
from risk_sac.search.prior.coordinates import Coordinates, Scripted, Translation
from risk_sac.search.prior.earlier import SHIPPED_OR_NONE, FamilyScripts, PlayedScript, kept
from risk_sac.world.types import Floats

if TYPE_CHECKING:
    from risk_sac.search.prior.script_model import ScriptModel

DOUBT = 0.5  # share of the uniform belief beside an earlier run's, whose ego may have been another


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorStart:
    """What a search starts from; points are the problem's own.

    Attributes:
      earlier: rows of the library, the first ones, that an earlier run has found.
    """

    model: "ScriptModel | None"  # None: of no shipped family
    translation: Translation | None
    library: Floats  # n x d
    library_kinds: tuple[str, ...]  # n, names of variants
    library_worth: Floats  # n; less than 1 where a row fails less often here than where it was found
    belief: Floats  # E
    earlier: int = 0


def start_of(problem: Problem, prior: str) -> PriorStart | None:
    """Returns what a search at a problem starts from; None if there is nothing.

    Args:
      problem: of a scenario; without `like`, an earlier run's scripts are all that it may start from.
      prior: `shipped`, or scripts that `pinned_prior` has copied.

    Raises:
      ConfigError: there is no such copy.
    """
    own, like = Coordinates.of(problem), problem.family.like
    start = None if like is None else _shipped(own, like.family)
    return start if prior in SHIPPED_OR_NONE else _after(start, own, kept(prior).alike(problem.family.name))


def _shipped(own: Coordinates, family: str) -> PriorStart:
    """What was trained on a shipped family."""
    from risk_sac.search.prior.shipped import shipped_prior  # here, because its model needs torch

    shipped, there = shipped_prior(family), Coordinates.of(FAMILIES[family])
    translation, model, known, kinds = Translation(own, there), shipped.model, shipped.library, shipped.library_kinds
    if there.symmetric:
        model = model.symmetric(there.reflected)
    if there.symmetric and own.symmetric:  # most of its rows strike from the left
        known, kinds = np.concatenate([known, there.reflected(known)]), kinds * 2
    library, unknown = translation.own(known), model.unknown()
    fails_there, fails_here = (model.predict(rows, unknown).fails for rows in (known, translation.known(library)))
    return PriorStart(
        model=model,
        translation=translation,
        library=library,
        library_kinds=kinds,
        library_worth=np.minimum(fails_here / fails_there, 1.0).astype(np.float64),
        belief=unknown,
    )


def _after(start: PriorStart | None, own: Coordinates, earlier: tuple[FamilyScripts, ...]) -> PriorStart | None:
    """Puts what earlier runs found before the shipped library, and believes in what their egos did."""
    failures = np.concatenate([np.empty((0, own.dimension)), *(_points(own, each, each.failures) for each in earlier)])
    kinds = tuple(script.kind for each in earlier for script in each.failures)
    if start is None or start.model is None or start.translation is None:
        worth, none = np.ones(len(kinds)), np.empty(0)
        alone = PriorStart(
            model=None,
            translation=None,
            library=failures,
            library_kinds=kinds,
            library_worth=worth,
            belief=none,
            earlier=len(kinds),
        )
        return alone if kinds else None
    model, belief = start.model, start.belief
    for each in earlier:
        known = start.translation.known(_points(own, each, each.latest))
        for point, script in zip(known, each.latest, strict=True):
            belief = model.believe(belief, point, failed=bool(script.kind))
    return PriorStart(
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
