from collections.abc import Callable

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from risk_sac.config import ReplayConfig
from risk_sac.search.agents.priority import TERM_CAP, SumTree, TermScales, importance_weights, priority
from risk_sac.search.agents.replay import RiskPrioritizedReplay, UniformReplay
from risk_sac.search.agents.transition import Transition

Make = Callable[..., Transition]
Replay = UniformReplay | RiskPrioritizedReplay
CONFIG = ReplayConfig(capacity=1000)
KINDS = pytest.mark.parametrize("kind", [UniformReplay, RiskPrioritizedReplay])


def store(replay: Replay, transition: Transition, td_error: float) -> None:
    """Adds a transition with its |δ|, as the learner does before drawing."""
    replay.add(transition)
    new = replay.take_unmeasured(1)
    if new is not None:
        replay.update(new.indices, np.array([td_error]))


def filled(kind: type[Replay], count: int, make: Make, seed: int = 0) -> Replay:
    replay = kind(3, 2, CONFIG)
    generator = np.random.default_rng(seed)
    for _ in range(count):
        store(replay, make(generator), float(generator.exponential()))
    return replay


@KINDS
def test_the_oldest_transition_gives_way_once_full(kind, transition):
    replay = kind(3, 2, CONFIG)
    for value in range(CONFIG.capacity + 10):
        store(replay, transition(float(value)), 1.0)
    assert len(replay) == CONFIG.capacity
    batch = replay.sample(4096, np.random.default_rng(0))
    assert batch.risk_reward.min() >= 10.0
    assert batch.risk_reward.max() == CONFIG.capacity + 9


def test_uniform_draws_every_transition_equally_often(random_transition):
    replay = filled(UniformReplay, 50, random_transition)
    counts = np.bincount(replay.sample(50_000, np.random.default_rng(1)).indices, minlength=50)
    assert ((counts - 1000.0) ** 2 / 1000.0).sum() < 86.0  # χ² at 49 degrees of freedom, p = 0.001


def test_rper_draws_in_proportion_to_the_priorities(random_transition):
    replay = filled(RiskPrioritizedReplay, 50, random_transition)
    expected = expected_priorities(replay)
    expected /= expected.sum()
    generator = np.random.default_rng(1)
    # Independent draws, one per call: within a call they are stratified.
    indices = np.concatenate([replay.sample(1, generator).indices for _ in range(20_000)])
    counts = np.bincount(indices, minlength=50)
    assert ((counts - 20_000 * expected) ** 2 / (20_000 * expected)).sum() < 86.0
    # Stratified: no count is further than one draw from its expectation.
    counts = np.bincount(replay.sample(1000, generator).indices, minlength=50)
    assert np.abs(counts - 1000 * expected).max() <= 2.0


def test_rper_weights_follow_equation_10(random_transition):
    replay = filled(RiskPrioritizedReplay, 40, random_transition)
    priorities = expected_priorities(replay)
    batch = replay.sample(64, np.random.default_rng(2))
    weights = (40 * priorities[batch.indices] / priorities.sum()) ** -CONFIG.correction
    assert batch.weight.numpy() == pytest.approx(weights / weights.max(), rel=1e-6)


def test_rper_leaves_equal_equation_9_after_any_mix_of_additions_and_updates(random_transition):
    replay = RiskPrioritizedReplay(3, 2, CONFIG)
    generator = np.random.default_rng(3)
    for _ in range(2500):
        store(replay, random_transition(generator), float(generator.exponential()))
        if generator.uniform() < 0.2:
            indices = replay.sample(16, generator).indices
            replay.update(indices, generator.exponential(size=16))
    leaves = replay._tree[np.arange(len(replay))]
    assert np.array_equal(leaves, priority(replay._terms, replay._scales, CONFIG))
    assert replay._tree.total == pytest.approx(leaves.sum(), rel=1e-14)


def test_rper_hands_out_the_new_transitions_once_and_in_their_order(transition):
    replay = RiskPrioritizedReplay(3, 2, CONFIG)
    assert replay.take_unmeasured(9) is None
    for count in (3, 4, CONFIG.capacity + 5):  # the last wraps around, and its first five are overwritten
        for value in range(count):
            replay.add(transition(float(value)))
        restored = RiskPrioritizedReplay(3, 2, CONFIG)
        restored.load(replay.state())
        for each in (replay, restored):
            taken = []
            while (new := each.take_unmeasured(2)) is not None:
                assert len(new.indices) <= 2
                taken += new.risk_reward.tolist()
                each.update(new.indices, new.risk_reward.double().numpy())
                assert each._terms[0, new.indices].tolist() == new.risk_reward.tolist()
            assert taken == list(range(max(0, count - CONFIG.capacity), count))


@KINDS
def test_a_loaded_replay_draws_what_the_original_draws(kind, random_transition):
    original = filled(kind, 1300, random_transition)  # has wrapped around
    generator = np.random.default_rng(4)
    original.update(original.sample(64, generator).indices, generator.exponential(size=64))
    loaded = kind(3, 2, CONFIG)
    loaded.load(original.state())
    assert len(loaded) == len(original)
    for replay in (original, loaded):
        stream = np.random.default_rng(5)
        for _ in range(800):  # crosses a rescaling
            store(replay, random_transition(stream), float(stream.exponential()))
            drawn = replay.sample(8, stream)
            replay.update(drawn.indices, stream.exponential(size=8))
    first, second = (replay.sample(256, np.random.default_rng(6)) for replay in (original, loaded))
    assert np.array_equal(first.indices, second.indices)
    assert torch.equal(first.weight, second.weight)
    assert torch.equal(first.observation, second.observation)


