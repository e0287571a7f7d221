"""Minimises a failure: fewest actions and plainest scene, or least unlikely motion.

Source: delta debugging, Zeller and Hildebrandt, "Simplifying and isolating failure-inducing input" (IEEE TSE 28, 2002).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np

from risk_sac.failures.bundle import Bundle, make_bundle
from risk_sac.failures.play import Played, play
from risk_sac.failures.sentence import story
from risk_sac.failures.studied import Core, Extent, PlausibleMotion
from risk_sac.failures.variants import Variant, VariantPlayer, alike
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.plausibility import plausibility_of
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
        """The middle of the space; categorical parameters keep their values."""
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
        """Whether enough copies fail; plays no more than needed to know."""
        failed = 0
        for played, copy in enumerate(self.stage.copies(variant, SHARE, COPIES, self._random), 1):
            failed += self.stage.fails(copy)
            if failed == HELD or played - failed > COPIES - HELD:
                break
        return failed == HELD

    def bundle(self, origin: Bundle) -> Bundle:
        stage, left = self.stage, self.left
        held, played, sentence = _result(stage, left, self._random)
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
            sentence=sentence,
        )
        return make_bundle(origin.manifest.spec, episode, played.series, played.signal_heads, origin.policy, core)


def _result(stage: VariantPlayer, variant: Variant, random: np.random.Generator) -> tuple[int, Played, str]:
    """Counts failing copies, newly drawn, and plays the variant once more."""
    held = sum(stage.fails(copy) for copy in stage.copies(variant, SHARE, COPIES, random))
    played = play(stage.env, stage.scene(variant), variant.seed, variant.actions)
    violation = alike(played.found, stage.failure)
    assert violation is not None  # or it would not have been taken
    return held, played, story(played.series, violation)


def _active_adversaries(search: _MinimalSearch) -> list[int]:
    """Returns the adversaries that act, the striker last."""
    names = search.stage.env.problem.family.adversaries
    active = [k for k in range(len(names)) if search.left.actions[:, _columns(k)].any()]
    return sorted(active, key=lambda k: names[k] == search.stage.failure.other_id)


def _units(search: _MinimalSearch) -> Iterator[list[Cell]]:
    """Yields groups to remove, coarsest first, of the actions that remain."""
    always = slice(None)
    yield [(always, _columns(k)) for k in _active_adversaries(search)]
    yield [(always, slice(c, c + 1)) for c in np.flatnonzero(search.left.actions.any(axis=0)).tolist()]
    yield [(_rows(s), _columns(k)) for k, s in _segments_of(search.left)]
    yield [(_rows(s), slice(c, c + 1)) for c, s in _channels_of(search.left)]


def _reduce_actions(search: _MinimalSearch) -> None:
    """Hands adversaries, channels or segments to SUMO, then weakens the rest."""
    for units in _units(search):
        without(units, lambda cells: search.take(_zeroed(search.left, cells)))
    while search.left.actions.any() and any(search.take(_weaker(search.left, factor)) for factor in AMPLITUDES):
        pass


def _reduce_scene(search: _MinimalSearch) -> None:
    """Moves parameters to the middle of their ranges, or half way."""

    def unneeded(share: float, chunk: Sequence[int]) -> bool:
        scene = search.left.scene.copy()
        chosen = list(chunk)
        scene[chosen] += share * (search.neutral[chosen] - scene[chosen])
        return search.take(replace(search.left, scene=scene))

    for share in (1.0, 0.5):
        odd = np.flatnonzero(~np.isclose(search.left.scene, search.neutral))
        without(odd.tolist(), partial(unneeded, share))


def without(units: Sequence[Unit], unneeded: Callable[[Sequence[Unit]], bool]) -> None:
    """Tries to remove all units, then halves, quarters, down to single ones.

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
    """Returns the columns and segments with actions, the earliest first."""
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


LEAST_LOG = 1e-300  # keeps logarithms finite
Unlikely = Callable[[Evidence], float]
"""From an episode up to its contact to -log p of what its adversaries did."""

MOST_MOTIONS = 300  # most episodes that are played for one failure
WINDOW = (3, 30)  # least and most steps of a change
LATER = 5  # most steps of a shift in time
DEVIATIONS = (0.05, 0.15, 0.4)  # of an action that is moved
FACTORS = (0.3, 1.2)  # by which actions are weakened or strengthened


