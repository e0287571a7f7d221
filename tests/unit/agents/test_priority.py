import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from risk_sac.agents.priority import TERM_CAP, TermScales, importance_weights, priority
from risk_sac.config import ReplayConfig

CONFIG = ReplayConfig(td_weight=1.0, return_weight=0.5, robustness_weight=0.5, priority_floor=0.05, correction=0.6)
terms = hnp.arrays(np.float64, st.tuples(st.just(3), st.integers(1, 30)), elements=st.floats(-1e3, 1e3))


def test_priority_of_a_hand_computed_case() -> None:
    #              |δ|: min 0, mean 2      R̂: min -1, mean 1     -ρ: constant
    stored = np.array([[0.0, 1.0, 5.0], [-1.0, 0.0, 4.0], [0.3, 0.3, 0.3]])
    # On the common scale: 0, 1/2, 5/2 and 0, 1/2, 5/2 and nothing.
    assert priority(stored, TermScales.of(stored), CONFIG) == pytest.approx([0.05, 0.75, 3.75])


@given(terms)
def test_priority_is_floored_and_bounded(stored: np.ndarray) -> None:
    values = priority(stored, TermScales.of(stored), CONFIG)
    assert (values >= CONFIG.priority_floor).all()
    assert (values <= 2.0 * TERM_CAP).all()


@given(terms, st.floats(0.1, 10.0), st.floats(-100.0, 100.0))
def test_priority_ignores_the_unit_and_the_zero_of_a_term(stored: np.ndarray, factor: float, offset: float) -> None:
    spread = stored.mean(axis=1) - stored.min(axis=1)
    stored[spread < 1e-3] = 0.0  # either side of the threshold below which a term counts as constant
    moved = stored * factor + offset
    before = priority(stored, TermScales.of(stored), CONFIG)
    assert priority(moved, TermScales.of(moved), CONFIG) == pytest.approx(before, rel=1e-6, abs=1e-6)


def test_one_outlier_counts_for_at_most_ten_average_terms() -> None:
    stored = np.zeros((3, 1000))
    stored[0] = 1.0
    stored[0, :2] = 0.0, 1e6
    assert priority(stored, TermScales.of(stored), CONFIG).max() == TERM_CAP


def test_importance_weights_of_a_hand_computed_case() -> None:
    # N P = 4, 1, 1/4; ^-0.5 = 1/2, 1, 2; over the largest.
    weights = importance_weights(np.array([1.0, 0.25, 0.0625]), size=4, correction=0.5)
    assert weights == pytest.approx([0.25, 0.5, 1.0])
