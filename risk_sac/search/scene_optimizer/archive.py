"""Archive of elites that a bandit mutates or leaves for the prior."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from risk_sac.config import SceneOptimizerConfig
from risk_sac.records import NO_CONTACT, Collision, DrivenBy, Severity, Violation
from risk_sac.search.encounter import Encounter
from risk_sac.search.scene_optimizer.base import SceneOptimizer, State
from risk_sac.verdicts.distinct import Finds, variant_name
from risk_sac.world.types import Floats


class DiscountedBandit:
    """Two arms, chosen in proportion to the square of their discounted yields.

    yield_i = (prior_yield · prior_cost + Σ discount^k worth) / (prior_cost + Σ discount^k cost),  p_i ∝ yield_i²

    k counts the later pulls of the same arm, so an arm that is not pulled keeps its yield.
    """

    def __init__(
        self,
        *,
        discount: float,
        prior_worth: float,
        prior_cost: float,
        least: float,
        unit_costs: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        """Begins without experience: both arms are as likely.

        Args:
          discount: weight of a pull after one more pull of the same arm.
          prior_worth: worth that an untried arm is credited with.
          prior_cost: cost that this worth is taken to have had.
          least: smallest share of all costs that is spent on either arm.
          unit_costs: cost of a unit of effort of each arm; only their ratio counts.
        """
        self._discount, self._prior_worth, self._prior_cost = discount, prior_worth, prior_cost
        self._unit_costs = unit_costs
        self._bounds = self._probability_of(least), self._probability_of(1.0 - least)
        self._worth, self._spent = [0.0, 0.0], [0.0, 0.0]

    @property
    def probability(self) -> float:
        """Returns the probability of pulling arm 1 next.

        Both arms' pulls are taken to need equal effort.
        """
        first, second = (
            ((worth + self._prior_worth) / (spent + self._prior_cost)) ** 2
            for worth, spent in zip(self._worth, self._spent, strict=True)
        )
        low, high = self._bounds
        return min(max(second / (first + second), low), high)

    def tell(self, arm: int, worth: float, effort: float = 1.0) -> None:
        """Counts a pull of arm 0 or 1, with worth and effort."""
        self._worth[arm] = self._discount * self._worth[arm] + worth
        self._spent[arm] = self._discount * self._spent[arm] + self._unit_costs[arm] * effort

    def state(self) -> dict[str, Any]:
        """Plain values, to continue from."""
        return {"worth": list(self._worth), "spent": list(self._spent)}

    def load(self, state: dict[str, Any]) -> None:
        """Continues from `state()`."""
        self._worth, self._spent = list(state["worth"]), list(state["spent"])

    def _probability_of(self, share: float) -> float:
        """Returns the chance of arm 1 that spends this share of costs."""
        first, second = self._unit_costs
        return share * first / (share * first + (1.0 - share) * second)


INITIAL, RANDOM_SHARE = 12, 0.15  # points drawn at random: the first ones, and of the rest, where elites abound
DEVIATIONS = (0.05, 0.15, 0.4)  # of a mutation
SHARES = (0.2, 0.5, 1.0)  # of the coordinates that it changes
REFLECTED = 0.5  # share of the children
CROSSED, CROSSING_DEVIATION = 0.5, 0.2  # how often, and how far, it also moves along the line to another elite
PREVENTABLE_WORTH = 1.0
ALMOST_WORTH, IMPACT_MPS = 0.4, 5.0  # where R157's driver only just touches; a third of it where at 5.5 m/s
LEAST_WORTH = 0.02  # of a failure
MINOR_SHARE = 0.25  # of its worth that a minor contact has
NEAR_MISS_WORTH = 0.1
NEAR_MARGIN = 0.3  # of a requirement, in scales: what undisturbed traffic keeps is about 1
CREDIT = 0.5  # of a parent, for each unit of worth that `Finds` gives to what is new


@dataclass(slots=True, kw_only=True)
class Elite:
    """An episode worth building on."""

    point: Floats  # its scene and its genes, in the unit cube
    worth: float
    target: str  # the adversary that struck, or the requirement that was violated without contact
    kind: str  # elites of one kind share their chances
    missed: float = 0.0  # of a near miss: its smallest time to encounter, s, or its least robustness, in scales
    drawn: int = 0
    credit: float = 0.0  # for what was new among its children


class Elites:
    """Best failure per variant, and near miss per target without one."""

    def __init__(self) -> None:
        self._failures: dict[str, Elite] = {}  # by variant: its niche
        self._misses: dict[str, Elite] = {}  # by target
        self._finds = Finds()

    @property
    def failures(self) -> int:
        """Niches that were reached."""
        return len(self._failures)

    def pool(self) -> list[Elite]:
        """Returns all failures, and near misses of targets without one."""
        hit = {elite.target for elite in self._failures.values()}
        return [*self._failures.values(), *(miss for name, miss in self._misses.items() if name not in hit)]

    def key(self, elite: Elite | None) -> tuple[str, str] | None:
        """Names an elite's set and niche or target; None once replaced."""
        places = (("failures", self._failures), ("misses", self._misses))
        return next(((place, name) for place, held in places for name, one in held.items() if one is elite), None)

    def at(self, key: Sequence[str] | None) -> Elite | None:
        """Returns the elite at a place that `key` named."""
        if key is None:
            return None
        place, name = key
        return (self._failures if place == "failures" else self._misses).get(name)

    def draw(self, pool: list[Elite], random: np.random.Generator) -> Elite:
        """Draws one of the pool.

        p ∝ worth · (1 + credit) / (1 + drawn) / √(elites of its kind)
        """
        alike = Counter(elite.kind for elite in pool)
        weights = np.array([e.worth * (1 + e.credit) / (1 + e.drawn) / math.sqrt(alike[e.kind]) for e in pool])
        elite = pool[random.choice(len(pool), p=weights / weights.sum())]
        elite.drawn += 1
        return elite

    def add_failure(self, point: Floats, violation: Collision | Violation, parent: Elite | None) -> None:
        """Adds a valid violation if it is its niche's first or best."""
        niche = variant_name(violation)
        known = self._failures.get(niche)
        worth = _worth(violation)
        new = self._finds.add([violation])
        if parent is not None:
            parent.credit += CREDIT * new
        if known is None or known.worth < worth:
            target = violation.other_id if isinstance(violation, Collision) else violation.requirement
            self._failures[niche] = Elite(point=point, worth=worth, target=target, kind=violation.kind)

    def add_misses(self, point: Floats, encounter: Encounter) -> None:
        """Adds near misses by adversary and by requirement, where none was nearer.

        Choice: of an adversary by the time to encounter, and not by the gap, which is small whenever something passes
        by. A requirement whose margin nothing has touched is no aim, or a share of the search would go to what this
        ego cannot do.
        """
        missed = dict(encounter.encounters_s)
        missed |= {
            name: margin for name, margin in encounter.margins.items() if name != NO_CONTACT and margin < NEAR_MARGIN
        }
        for name, nearest in missed.items():
            known = self._misses.get(name)
            if known is None or nearest <= known.missed:
                kind = f"near miss of {name}"
                self._misses[name] = Elite(point=point, worth=NEAR_MISS_WORTH, target=name, kind=kind, missed=nearest)

    def state(self) -> State:
        """Returns plain values to continue from."""
        return {
            "failures": {niche: _plain(elite) for niche, elite in self._failures.items()},
            "misses": {name: _plain(elite) for name, elite in self._misses.items()},
            "finds": self._finds.state(),
        }

    def load(self, state: State) -> None:
        """Continues from `state()`."""
        self._failures = {niche: _elite(elite) for niche, elite in state["failures"].items()}
        self._misses = {name: _elite(elite) for name, elite in state["misses"].items()}
        self._finds.load(state["finds"])


