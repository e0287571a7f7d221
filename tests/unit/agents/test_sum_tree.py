import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from risk_sac.agents.sum_tree import SumTree


def test_find_walks_the_cumulative_sum() -> None:
    tree = SumTree(4)
    tree.rebuild(np.array([1.0, 0.0, 2.0, 1.0]))  # ends at 1, 1, 3, 4
    assert tree.total == 4.0
    assert tree.find(np.array([0.0, 0.2, 0.25, 0.7, 0.75, 0.999])).tolist() == [0, 0, 2, 2, 3, 3]


@given(hnp.arrays(np.float64, st.integers(1, 200), elements=st.integers(0, 2**20).map(float)), st.data())
def test_total_is_exactly_the_sum_after_any_writes(values: np.ndarray, data: st.DataObject) -> None:
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
def test_find_never_returns_a_leaf_of_priority_zero(values: np.ndarray, fractions: list[float]) -> None:
    tree = SumTree(128)
    tree.rebuild(values)
    found = tree.find(np.array(fractions))
    assert (found < len(values)).all()
    assert (values[found] > 0).all()


@given(hnp.arrays(np.float64, st.integers(1, 300), elements=st.integers(0, 1000).map(float)), st.data())
def test_find_agrees_with_a_linear_scan(values: np.ndarray, data: st.DataObject) -> None:
    values[data.draw(st.integers(0, len(values) - 1))] += 1.0
    tree = SumTree(300)
    tree.rebuild(values)
    prefixes = data.draw(st.lists(st.integers(0, int(values.sum()) - 1), min_size=1, max_size=20))
    fractions = (np.array(prefixes) + 0.5) / values.sum()
    ends = np.cumsum(values)
    assert tree.find(fractions).tolist() == [int(np.argmax(ends > prefix)) for prefix in prefixes]
