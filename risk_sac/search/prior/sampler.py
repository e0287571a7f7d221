"""Proposes scenes and scripts from the prior beside those that an archive search breeds.

Arms share the episodes by what they have found lately: the script model, the archive search and, where the scenario
is like a family of the paper or goes on from an earlier run, a library.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.records import DrivenBy
from risk_sac.search.encounter import Encounter
from risk_sac.search.prior.files import weights_digest
from risk_sac.search.prior.start import PriorStart
from risk_sac.search.scene_optimizer import ArchiveOptimizer
from risk_sac.search.scene_optimizer.archive import DEVIATIONS, SHARES
from risk_sac.search.scene_optimizer.base import State
from risk_sac.verdicts.distinct import CANDIDATE, NEW_VARIANT, Finds
from risk_sac.world.types import Floats

CANDIDATES = 1024  # points among which the model chooses
FREE_SCENES = 0.5  # of its episodes, those whose scene it chooses too
SCENES = 32  # among which it chooses then
RANDOM_SCRIPTS = 0.25  # of the scripts among which it chooses
DISCOUNT, PRIOR_EPISODES, LEAST = 0.97, 5.0, 0.08
EARLIER_SHARE = 0.5  # of the draws from the library, from what an earlier run found
UNSEEN_TRUST = 0.5  # share of the model's credit where there is no library
UNTRIED = 0.5, 1.0, 1.0  # worth per episode that arms are credited with at first


class Arm(IntEnum):
    """A source of proposed points."""

    ARCHIVE = 0
    LIBRARY = 1
    MODEL = 2


class Yields:
    """Discounted worth per episode of each arm; chances go by its square.

    An arm that is not drawn keeps its yield.
    """

    def __init__(self, arms: tuple[Arm, ...], trust: float = 1.0) -> None:
        """Tries nothing yet; `trust` is the share of their credit that library and model have."""
        self._arms = arms
        self._worth = {arm: UNTRIED[arm] * PRIOR_EPISODES * (1.0 if arm is Arm.ARCHIVE else trust) for arm in arms}
        self._episodes = dict.fromkeys(arms, PRIOR_EPISODES)

    def draw(self, random: np.random.Generator) -> Arm:
        """Draws an arm."""
        squares = np.array([(self._worth[arm] / self._episodes[arm]) ** 2 for arm in self._arms])
        total = squares.sum()
        shares = squares / total if total > 0 else np.full(len(squares), 1.0 / len(squares))
        shares = LEAST + (1.0 - LEAST * len(self._arms)) * shares
        return self._arms[random.choice(len(self._arms), p=shares)]

    def tell(self, arm: Arm, worth: float) -> None:
        """Counts an episode of an arm."""
        self._worth[arm] = DISCOUNT * self._worth[arm] + worth
        self._episodes[arm] = DISCOUNT * self._episodes[arm] + 1.0

    def state(self) -> State:
        """Plain values to continue from."""
        return {"worth": [self._worth[arm] for arm in self._arms], "episodes": [self._episodes[a] for a in self._arms]}

    def load(self, state: State) -> None:
        """Continues from `state()`."""
        self._worth = dict(zip(self._arms, state["worth"], strict=True))
        self._episodes = dict(zip(self._arms, state["episodes"], strict=True))


class PriorOptimizer(ArchiveOptimizer):
    """Archive search that the prior proposes points to."""

    kind = "prior"
    initial = 0
    learned = True

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int, start: PriorStart) -> None:
        super().__init__(dimension, config, seed)
        self._model, self._genes = start.model, start.model.genes
        self._library, self._library_kinds, self._earlier = start.library, start.library_kinds, start.earlier
        self._library_worth, self._belief = start.library_worth, start.belief
        arms = {Arm.ARCHIVE: True, Arm.LIBRARY: len(self._library) > 0, Arm.MODEL: self.learned}
        trust = float(start.library_worth.mean()) if len(self._library) else UNSEEN_TRUST
        self._yields = Yields(tuple(arm for arm, there in arms.items() if there), trust)
        self._arm = Arm.ARCHIVE
        self._played: list[int] = []  # rows of the library
        self._finds = Finds()

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        self._arm = self._yields.draw(self._random)
        if self._arm is Arm.ARCHIVE:
            return super().ask()
        self._parent = None
        if self._arm is Arm.LIBRARY:
            self.driven_by = DrivenBy.SCRIPT
            return self._from_library()
        self.driven_by = DrivenBy.MODEL
        return self._from_model()

    @property
    def origin(self) -> Mapping[str, Any]:
        """See `SceneOptimizer.origin`: the place of the parent, and the arm."""
        return {"parent": self._elites.key(self._parent), "arm": int(self._arm)}

    @origin.setter
    def origin(self, origin: Mapping[str, Any]) -> None:
        self._parent, self._arm = self._elites.at(origin["parent"]), Arm(origin["arm"])

    def _from_library(self) -> Floats:
        """Draws a row that was not played yet.

        A row is the more likely the rarer its variant is so far. After the last row all can be drawn again.

        Some of the draws are from what an earlier run found, while some of that was not played.
        """
        if len(self._played) == len(self._library):
            self._played.clear()
        rows = np.setdiff1d(np.arange(len(self._library)), self._played)
        earlier = rows[rows < self._earlier]
        if len(earlier) and self._random.random() < EARLIER_SHARE:
            rows = earlier
        novelty = np.array([_novelty(self._finds.variants[self._library_kinds[row]]) for row in rows])
        weights = novelty * self._library_worth[rows]
        row = int(self._random.choice(rows, p=weights / weights.sum()))
        self._played.append(row)
        point: Floats = self._library[row].copy()
        return point

    def _from_model(self) -> Floats:
        """Returns the best of many points: in one random scene, or in several."""
        size = self._dimension - self._genes
        scenes = SCENES if self._random.random() < FREE_SCENES else 1
        points = np.empty((CANDIDATES, self._dimension))
        points[:, :size] = np.repeat(self._random.random((scenes, size)), CANDIDATES // scenes, axis=0)
        points[:, size:] = self._scripts(CANDIDATES, size)
        prediction = self._model.predict(points, self._belief)
        worth = NEW_VARIANT * (prediction.fails + CANDIDATE * prediction.candidate)
        novelty = np.array([_novelty(self._finds.variants[kind]) for kind in self._model.kinds])
        best: Floats = points[int((worth * (prediction.kinds @ novelty)).argmax())]
        return best

    def _scripts(self, count: int, size: int) -> Floats:
        """Draws scripts, `count x genes`: mutated ones of the library and of the own elites, and random ones."""
        known = np.concatenate([self._library, *(each.point[None] for each in self._elites.pool())])[:, size:]
        if not len(known):
            return self._random.random((count, self._genes))
        parents = known[self._random.integers(len(known), size=count)]
        changed = self._random.random(parents.shape) < self._random.choice(SHARES, size=(count, 1))
        deviations = self._random.choice(DEVIATIONS, size=(count, 1))
        step = np.where(changed, deviations * self._random.standard_normal(parents.shape), 0.0)
        scripts: Floats = np.clip(parents + step, 0.0, 1.0)
        fresh = self._random.random(count) < RANDOM_SCRIPTS
        scripts[fresh] = self._random.random((int(fresh.sum()), scripts.shape[1]))
        return scripts

    def _learn(self, point: Floats, mean_return: float | None, score: float | None, encounter: Encounter) -> None:
        super()._learn(point, mean_return, score, encounter)
        if mean_return is None:
            return
        self._yields.tell(self._arm, self._finds.add(encounter.valid_violations))
        if self.learned:
            failed = np.array([bool(encounter.valid_violations)])
            self._belief = self._model.believe(self._belief, point[None], failed)

    def _identity(self) -> State:
        return super()._identity() | {"weights": weights_digest()}

    def state(self) -> State:
        """See `SceneOptimizer.state`."""
        return {
            **super().state(),
            "belief": self._belief.tolist(),
            "yields": self._yields.state(),
            "played": list(self._played),
            "finds": self._finds.state(),
        }

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load(state)
        self._belief = np.array(state["belief"])
        self._yields.load(state["yields"])
        self._played = list(state["played"])
        self._finds.load(state["finds"])


class ReplayOptimizer(PriorOptimizer):
    """The library and the archive search without the model: the control that learning has to beat."""

    kind = "replay"
    learned = False


def _novelty(found: int) -> float:
    """Share of its worth that another failure of a variant has."""
    return 1.0 / (1.0 + found) ** 2
