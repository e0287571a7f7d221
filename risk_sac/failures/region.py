"""How near a failure is to not failing: the share of its neighbours that fail as it does."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np

from risk_sac.failures.bundle import Bundle
from risk_sac.failures.variants import Stage, Variant
from risk_sac.metrics import wilson_interval
from risk_sac.records import Record

SCENES, COPIES = (0.01, 0.02, 0.05), 40  # shares of the ranges of a scene's parameters, and copies at each
SEEDS = 10  # of the traffic
ACTIONS = 0.05
NEEDLE = 0.5


class Share(Record):
    """Of the copies that differ from a failure in one way, those that fail as it does."""

    what: str
    """In which way they differ."""
    failed: int
    played: int
    low: float
    """Wilson's 95 % interval of the share."""
    high: float

    @classmethod
    def of(cls, what: str, failed: int, played: int) -> "Share":
        """With its interval."""
        low, high = wilson_interval(failed, played)
        return cls(what=what, failed=failed, played=played, low=low, high=high)


class Region(Record):
    """What surrounds a failure; the shares in the order of `region`."""

    shares: tuple[Share, ...]

    @property
    def needle(self) -> bool:
        """Whether fewer than half of the nearest scenes fail: a failure that one would hardly meet again."""
        nearest = self.shares[0]
        return nearest.failed < NEEDLE * nearest.played


def region(bundle: Bundle) -> Region:
    """Plays a failure in scenes near its own, in other traffic, and with other actions: 170 episodes.

    An episode fails as it did if it ends in a valid contact with the same striker, in the same type of conflict.

    Raises:
      ConfigError: the bundle's spec poses no problem that can be run.
      ValueError: what it holds ended without a contact that was judged.
    """
    stage = Stage(bundle)
    with closing(stage.env):
        return Region(shares=tuple(_share(stage, what, variants) for what, variants in _neighbours(stage)))


def _neighbours(stage: Stage) -> Iterator[tuple[str, list[Variant]]]:
    original, space, random = stage.original, stage.space, np.random.default_rng(0)
    for share in SCENES:
        yield f"scene by {share:.0%}", [original.perturbed(space, share, 0.0, random) for _ in range(COPIES)]
    yield "other traffic", [replace(original, seed=original.seed + 1 + i) for i in range(SEEDS)]
    yield f"actions by {ACTIONS:.0%}", [original.perturbed(space, 0.0, ACTIONS, random) for _ in range(COPIES)]


def _share(stage: Stage, what: str, variants: Iterable[Variant]) -> Share:
    failed = [stage.fails(variant) for variant in variants]
    return Share.of(what, sum(failed), len(failed))
