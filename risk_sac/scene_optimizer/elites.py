"""The archive: for each distinct failure the one worth building on, and near misses of who has struck nobody yet.

Source: Mouret and Clune, "Illuminating search spaces by mapping elites" (arXiv 1504.04909).
Choice: niches are the product's distinct failures, so that the search fills what its user counts.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from risk_sac.records import Collision
from risk_sac.types import Floats
from risk_sac.verdicts.distinct import cell_of, signature_of

PREVENTABLE_WORTH = 1.0
ALMOST_WORTH, IMPACT_MPS = 0.4, 5.0  # where the careful driver only just touches; a third of it where at 5.5 m/s
LEAST_WORTH = 0.02  # of a failure
NEAR_MISS_WORTH = 0.1
NEW, NEW_PREVENTABLE = 0.5, 2.0  # what a parent is credited with for a distinct failure, and for a preventable one


@dataclass(slots=True, kw_only=True)
class Elite:
    """An episode worth building on."""

    point: Floats  # its scene and its genes, in the unit cube
    worth: float
    striker: str
    kind: str  # elites of one kind share their chances
    missed_s: float = 0.0  # of a near miss: its smallest time to encounter
    drawn: int = 0
    credit: float = 0.0  # for what was new among its children


class Elites:
    """One elite for each distinct failure, and one near miss for each adversary."""

    def __init__(self) -> None:
        self._failures: dict[str, Elite] = {}  # by niche
        self._misses: dict[str, Elite] = {}  # by adversary
        self._preventable: set[str] = set()  # niches

    @property
    def failures(self) -> int:
        """Niches that were reached."""
        return len(self._failures)

    def pool(self) -> list[Elite]:
        """Whom to build on: all failures, and the near misses of who has none."""
        struck = {elite.striker for elite in self._failures.values()}
        return [*self._failures.values(), *(miss for name, miss in self._misses.items() if name not in struck)]

    def draw(self, pool: list[Elite], random: np.random.Generator) -> Elite:
        """One of the pool, the likelier the more it is worth and yielded, and the less it and its kind were tried.

        p ∝ worth · (1 + credit) / (1 + drawn) / √(elites of its kind)
        """
        alike = Counter(elite.kind for elite in pool)
        weights = np.array([e.worth * (1 + e.credit) / (1 + e.drawn) / math.sqrt(alike[e.kind]) for e in pool])
        elite = pool[random.choice(len(pool), p=weights / weights.sum())]
        elite.drawn += 1
        return elite

    def add_failure(self, point: Floats, collision: Collision, parent: Elite | None) -> None:
        """Takes up a valid failure, if it is the first in its niche, or worth more than that one."""
        kind = signature_of(collision)
        niche = f"{kind} {cell_of(collision)}"
        known = self._failures.get(niche)
        worth = _worth(collision)
        if parent is not None:
            new_preventable = collision.preventable and niche not in self._preventable
            parent.credit += NEW * (known is None) + NEW_PREVENTABLE * new_preventable
        if collision.preventable:
            self._preventable.add(niche)
        if known is None or known.worth < worth:
            self._failures[niche] = Elite(point=point, worth=worth, striker=collision.other_id, kind=kind)

    def add_misses(self, point: Floats, encounters_s: Mapping[str, float]) -> None:
        """Takes up how nearly each adversary struck the ego, where none did so more nearly.

        Choice: by the time to encounter, and not by the gap, which is small whenever somebody passes by.
        """
        for name, missed_s in encounters_s.items():
            known = self._misses.get(name)
            if known is None or missed_s <= known.missed_s:
                self._misses[name] = Elite(
                    point=point, worth=NEAR_MISS_WORTH, striker=name, kind=f"near miss of {name}", missed_s=missed_s
                )

    def state(self) -> dict[str, Any]:
        """Plain values, to go on from."""
        return {
            "failures": {niche: _plain(elite) for niche, elite in self._failures.items()},
            "misses": {name: _plain(elite) for name, elite in self._misses.items()},
            "preventable": sorted(self._preventable),
        }

    def load(self, state: dict[str, Any]) -> None:
        """Goes on from `state()`."""
        self._failures = {niche: _elite(elite) for niche, elite in state["failures"].items()}
        self._misses = {name: _elite(elite) for name, elite in state["misses"].items()}
        self._preventable = set(state["preventable"])


def _plain(elite: Elite) -> dict[str, Any]:
    return {**asdict(elite), "point": elite.point.tolist()}


def _elite(plain: dict[str, Any]) -> Elite:
    return Elite(**{**plain, "point": np.array(plain["point"])})


def _worth(collision: Collision) -> float:
    """1 for a preventable failure; of the rest the more, the slower the careful driver would have touched."""
    if collision.preventable:
        return PREVENTABLE_WORTH
    judged = collision.judgement
    if judged is None or "careful" not in judged.drivers:
        return LEAST_WORTH
    return ALMOST_WORTH * math.exp(-judged.drivers["careful"].impact_speed_mps / IMPACT_MPS) + LEAST_WORTH
