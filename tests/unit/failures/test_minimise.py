from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from risk_sac.failures.minimise import _reduce_actions, without
from risk_sac.failures.variants import Variant


class Needs:
    """A failure that needs some of its units; counts what is tried."""

    def __init__(self, units: Sequence[int], needed: set[int]) -> None:
        self.left, self.needed, self.tried = set(units), needed, 0

    def unneeded(self, chunk: Sequence[int]) -> bool:
        self.tried += 1
        assert set(chunk) <= self.left, "tried again what is gone already"
        if self.needed & set(chunk):
            return False
        self.left -= set(chunk)
        return True


@pytest.mark.parametrize("needed", [set(), {0}, {11}, {3, 4}, {0, 5, 11}, set(range(12))])
def test_what_is_not_needed_goes(needed: set[int]) -> None:
    failure = Needs(range(12), needed)
    without(range(12), failure.unneeded)
    assert failure.left == needed


def test_what_is_not_needed_together_costs_one_try() -> None:
    failure = Needs(range(32), set())
    without(range(32), failure.unneeded)
    assert failure.tried == 1


def test_where_no_action_is_left_nothing_is_weakened() -> None:
    family = SimpleNamespace(adversaries=("lead",))
    env = SimpleNamespace(problem=SimpleNamespace(family=family))
    search: Any = SimpleNamespace(stage=SimpleNamespace(env=env, failure=SimpleNamespace(other_id=None)), taken=0)
    search.left = Variant(scene=np.zeros(1), actions=np.ones((10, 2)), seed=0)

    def take(variant: Variant) -> bool:
        search.left = variant
        search.taken += 1
        return search.taken < 20  # so that the test ends

    search.take = take
    _reduce_actions(search)
    assert search.taken == 1
