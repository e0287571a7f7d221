"""Searches from a failure's recording for the least unlikely motion that still fails.

A hill climb over the recorded actions: a change is kept if it lowers the unlikeliness and the ego fails alike. Changes
make one adversary's drive or steering smoother, constant, weaker, absent, earlier or later over a while, or move it.
"""

import math
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace

import numpy as np

from risk_sac.failures.bundle import Bundle, make_bundle
from risk_sac.failures.minimise import COPIES, SHARE
from risk_sac.failures.play import play
from risk_sac.failures.sentence import story
from risk_sac.failures.studied import PlausibleMotion
from risk_sac.failures.variants import VariantPlayer, alike
from risk_sac.verdicts.evidence import Evidence
from risk_sac.verdicts.plausibility import plausibility_of
from risk_sac.world.types import Floats

LEAST_LOG = 1e-300  # keeps logarithms finite
Unlikely = Callable[[Evidence], float]
"""From an episode up to its contact to -log p of what its adversaries did."""

MOST = 300  # most episodes that are played for one failure
WINDOW = (3, 30)  # least and most steps of a change
LATER = 5  # most steps of a shift in time
DEVIATIONS = (0.05, 0.15, 0.4)  # of an action that is moved
FACTORS = (0.3, 1.2)  # by which actions are weakened or strengthened


def unlikely(evidence: Evidence) -> float:
    """Computes -log p of the least likely feature and of all together, nats.

    Choice: their sum, since either decides the class, and the larger one alone hides what a change gains in the other.
    """
    judged = plausibility_of(evidence)
    return -sum(math.log(max(p, LEAST_LOG)) for p in (judged.least_probability, judged.joint_probability))


def most_plausible(bundle: Bundle, score: Unlikely = unlikely, most: int = MOST) -> Bundle:
    """Returns the least unlikely motion that was found, as a bundle that keeps the recording too.

    Scene, striker, type of conflict and grade stay, and what is not minor does not become so.

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
        """Scores the recording, which the stage has just played."""
        self.stage, self._score = stage, score
        self.best = stage.original
        self.before = self.after = score(stage.evidence())
        self._random = np.random.default_rng(0)

    def step(self) -> None:
        """Plays one change, and keeps it if it is better."""
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
        """Returns the motion as a bundle, the recording within."""
        stage, best = self.stage, self.best
        held = sum(stage.fails(copy) for copy in stage.copies(best, SHARE, COPIES, self._random))
        played = play(stage.env, stage.scene(best), best.seed, best.actions)
        violation = alike(played.found, stage.failure)
        assert violation is not None  # or it would not have been kept
        episode = played.record(recorded.manifest.episode).model_copy(update={"script": None})
        motion = PlausibleMotion(
            before=self.before,
            after=self.after,
            episodes=stage.played + 1,
            held=held,
            copies=COPIES,
            sentence=story(played.series, violation),
        )
        made = make_bundle(recorded.manifest.spec, episode, played.series, played.signal_heads, recorded.policy)
        manifest = made.manifest.model_copy(update={"plausible": motion})
        return replace(made, manifest=manifest, recorded=replace(recorded, policy=None))


def changed(actions: Floats, random: np.random.Generator) -> Floats:
    """Returns actions, `T x a` in [-1, 1], of which one column differs over a while."""
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
    """Returns a column's actions over a while, changed in one way."""
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
