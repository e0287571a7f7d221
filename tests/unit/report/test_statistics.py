import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.report.statistics import holm, smallest_p, vargha_delaney, wilcoxon_p

differences = st.lists(st.integers(-6, 6).map(lambda tenths: tenths / 10), max_size=10)


@pytest.mark.parametrize(
    ("values", "p"),
    [
        ([0.1, 0.2, 0.3, 0.4, 0.5], 2 / 2**5),  # all on one side: one pattern of 32 in either tail
        ([-0.1, 0.2, 0.3, 0.4, 0.5], 4 / 2**5),  # rank sums 0 and 1: two patterns
        ([-0.1, -0.2, 0.3, 0.4, 0.5], 2 * 5 / 2**5),  # rank sums 0, 1, 2, 3 (twice)
        ([0.1, -0.1], 1.0),
        ([0.2, 0.2, 0.2], 2 / 2**3),  # ties
        ([0.5, 0.0, 0.25, 0.0], 2 / 2**2),  # zeros are left out
        ([0.0, 0.0], 1.0),
        ([], 1.0),
    ],
)
def test_wilcoxon_literals(values, p):
    assert wilcoxon_p(values) == pytest.approx(p)


def test_wilcoxon_takes_rounding_for_ties():
    assert wilcoxon_p([0.3 - 0.1, 0.2, -0.2]) == wilcoxon_p([0.2, 0.2, -0.2]) == 1.0
    assert wilcoxon_p([0.1 + 0.2 - 0.3, 1.0, 2.0]) == wilcoxon_p([1.0, 2.0])


@given(differences)
def test_wilcoxon_is_the_share_of_sign_patterns_at_least_as_extreme(values):
    left = [value for value in values if value]
    ranks = scipy.stats.rankdata(np.abs(left))
    centre = ranks.sum() / 2
    seen = abs(ranks[np.array(left) > 0].sum() - centre) if left else 0
    patterns = (np.arange(2 ** len(left))[:, None] >> np.arange(len(left))) & 1
    extreme = np.abs(patterns @ ranks - centre) >= seen - 1e-9
    assert wilcoxon_p(values) == pytest.approx(extreme.mean())


@given(differences)
def test_wilcoxon_does_not_care_who_is_first(values):
    assert wilcoxon_p(values) == wilcoxon_p([-value for value in values])
    assert smallest_p(len(values)) <= wilcoxon_p(values) <= 1


def test_holm_by_hand():
    # Sorted 0.005, 0.01, 0.03, 0.04, times 4, 3, 2, 1 = 0.02, 0.03, 0.06, 0.04; never below the one before.
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_a12_by_hand():
    assert vargha_delaney([3, 4], [1, 2]) == 1
    assert vargha_delaney([1, 2], [3, 4]) == 0
    assert vargha_delaney([1, 2], [1, 2]) == 0.5
    assert vargha_delaney([1, 3, 5], [2, 3]) == pytest.approx((0 + 1.5 + 2) / 6)


@given(st.lists(st.floats(0, 1), max_size=8))
def test_holm_only_raises_and_keeps_the_order(values):
    adjusted = holm(values)
    assert all(p <= p_holm <= 1 for p, p_holm in zip(values, adjusted, strict=True))
    assert [p for _, p in sorted(zip(values, adjusted, strict=True))] == sorted(adjusted)
