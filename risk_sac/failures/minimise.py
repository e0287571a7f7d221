"""Minimises a failure: fewest actions, plainest scene, same failure.

Source: delta debugging, Zeller and Hildebrandt, "Simplifying and isolating failure-inducing input" (IEEE TSE 28, 2002).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from risk_sac.failures.bundle import Bundle, make_bundle
from risk_sac.failures.play import play
from risk_sac.failures.sentence import story
from risk_sac.failures.studied import Core, Extent
from risk_sac.failures.variants import Variant, VariantPlayer, alike
from risk_sac.world.types import STEP_S, Bools, Floats

MOST = 150  # most episodes that are played for one failure
COPIES, HELD, SHARE = 10, 8, 0.01  # a reduction counts if so many copies, perturbed by that much, still fail
SEGMENT = round(0.5 / STEP_S)  # length of a segment of actions, in steps
AMPLITUDES = (0.5, 0.7, 0.85)  # factors by which the remaining actions are weakened, the smallest first

Unit = TypeVar("Unit")
Cell = tuple[slice, slice]  # steps and columns of the actions


def minimise(bundle: Bundle, most: int = MOST) -> Bundle:
    """Removes what a failure does not need, playing at most `most` episodes.

    `manifest.core` states the remaining actions and how surely they fail. Where nothing can be removed, it is the
    failure itself.

    Raises:
      ConfigError: the bundle holds no valid failure that can be played here.
      SimulationError: it does not happen here.
    """
    search = _MinimalSearch(bundle, most)
    with closing(search.stage.env):
        _reduce_actions(search)
        _reduce_scene(search)
        return search.bundle(bundle)


class _MinimalSearch:
    """Search for a minimal failure."""

    def __init__(self, bundle: Bundle, most: int) -> None:
        self.stage = VariantPlayer(bundle)
        self.left = self.stage.original
        self._most = most
        self._random = np.random.default_rng(0)  # new copies each time, or the search would fit fixed ones

    @property
    def neutral(self) -> Floats:
        """The middle of the space; parameters that stand for one of two categories stay."""
        space = self.stage.space
        return np.where(self._categories, self.left.scene, (space.low + space.high) / 2)

    @property
    def _categories(self) -> Bools:
        return np.array([bool(parameter.categories) for parameter in self.stage.space.parameters])

    def take(self, variant: Variant) -> bool:
        """Adopts a variant if it and most of its copies fail alike."""
        if self.stage.played + 1 + COPIES > self._most - COPIES - 1:  # as many are counted afresh in the end
            return False
        found = alike(self.stage.play(variant)[:1], self.stage.failure)
        if found is None or found.graded != self.stage.grade or not self._holds(variant):
            return False
        self.left = variant
        return True

    def _holds(self, variant: Variant) -> bool:
        """Whether enough of its copies fail; played no further than it takes to know."""
        failed = 0
        for played, copy in enumerate(self.stage.copies(variant, SHARE, COPIES, self._random), 1):
            failed += self.stage.fails(copy)
            if failed == HELD or played - failed > COPIES - HELD:
                break
        return failed == HELD

    def bundle(self, origin: Bundle) -> Bundle:
        """Returns the minimised failure as a bundle of its own."""
        stage, left = self.stage, self.left
        # Other copies than those that it was chosen by.
        held = sum(stage.fails(copy) for copy in stage.copies(left, SHARE, COPIES, self._random))
        played = play(stage.env, stage.scene(left), left.seed, left.actions)
        violation = alike(played.found, stage.failure)
        assert violation is not None  # or it would not have been taken
        # A script would do all that was taken away.
        changes = {"scene": dict(stage.scene(left).values), "script": None}
        episode = played.record(origin.manifest.episode).model_copy(update=changes)
        core = Core(
            before=_extent(stage.original),
            after=_extent(replace(left, actions=left.actions[: episode.steps])),
            plain_parameters=int(np.isclose(left.scene, self.neutral)[~self._categories].sum()),
            parameters=int((~self._categories).sum()),
            episodes=stage.played + 1,
            held=held,
            copies=COPIES,
            sentence=story(played.series, violation),
        )
        return make_bundle(origin.manifest.spec, episode, played.series, played.signal_heads, origin.policy, core)


def _active_adversaries(search: _MinimalSearch) -> list[int]:
    """Returns the adversaries that act, the striker last."""
    names = search.stage.env.problem.family.adversaries
    active = [k for k in range(len(names)) if search.left.actions[:, _columns(k)].any()]
    return sorted(active, key=lambda k: names[k] == search.stage.failure.other_id)


def _units(search: _MinimalSearch) -> Iterator[list[Cell]]:
    """Yields candidates for removal, the coarsest first.

    Each group is made from the actions that remain by then.
    """
    always = slice(None)
    yield [(always, _columns(k)) for k in _active_adversaries(search)]
    yield [(always, slice(c, c + 1)) for c in np.flatnonzero(search.left.actions.any(axis=0)).tolist()]
    yield [(_rows(s), _columns(k)) for k, s in _segments_of(search.left)]
    yield [(_rows(s), slice(c, c + 1)) for c, s in _channels_of(search.left)]


def _reduce_actions(search: _MinimalSearch) -> None:
    """Hands adversaries over to SUMO, then weakens the remaining actions.

    It tries whole adversaries, then their drive or steering, then segments of 0.5 s.
    """
    for units in _units(search):
        without(units, lambda cells: search.take(_zeroed(search.left, cells)))
    while search.left.actions.any() and any(search.take(_weaker(search.left, factor)) for factor in AMPLITUDES):
        pass


def _reduce_scene(search: _MinimalSearch) -> None:
    """Moves parameters to the middle of their ranges, and those that cannot be moved there half the way."""

    def unneeded(share: float, chunk: Sequence[int]) -> bool:
        scene = search.left.scene.copy()
        chosen = list(chunk)
        scene[chosen] += share * (search.neutral[chosen] - scene[chosen])
        return search.take(replace(search.left, scene=scene))

    for share in (1.0, 0.5):
        odd = np.flatnonzero(~np.isclose(search.left.scene, search.neutral))
        without(odd.tolist(), partial(unneeded, share))


def without(units: Sequence[Unit], unneeded: Callable[[Sequence[Unit]], bool]) -> None:
    """Tries to remove all units, then halves, quarters and so on, then each.

    `unneeded` tries to do without some from now on, and returns whether that is possible.
    """
    left, size = list(units), len(units)
    while size:
        chunks = [left[first : first + size] for first in range(0, len(left), size)]
        left = [unit for chunk in chunks if not unneeded(chunk) for unit in chunk]
        size //= 2


def _zeroed(variant: Variant, cells: Sequence[Cell]) -> Variant:
    actions = variant.actions.copy()
    for cell in cells:
        actions[cell] = 0.0
    return replace(variant, actions=actions)


def _weaker(variant: Variant, factor: float) -> Variant:
    return replace(variant, actions=(factor * variant.actions).astype(variant.actions.dtype))


def _rows(segment: int) -> slice:
    return slice(segment * SEGMENT, (segment + 1) * SEGMENT)


def _columns(adversary: int) -> slice:
    return slice(2 * adversary, 2 * adversary + 2)


def _channels_of(variant: Variant) -> list[tuple[int, int]]:
    """Returns the columns and segments in which something is done, the earliest first."""
    count = -(-len(variant.actions) // SEGMENT)
    columns = range(variant.actions.shape[1])
    return [(c, s) for s in range(count) for c in columns if variant.actions[_rows(s), c].any()]


def _segments_of(variant: Variant) -> list[tuple[int, int]]:
    """Returns the adversaries and segments in which something is done."""
    return list(dict.fromkeys((column // 2, segment) for column, segment in _channels_of(variant)))


def _extent(variant: Variant) -> Extent:
    segments = _segments_of(variant)
    return Extent(
        adversaries=len({k for k, _ in segments}),
        segments=len(segments),
        channels=len(_channels_of(variant)),
        strongest=float(np.abs(variant.actions).max(initial=0.0)),
    )
