"""Literals by hand; both surfaces are monotone in a gap's danger."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.verdicts.course import BodyOnPath
from risk_sac.verdicts.distinct import TaxonomyCell, taxonomy_cell
from risk_sac.verdicts.drivers import (
    FULL_MPS2,
    Situation,
    braking,
    critical,
    full_braking,
    fuzzy,
    proactive,
    r157,
    rss,
    towards_command,
)
from tests.builders import collision, judgement

DRY, WET = 9.81, 0.6 * 9.81


# The pedal is released at 0.4 for 0.75 s; then 12.65 m/s³ to 0.774 g = 7.593 in 0.569 s.
@pytest.mark.parametrize(
    ("since_s", "braking"),
    [(0.0, 0.4), (0.75, 0.4), (0.95, 0.4 + 2.53), (1.30, 7.3575), (1.32, 7.59294), (9.0, 7.59294)],
)
def test_careful_brakes_as_r157_says(since_s, braking):
    assert r157(since_s, DRY) == pytest.approx(braking)


def test_no_driver_brakes_harder_than_the_road_bears():
    assert r157(3.0, WET) == pytest.approx(5.886)
    assert full_braking(WET) == pytest.approx(5.886)
    assert full_braking(DRY) == 8.0
    assert towards_command(5.8, 6.0, WET, 0.1) == pytest.approx(5.886)


@given(st.floats(0, 10), st.floats(0.5, 12))
def test_the_bound_never_brakes_less_than_careful(since_s, grip):
    assert full_braking(grip) >= r157(since_s, grip)


def test_a_command_builds_up_at_its_jerk():
    assert towards_command(0.0, 6.0, DRY, 0.1) == pytest.approx(1.265)
    assert towards_command(5.9, 6.0, DRY, 0.1) == 6.0
    assert towards_command(6.0, 0.0, DRY, 0.1) == pytest.approx(4.735)
    assert towards_command(7.5, 9.0, DRY, 0.1) == pytest.approx(FULL_MPS2)


def situation(
    gap: float, across: float = 0.0, lateral: float = 0.0, speed: float = 20.0, other: float = 10.0
) -> Situation:
    return Situation(BodyOnPath(gap, -gap - 9.2, math.inf, across, 0.0, other, 0.9, 0.0), speed, 0.0, 0.9, 0.9, lateral)


# RSS: after = 20 + 0.75·3 = 22.25; (20 + 22.25)·0.375 + 22.25²/12 − 100/12 = 15.844 + 41.255 − 8.333 = 48.765 m.
@pytest.mark.parametrize(("gap", "braking"), [(48.7, 6.0), (48.8, 0.0)])
def test_rss_responds_below_its_longitudinal_distance(gap, braking):
    assert rss(situation(gap)) == braking


# Sideways, each: 0.75 · 0.75/2 + 0.75²/2 = 0.5625 m; two of them and μ = 0.3 make 1.425 m between the bodies.
@pytest.mark.parametrize(("across", "braking"), [(3.2, 6.0), (-3.2, 6.0), (3.23, 0.0), (-3.23, 0.0)])
def test_rss_responds_below_its_lateral_distance_only(across, braking):
    assert rss(situation(10.0, across)) == braking


@pytest.mark.parametrize("driver", [fuzzy, rss])
@pytest.mark.parametrize("side", [1, -1])
def test_who_is_out_of_the_way_is_no_reason_to_brake(driver, side):
    assert driver(situation(10.0, 5.0 * side, 0.5 * side)) == 0.0  # moves away
    assert driver(situation(-30.0)) == 0.0  # behind


@pytest.mark.parametrize("side", [1, -1])
def test_fuzzy_brakes_for_who_is_coming(side):
    assert fuzzy(situation(10.0, 5.0 * side, -0.5 * side)) == 6.0


speeds, gaps = st.floats(0, 40), st.floats(0, 150)


# 20 m/s behind 10 m/s: τ 20 = 15; 400/8 = 50; 400/12 = 33.33; 100/14 = 7.143; safe 57.857, unsafe 41.190, d1 = 2.
@pytest.mark.parametrize(("gap", "pfs"), [(59.9, 0.0), (59.857 - 8.333, 0.5), (43.0, 1.0), (0.0, 1.0)])
def test_proactive(gap, pfs):
    assert proactive(gap, 20.0, 10.0) == pytest.approx(pfs, abs=1e-3)


# 20 behind 10, no acceleration: d_new = 7.5; safe 7.5 + 100/8 = 20; unsafe 7.5 + 100/12 = 15.833.
@pytest.mark.parametrize(("gap", "cfs"), [(20.0, 0.0), (17.917, 0.5), (15.8, 1.0)])
def test_critical(gap, cfs):
    assert critical(gap, 20.0, 0.0, 10.0) == pytest.approx(cfs, abs=1e-3)


def test_braking_is_comfortable_until_the_gap_is_critical():
    assert braking(51.524, 20.0, 0.0, 10.0) == pytest.approx(2.0, abs=1e-3)
    assert braking(17.917, 20.0, 0.0, 10.0) == pytest.approx(5.0, abs=1e-3)
    assert braking(1.0, 20.0, 0.0, 10.0) == 6.0
    assert braking(100.0, 20.0, 0.0, 20.0) == 0.0


@given(gaps, gaps, speeds, speeds, st.floats(-9, 3))
def test_a_longer_gap_is_never_more_dangerous(a, b, ego, leader, accel):
    near, far = min(a, b), max(a, b)
    assert 0.0 <= proactive(far, ego, leader) <= proactive(near, ego, leader) <= 1.0
    assert 0.0 <= critical(far, ego, accel, leader) <= critical(near, ego, accel, leader) <= 1.0


def cell(judged: dict[str, Any] | None = None, **changes: Any) -> TaxonomyCell:
    return taxonomy_cell(collision(judgement=judgement(**(judged or {})), **changes))


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"visible_for_s": 0.59}, "visible", 0),
        ({"visible_for_s": 0.6}, "visible", 1),
        ({"visible_for_s": 2.0}, "visible", 2),
        ({"ego_peak_braking_mps2": 2.9}, "ego_braked", False),
        ({"ego_peak_braking_mps2": 3.0}, "ego_braked", True),
        ({"relative_speed_mps": 4.9}, "closing_speed", 0),
        ({"relative_speed_mps": 5.0}, "closing_speed", 1),
        ({"relative_speed_mps": 10.0}, "closing_speed", 2),
        ({"ego_zone": "left"}, "ego_zone", "left"),
        ({"ego_zone": "left", "other_kind": "pedestrian"}, "ego_zone", ""),
        ({"other_role": "background"}, "striker", "background vehicle"),
    ],
)
def test_a_cell_of_the_taxonomy_is_told_by_its_edges(changes, field, value):
    assert getattr(cell(**changes), field) == value


def test_who_comes_closer_is_more_critical_than_who_stands():
    assert braking(25.0, 10.0, 0.0, -5.0) > braking(25.0, 10.0, 0.0, 0.0)
