"""Start of a search from the shipped prior and earlier runs."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from risk_sac.env.problem import Problem
from risk_sac.scenario.families import FAMILIES
from risk_sac.search.prior.coordinates import Coordinates, Scripted
from risk_sac.search.prior.earlier import SHIPPED_OR_NONE, FamilyScripts, PlayedScript, kept
from risk_sac.world.types import Floats

if TYPE_CHECKING:
    from risk_sac.search.prior.script_model import PlacedModel

DOUBT = 0.5  # share of the uniform belief beside an earlier run's, whose ego may have been another


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorStart:
    """A search's prior; points are the problem's own.

    Attributes:
      earlier: rows of the library, the first ones, that an earlier run has found.
    """

    model: "PlacedModel"
    library: Floats  # n x d; without rows where the scenario is like no family of the paper
    library_kinds: tuple[str, ...]  # n, names of variants
    library_worth: Floats  # n; less than 1 where a row fails less often here than where it was found
    belief: Floats  # E
    earlier: int = 0


def start_of(problem: Problem, prior: str) -> PriorStart:
    """Returns what a search at a problem starts from.

    Args:
      problem: of any scenario; `like` names the family whose library it starts with.
      prior: `shipped`, or scripts that `pinned_prior` has copied.

    Raises:
      ConfigError: there is no such copy.
    """
    start = _shipped(problem)
    if prior in SHIPPED_OR_NONE:
        return start
    return _after(start, Coordinates.of(problem), kept(prior).alike(problem.family.name))


def _shipped(problem: Problem) -> PriorStart:
    """The shipped script model and library.

    The library is of the family that the problem is like.
    """
    # Here, because the model needs torch.
    from risk_sac.search.prior.script_model import PlacedModel
    from risk_sac.search.prior.shipped import shipped_library, shipped_model
    from risk_sac.search.prior.tokens import Tokenizer

    own, like = Coordinates.of(problem), problem.family.like
    model = PlacedModel(shipped_model(), Tokenizer(problem))
    unknown, none = model.unknown(), np.empty((0, own.dimension))
    start = PriorStart(model=model, library=none, library_kinds=(), library_worth=np.empty(0), belief=unknown)
    if like is None:
        return start
    library, there = shipped_library(like.family), Coordinates.of(FAMILIES[like.family])
    known, kinds, fails = library.points, library.kinds, library.fails
    if there.symmetric and own.symmetric:  # most of its rows strike from the left
        known, kinds, fails = np.concatenate([known, there.reflected(known)]), kinds * 2, np.tile(fails, 2)
    points, worth = own.placed(there.scripted(known)), np.ones(len(known))
    if own.space != there.space or own.adversaries != there.adversaries:
        worth = np.minimum(model.predict(points, unknown).fails / fails, 1.0).astype(np.float64)
    return replace(start, library=points, library_kinds=kinds, library_worth=worth)


def _after(start: PriorStart, own: Coordinates, earlier: tuple[FamilyScripts, ...]) -> PriorStart:
    """Puts what earlier runs found before the shipped library, and believes in what their egos did."""
    failures = np.concatenate([np.empty((0, own.dimension)), *(_points(own, each, each.failures) for each in earlier)])
    kinds = tuple(script.kind for each in earlier for script in each.failures)
    belief = start.belief
    for each in earlier:
        failed = np.array([bool(script.kind) for script in each.latest])
        belief = start.model.believe(belief, _points(own, each, each.latest), failed)
    return replace(
        start,
        library=np.concatenate([failures, start.library]),
        library_kinds=(*kinds, *start.library_kinds),
        library_worth=np.concatenate([np.ones(len(kinds)), start.library_worth]),
        belief=(1.0 - DOUBT) * belief + DOUBT * start.model.unknown(),
        earlier=len(kinds),
    )


def _points(own: Coordinates, family: FamilyScripts, scripts: Iterable[PlayedScript]) -> Floats:
    points = [np.empty((0, own.dimension))]
    for each in scripts:
        values, genes = np.array([list(each.scene.values())]), np.array([each.genes])
        points.append(own.placed(Scripted(tuple(each.scene), values, family.adversaries, genes, family.mirrored)))
    return np.concatenate(points)
