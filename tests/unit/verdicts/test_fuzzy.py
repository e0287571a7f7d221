"""Literals by hand from the formulas; both surfaces are monotone in what makes a gap more dangerous."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.verdicts.fuzzy import braking, critical, proactive

speeds, gaps = st.floats(0, 40), st.floats(0, 150)


# 20 m/s behind 10 m/s: τ 20 = 15; 400/8 = 50; 400/12 = 33.33; 100/14 = 7.143; safe 57.857, unsafe 41.190, d1 = 2.
@pytest.mark.parametrize(("gap", "pfs"), [(59.9, 0.0), (59.857 - 8.333, 0.5), (43.0, 1.0), (0.0, 1.0)])
def test_proactive(gap: float, pfs: float) -> None:
    assert proactive(gap, 20.0, 10.0) == pytest.approx(pfs, abs=1e-3)


# 20 behind 10, no acceleration: d_new = 7.5; safe 7.5 + 100/8 = 20; unsafe 7.5 + 100/12 = 15.833.
@pytest.mark.parametrize(("gap", "cfs"), [(20.0, 0.0), (17.917, 0.5), (15.8, 1.0)])
def test_critical(gap: float, cfs: float) -> None:
    assert critical(gap, 20.0, 0.0, 10.0) == pytest.approx(cfs, abs=1e-3)


# Braking with 3 it is 17.75 after τ: d_new = (18.875 - 10) 0.75 = 6.656; 7.75² = 60.0625: safe 14.164, unsafe 11.661.
@pytest.mark.parametrize(("gap", "cfs"), [(14.2, 0.0), (12.913, 0.5), (11.6, 1.0)])
def test_critical_of_who_brakes_already(gap: float, cfs: float) -> None:
    assert critical(gap, 20.0, -3.0, 10.0) == pytest.approx(cfs, abs=1e-3)


@pytest.mark.parametrize(("gap", "cfs"), [(0.51, 0.0), (0.49, 1.0)])
def test_critical_of_who_is_slower_within_the_reaction(gap: float, cfs: float) -> None:
    assert critical(gap, 12.0, -9.0, 10.0) == cfs  # a' = -4: 4 / 8 = 0.5 m


def test_braking_is_comfortable_until_the_gap_is_critical() -> None:
    assert braking(51.524, 20.0, 0.0, 10.0) == pytest.approx(2.0, abs=1e-3)
    assert braking(17.917, 20.0, 0.0, 10.0) == pytest.approx(5.0, abs=1e-3)
    assert braking(1.0, 20.0, 0.0, 10.0) == 6.0
    assert braking(100.0, 20.0, 0.0, 20.0) == 0.0


@given(gaps, gaps, speeds, speeds, st.floats(-9, 3))
def test_a_longer_gap_is_never_more_dangerous(a: float, b: float, ego: float, leader: float, accel: float) -> None:
    near, far = min(a, b), max(a, b)
    assert 0.0 <= proactive(far, ego, leader) <= proactive(near, ego, leader) <= 1.0
    assert 0.0 <= critical(far, ego, accel, leader) <= critical(near, ego, accel, leader) <= 1.0


def test_who_comes_closer_is_more_critical_than_who_stands() -> None:
    assert braking(25.0, 10.0, 0.0, -5.0) > braking(25.0, 10.0, 0.0, 0.0)