def _plain(elite: Elite) -> State:
    return {**asdict(elite), "point": elite.point.tolist()}


def _elite(plain: State) -> Elite:
    return Elite(**{**plain, "point": np.array(plain["point"])})


def _worth(violation: Collision | Violation) -> float:
    """Computes a violation's worth: 1 if preventable, else less.

    Of other contacts it is the larger, the slower R157's driver would have touched.
    Choice: a minor contact has a share of it, so that a niche prefers what the headline counts.
    """
    share = MINOR_SHARE if isinstance(violation, Collision) and violation.severity is Severity.MINOR else 1.0
    return share * _worth_of_any(violation)


def _worth_of_any(violation: Collision | Violation) -> float:
    if violation.preventable:
        return PREVENTABLE_WORTH
    if isinstance(violation, Violation):
        return ALMOST_WORTH * min(-violation.robustness, 1.0) + LEAST_WORTH
    impact_speed_mps = violation.judgement.drivers["r157"].impact_speed_mps
    return ALMOST_WORTH * math.exp(-impact_speed_mps / IMPACT_MPS) + LEAST_WORTH


class ArchiveOptimizer(SceneOptimizer):
    """Optimiser that breeds points from elites, scored so that records have f_e.

    Attributes:
      reflect: returns mirror images of points, `n x d`; None where they are not points of the same space. Choice: half
        of the children are reflected, or the side of the first elite would be that of all its descendants.
    """

    kind = "archive"
    initial = INITIAL  # points that are drawn at random at first
    reflect: Callable[[Floats], Floats] | None = None

    def __init__(self, dimension: int, config: SceneOptimizerConfig, seed: int) -> None:
        super().__init__(dimension, config, seed)
        self._random = np.random.default_rng(seed)
        self._elites = Elites()
        self._asked = 0
        self._parent: Elite | None = None  # of the point that was asked for last

    def ask(self) -> Floats:
        """See `SceneOptimizer.ask`."""
        self._asked += 1
        pool = self._elites.pool()
        random_share = max(RANDOM_SHARE, 1.0 / (2 + self._elites.failures))
        if self._asked <= self.initial or not pool or self._random.random() < random_share:
            self._parent, self.driven_by = None, DrivenBy.RANDOM
            return self._random.random(self._dimension)
        self._parent, self.driven_by = self._elites.draw(pool, self._random), DrivenBy.SCRIPT
        child = mutated(self._parent.point, pool[self._random.integers(len(pool))].point, self._random)
        if self.reflect is not None and self._random.random() < REFLECTED:
            child = self.reflect(child[None])[0]
        return child

    @property
    def origin(self) -> Mapping[str, Any]:
        """See `SceneOptimizer.origin`: the place of the parent."""
        return {"parent": self._elites.key(self._parent)}

    @origin.setter
    def origin(self, origin: Mapping[str, Any]) -> None:
        self._parent = self._elites.at(origin.get("parent"))

    def _learn(self, point: Floats, mean_return: float | None, score: float | None, encounter: Encounter) -> None:
        parent, self._parent = self._parent, None
        if mean_return is None:
            return
        self._elites.add_misses(point, encounter)
        for violation in encounter.valid_violations:
            self._elites.add_failure(point, violation, parent)

    def state(self) -> State:
        """See `SceneOptimizer.state`; no point is out then."""
        return {
            **super().state(),
            "random": self._random.bit_generator.state,
            "elites": self._elites.state(),
            "asked": self._asked,
        }

    def load(self, state: State) -> None:
        """See `SceneOptimizer.load`."""
        super().load(state)
        self._random.bit_generator.state = state["random"]
        self._elites.load(state["elites"])
        self._asked = state["asked"]


def mutated(parent: Floats, other: Floats, random: np.random.Generator) -> Floats:
    """Returns a point near `parent`, perhaps on the way to `other`.

    A point outside the unit cube is reflected into it.

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
