import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.verdicts.along import Along
from risk_sac.verdicts.drivers import FULL_MPS2, Situation, full_braking, fuzzy, r157, rss, towards_command

DRY, WET = 9.81, 0.6 * 9.81


# The pedal is released at 0.4 for 0.75 s; then 12.65 m/s³ to 0.774 g = 7.593 in 0.569 s.
@pytest.mark.parametrize(
    ("since_s", "braking"),
    [(0.0, 0.4), (0.75, 0.4), (0.95, 0.4 + 2.53), (1.30, 7.3575), (1.32, 7.59294), (9.0, 7.59294)],
)
def test_careful_brakes_as_r157_says(since_s: float, braking: float) -> None:
    assert r157(since_s, DRY) == pytest.approx(braking)


def test_no_driver_brakes_harder_than_the_road_bears() -> None:
    assert r157(3.0, WET) == pytest.approx(5.886)
    assert full_braking(WET) == pytest.approx(5.886)
    assert full_braking(DRY) == 8.0
    assert towards_command(5.8, 6.0, WET, 0.1) == pytest.approx(5.886)


@given(st.floats(0, 10), st.floats(0.5, 12))
def test_the_bound_never_brakes_less_than_careful(since_s: float, grip: float) -> None:
    assert full_braking(grip) >= r157(since_s, grip)


def test_a_command_builds_up_at_its_jerk() -> None:
    assert towards_command(0.0, 6.0, DRY, 0.1) == pytest.approx(1.265)
    assert towards_command(5.9, 6.0, DRY, 0.1) == 6.0
    assert towards_command(6.0, 0.0, DRY, 0.1) == pytest.approx(4.735)
    assert towards_command(7.5, 9.0, DRY, 0.1) == pytest.approx(FULL_MPS2)


def situation(
    gap: float, across: float = 0.0, lateral: float = 0.0, speed: float = 20.0, other: float = 10.0
) -> Situation:
    return Situation(Along(gap, -gap - 9.2, math.inf, across, 0.0, other, math.inf), speed, 0.0, 0.9, 0.9, lateral)


# RSS: after = 20 + 0.75·3 = 22.25; (20 + 22.25)·0.375 + 22.25²/12 − 100/12 = 15.844 + 41.255 − 8.333 = 48.765 m.
@pytest.mark.parametrize(("gap", "braking"), [(48.7, 6.0), (48.8, 0.0)])
def test_rss_responds_below_its_longitudinal_distance(gap: float, braking: float) -> None:
    assert rss(situation(gap)) == braking


# Sideways, each: 0.75 · 0.75/2 + 0.75²/2 = 0.5625 m; two of them and μ = 0.3 make 1.425 m between the bodies.
@pytest.mark.parametrize(("across", "braking"), [(3.2, 6.0), (-3.2, 6.0), (3.23, 0.0), (-3.23, 0.0)])
def test_rss_responds_below_its_lateral_distance_only(across: float, braking: float) -> None:
    assert rss(situation(10.0, across)) == braking


@pytest.mark.parametrize("driver", [fuzzy, rss])
@pytest.mark.parametrize("side", [1, -1])
def test_who_is_out_of_the_way_is_no_reason_to_brake(driver: object, side: int) -> None:
    assert driver(situation(10.0, 5.0 * side, 0.5 * side)) == 0.0  # type: ignore[operator]  # moves away
    assert driver(situation(-30.0)) == 0.0  # type: ignore[operator]  # behind


@pytest.mark.parametrize("side", [1, -1])
def test_fuzzy_brakes_for_who_is_coming(side: int) -> None:
    assert fuzzy(situation(10.0, 5.0 * side, -0.5 * side)) == 6.0