def unlikely(evidence: Evidence) -> float:
    """Computes -log p of the least likely feature and of all, nats.

    Choice: their sum, since either decides the class, and the larger one alone hides what a change gains in the other.
    """
    judged = plausibility_of(evidence)
    return -sum(math.log(max(p, LEAST_LOG)) for p in (judged.least_probability, judged.joint_probability))


def most_plausible(bundle: Bundle, score: Unlikely = unlikely, most: int = MOST_MOTIONS) -> Bundle:
    """Returns the least unlikely motion found, in a bundle with the recording.

    It climbs over the recorded actions. A change makes one adversary's drive or steering smoother, constant, weaker,
    absent, earlier or later over a while, or moves it. It is kept if it lowers the unlikeliness and the ego fails
    alike. Scene, striker, type of conflict and grade stay, and what is not minor does not become so.

    Args:
      bundle: of the failure.
      score: what is lowered.
      most: episodes that are played, `COPIES` of them to count how surely the result fails.

    Raises:
      ConfigError: the bundle holds no valid failure that can be played here.
      SimulationError: it does not happen here.
    """
    search = _Climb(VariantPlayer(bundle), score)
    with closing(search.stage.env):
        while search.stage.played < most - COPIES - 1:
            search.step()
        return search.bundle(bundle)


class _Climb:
    """State of the climb: the least unlikely motion so far."""

    def __init__(self, stage: VariantPlayer, score: Unlikely) -> None:
        self.stage, self._score = stage, score
        self.best = stage.original
        self.before = self.after = score(stage.evidence())
        self._random = np.random.default_rng(0)

    def step(self) -> None:
        variant = replace(self.best, actions=changed(self.best.actions, self._random))
        violation = alike(self.stage.play(variant)[:1], self.stage.failure)
        if violation is None or violation.graded is not self.stage.grade:
            return
        if self.stage.failure.serious and not violation.serious:
            return
        score = self._score(self.stage.evidence())
        if score < self.after:
            self.best, self.after = variant, score

    def bundle(self, recorded: Bundle) -> Bundle:
        stage, best = self.stage, self.best
        held, played, sentence = _result(stage, best, self._random)
        episode = played.record(recorded.manifest.episode).model_copy(update={"script": None})
        motion = PlausibleMotion(
            before=self.before, after=self.after, episodes=stage.played + 1, held=held, copies=COPIES, sentence=sentence
        )
        made = make_bundle(recorded.manifest.spec, episode, played.series, played.signal_heads, recorded.policy)
        manifest = made.manifest.model_copy(update={"plausible": motion})
        return replace(made, manifest=manifest, recorded=replace(recorded, policy=None))


def changed(actions: Floats, random: np.random.Generator) -> Floats:
    """Changes one column of actions, `T x a` in [-1, 1], temporarily."""
    acting = np.flatnonzero(actions.any(axis=0))
    if not len(acting):
        return actions
    column, last = random.choice(acting), int(np.flatnonzero(actions.any(axis=1))[-1]) + 1
    length = int(random.integers(WINDOW[0], WINDOW[1] + 1))
    first = int(random.integers(min(1 - length, last - 1), last))
    rows = slice(max(first, 0), min(first + length, len(actions)))
    part = actions[rows, column]
    made = actions.copy()
    made[rows, column] = np.clip(_moved(part, random), -1.0, 1.0)
    return made


def _moved(part: Floats, random: np.random.Generator) -> Floats:
    way = random.integers(6)
    if way == 0:
        width = 2 * int(random.integers(1, 6)) + 1
        padded = np.pad(part, width // 2, mode="edge")
        return np.convolve(padded, np.full(width, 1.0 / width), mode="valid")
    if way == 1:
        return np.full_like(part, part.mean())
    if way == 2:
        return part * random.uniform(*FACTORS)
    if way == 3:
        return np.zeros_like(part)
    if way == 4:
        shifted: Floats = part[np.clip(np.arange(len(part)) + random.integers(-LATER, LATER + 1), 0, len(part) - 1)]
        return shifted
    moved: Floats = part + float(random.choice(DEVIATIONS)) * random.standard_normal()
    return moved
