"""Risk-guided replay against a cumulative sum with binary search, and uniform replay."""

import numpy as np
import pytest

from risk_sac.config import ReplayConfig
from risk_sac.search.agents.priority import SumTree, priority
from risk_sac.search.agents.replay import RiskPrioritizedReplay, UniformReplay
from risk_sac.search.agents.transition import Transition
from risk_sac.world.types import Floats
from tests.benchmarks.timing import interleaved

STORED, BATCH, ROUNDS, IN_A_ROW = 100_000, 256, 400, 20
OBSERVATIONS, ACTIONS = 60, 6


class CumulativeSum(SumTree):
    """The same interface without a tree."""

    def __init__(self, capacity: int) -> None:
        self._priorities = np.zeros(capacity)
        self._ends = np.zeros(capacity)

    @property
    def total(self) -> float:
        return float(self._ends[-1])

    def __getitem__(self, indices: np.ndarray) -> Floats:
        return self._priorities[indices]

    def set(self, indices: np.ndarray, priorities: Floats) -> None:
        self._priorities[indices] = priorities

    def rebuild(self, priorities: Floats) -> None:
        self._priorities[: len(priorities)] = priorities

    def find(self, fractions: Floats) -> np.ndarray:
        np.cumsum(self._priorities, out=self._ends)
        return self._ends.searchsorted(fractions * self._ends[-1], side="right")


def full_replay() -> RiskPrioritizedReplay:
    replay = RiskPrioritizedReplay(OBSERVATIONS, ACTIONS, ReplayConfig(capacity=STORED))
    generator = np.random.default_rng(0)
    for _ in range(STORED):
        observation = generator.standard_normal(OBSERVATIONS, np.float32)
        replay.add(
            Transition(
                observation=observation,
                action=observation[:ACTIONS],
                risk_reward=0.0,
                cost=0.0,
                robustness=generator.normal(),
                next_robustness=0.0,
                next_observation=observation,
                terminated=False,
                accumulated_reward=generator.normal(),
            )
        )
    while (new := replay.take_unmeasured(BATCH)) is not None:
        replay.update(new.indices, generator.exponential(size=len(new.indices)))
    return replay


@pytest.mark.bench
def test_rper_sampling_and_update_beat_a_cumulative_sum() -> None:
    tree, plain = full_replay(), full_replay()
    plain._tree = CumulativeSum(STORED)
    plain._tree.rebuild(priority(plain._terms, plain._scales, plain._config))
    generator = np.random.default_rng(1)
    errors = generator.exponential(size=BATCH)

    uniform = tree._storage

    def turn(replay: RiskPrioritizedReplay | UniformReplay) -> None:
        replay.update(replay.sample(BATCH, generator).indices, errors)

    times = interleaved(lambda: turn(tree), lambda: turn(plain), lambda: turn(uniform), rounds=ROUNDS)
    tree_s, plain_s, uniform_s = np.median(times.wall_s, axis=0)
    # By turns each finds the caches full of the others' numbers; in a row, of its own.
    in_a_row = interleaved(lambda: turn(tree), lambda: turn(uniform), rounds=ROUNDS // IN_A_ROW, repeats=IN_A_ROW)
    tree_row_s, uniform_row_s = np.median(in_a_row.wall_s, axis=0)
    print(
        f"\nRPER sample + update, {STORED} stored, batch {BATCH}: {tree_s * 1e6:.0f} µs, of which a uniform replay"
        f" takes {uniform_s * 1e6:.0f} too; cumulative sum {plain_s * 1e6:.0f} µs; {plain_s / tree_s:.2f} times as"
        f" fast; {IN_A_ROW} in a row {tree_row_s * 1e6:.0f} and {uniform_row_s * 1e6:.0f} µs each"
    )
    assert plain_s / tree_s >= 2.5
