"""Archive search: scenes and scripts are bred from those that led to distinct failures; nothing is learned.

A point is a scene and, behind it, the genes of the adversaries' scripts, all in the unit cube.

Choice: no pyribs. Its archives have a number of cells that is known beforehand, and ours are found, in words; its
emitters draw parents evenly, and which parent to build on is what matters here.
"""

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.scene_optimizer.base import NOBODY, Encounter, State, check_identity, check_told
from risk_sac.scene_optimizer.elites import Elite, Elites
from risk_sac.scene_optimizer.objective import RunningMaximum, objective, update_running_maximum
from risk_sac.types import Floats

INITIAL, RANDOM_SHARE = 12, 0.15  # points drawn at random: the first ones, and of the rest, where elites abound
DEVIATIONS = (0.05, 0.15, 0.4)  # of a mutation
SHARES = (0.2, 0.5, 1.0)  # of the coordinates that it changes
CROSSED, CROSSING_DEVIATION = 0.5, 0.2  # how often, and how far, it also moves along the line to another elite


class ArchiveOptimizer:
    """Breeds points from elites; scores them so that every method's records carry f_e."""

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        self._identity: State = {"kind": "archive", "dimension": dimension, "seed": seed}
        self._dimension = dimension
        self._config = config
        self._random = np.random.default_rng(seed)
        self._elites = Elites()
        self._asked = 0
        self._parent: Elite | None = None  # of the point that was asked for last
        self._maximum: RunningMaximum | None = None

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        self._asked += 1
        pool = self._elites.pool()
        random_share = max(RANDOM_SHARE, 1.0 / (2 + self._elites.failures))
        if self._asked <= INITIAL or not pool or self._random.random() < random_share:
            self._parent = None
            return self._random.random(self._dimension)
        self._parent = self._elites.draw(pool, self._random)
        return mutated(self._parent.point, pool[self._random.integers(len(pool))].point, self._random)

    def tell(self, u: Floats, mean_return: float | None, encounter: Encounter = NOBODY) -> float | None:
        """See `SceneOptimizer.tell`."""
        point = check_told(u, mean_return, self._dimension)
        parent, self._parent = self._parent, None
        if mean_return is None:
            return None
        self._elites.add_misses(point, encounter.encounters_s)
        if encounter.collision is not None and encounter.collision.valid:
            self._elites.add_failure(point, encounter.collision, parent)
        self._maximum = update_running_maximum(self._maximum, mean_return, self._config.running_maximum_rate)
        return objective(mean_return, self._maximum.smoothed)

    def state(self) -> State:
        """See `SceneOptimizer.state`; taken between two episodes, when no point is out."""
        return {
            **self._identity,
            "random": self._random.bit_generator.state,
            "elites": self._elites.state(),
            "asked": self._asked,
            "maximum": None if self._maximum is None else tuple(self._maximum),
        }

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        check_identity(state, self._identity)
        self._random.bit_generator.state = state["random"]
        self._elites.load(state["elites"])
        self._asked = state["asked"]
        self._maximum = None if state["maximum"] is None else RunningMaximum(*state["maximum"])


def mutated(parent: Floats, other: Floats, random: np.random.Generator) -> Floats:
    """A point near `parent`, perhaps on the way to `other`; what would leave the unit cube is reflected.

    Source: the line between two elites is that of Vassiliades and Mouret, "Discovering the elite hypervolume by
    leveraging interspecies correlation" (arXiv 1804.03906).
    """
    step = random.choice(DEVIATIONS) * random.standard_normal(len(parent))
    if random.random() < CROSSED:
        step += CROSSING_DEVIATION * random.standard_normal() * (other - parent)
    changed = random.random(len(parent)) < random.choice(SHARES)
    moved = np.abs(parent + np.where(changed, step, 0.0))
    reflected: Floats = np.where(moved > 1.0, 2.0 - moved, moved).clip(0.0, 1.0)
    return reflected