def expected_priorities(replay: RiskPrioritizedReplay) -> np.ndarray:
    return priority(replay._terms[:, : len(replay)], replay._scales, CONFIG)


PRIORITY_CONFIG = ReplayConfig(
    td_weight=1.0, return_weight=0.5, robustness_weight=0.5, priority_floor=0.05, correction=0.6
)
terms = hnp.arrays(np.float64, st.tuples(st.just(3), st.integers(1, 30)), elements=st.floats(-1e3, 1e3))


def test_priority_of_a_hand_computed_case():
    #              |δ|: min 0, mean 2      R̂: min -1, mean 1     -ρ: constant
    stored = np.array([[0.0, 1.0, 5.0], [-1.0, 0.0, 4.0], [0.3, 0.3, 0.3]])
    # On the common scale: 0, 1/2, 5/2 and 0, 1/2, 5/2 and nothing.
    assert priority(stored, TermScales.of(stored), PRIORITY_CONFIG) == pytest.approx([0.05, 0.75, 3.75])


@given(terms)
def test_priority_is_floored_and_bounded(stored):
    values = priority(stored, TermScales.of(stored), PRIORITY_CONFIG)
    assert (values >= PRIORITY_CONFIG.priority_floor).all()
    assert (values <= 2.0 * TERM_CAP).all()


@given(terms, st.floats(0.1, 10.0), st.floats(-100.0, 100.0))
def test_priority_ignores_the_unit_and_the_zero_of_a_term(stored, factor, offset):
    spread = stored.mean(axis=1) - stored.min(axis=1)
    stored[spread < 1e-3] = 0.0  # either side of the threshold below which a term counts as constant
    moved = stored * factor + offset
    before = priority(stored, TermScales.of(stored), PRIORITY_CONFIG)
    assert priority(moved, TermScales.of(moved), PRIORITY_CONFIG) == pytest.approx(before, rel=1e-6, abs=1e-6)


def test_one_outlier_counts_for_at_most_ten_average_terms():
    stored = np.zeros((3, 1000))
    stored[0] = 1.0
    stored[0, :2] = 0.0, 1e6
    assert priority(stored, TermScales.of(stored), PRIORITY_CONFIG).max() == TERM_CAP


def test_importance_weights_of_a_hand_computed_case():
    # N P = 4, 1, 1/4; ^-0.5 = 1/2, 1, 2; over the largest.
    weights = importance_weights(np.array([1.0, 0.25, 0.0625]), size=4, correction=0.5)
    assert weights == pytest.approx([0.25, 0.5, 1.0])


def test_find_walks_the_cumulative_sum():
    tree = SumTree(4)
    tree.rebuild(np.array([1.0, 0.0, 2.0, 1.0]))  # ends at 1, 1, 3, 4
    assert tree.total == 4.0
    assert tree.find(np.array([0.0, 0.2, 0.25, 0.7, 0.75, 0.999])).tolist() == [0, 0, 2, 2, 3, 3]


@given(hnp.arrays(np.float64, st.integers(1, 200), elements=st.integers(0, 2**20).map(float)), st.data())
def test_total_is_exactly_the_sum_after_any_writes(values, data):
    # Whole numbers add without rounding, so nothing but the exact sum passes.
    tree = SumTree(len(values))
    tree.rebuild(values)
    for _ in range(3):
        indices = np.array(data.draw(st.lists(st.integers(0, len(values) - 1), min_size=1, max_size=20)))
        written = np.array(data.draw(st.lists(st.integers(0, 2**20), min_size=len(indices), max_size=len(indices))))
        tree.set(indices, written.astype(float))
        values[indices] = written
    assert tree.total == values.sum()
    assert (tree[np.arange(len(values))] == values).all()


@given(
    hnp.arrays(np.float64, st.integers(1, 100), elements=st.sampled_from([0.0, 1e-12, 0.1, 0.3, 1.0, 7.0, 1e9])).filter(
        lambda values: values.sum() > 0
    ),
    st.lists(st.floats(0.0, 1.0), min_size=1, max_size=50),
)
def test_find_never_returns_a_leaf_of_priority_zero(values, fractions):
    tree = SumTree(128)
    tree.rebuild(values)
    found = tree.find(np.array(fractions))
    assert (found < len(values)).all()
    assert (values[found] > 0).all()


@given(hnp.arrays(np.float64, st.integers(1, 300), elements=st.integers(0, 1000).map(float)), st.data())
def test_find_agrees_with_a_linear_scan(values, data):
    values[data.draw(st.integers(0, len(values) - 1))] += 1.0
    tree = SumTree(300)
    tree.rebuild(values)
    prefixes = data.draw(st.lists(st.integers(0, int(values.sum()) - 1), min_size=1, max_size=20))
    fractions = (np.array(prefixes) + 0.5) / values.sum()
    ends = np.cumsum(values)
    assert tree.find(fractions).tolist() == [int(np.argmax(ends > prefix)) for prefix in prefixes]
