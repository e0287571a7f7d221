"""How near a failure is to not failing: the share of its neighbours that fail as it does."""

from collections.abc import Iterable, Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np

from risk_sac.failures.bundle import Bundle
from risk_sac.failures.surroundings import Region, Share
from risk_sac.failures.variants import Stage, Variant

SCENES, COPIES = (0.01, 0.02, 0.05), 40  # shares of the ranges of a scene's parameters, and copies at each
SEEDS = 10  # of the traffic
ACTIONS = 0.05


def region(bundle: Bundle) -> Region:
    """Plays a failure in scenes near its own, in other traffic, and with other actions: 170 episodes.

    An episode fails as it did if it ends in a valid contact with the same striker, in the same type of conflict.

    Raises:
      ConfigError: the bundle holds no valid failure that can be played here.
      SimulationError: it does not happen here.
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
