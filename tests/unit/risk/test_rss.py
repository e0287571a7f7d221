"""Literals by hand from Shalev-Shwartz et al. 2017, Definitions 1, 2, 6."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.risk import rss
from risk_sac.risk.rss import (
    LATERAL_CAP_M,
    LATERAL_SCALE_M,
    LONGITUDINAL_CAP_M,
    SCALED_HIGH,
    SCALED_LOW,
    RssParameters,
    lateral,
    opposite_direction,
    same_direction,
)
from risk_sac.world.geometry import RelativeView, relative_view
from tests.builders import frame_of

# ρ = 1 s, a = 2, b_min = 4, b_max = 8, lateral a = 0.5 and b = 1, μ = 0.1: round enough for mental arithmetic.
P = RssParameters(
    response_s=1.0,
    accel_mps2=2.0,
    brake_min_mps2=4.0,
    brake_max_mps2=8.0,
    lateral_accel_mps2=0.5,
    lateral_brake_mps2=1.0,
    fluctuation_m=0.1,
)


def margins(view: RelativeView, p: RssParameters, *, walks: bool = False) -> tuple[np.ndarray, np.ndarray]:
    found = rss.margins(view, np.full(len(view.x), walks), p)
    return found.longitudinal_m, found.lateral_m


def scaled(view: RelativeView, p: RssParameters = P, *, walks: bool = False) -> list[float]:
    result: list[float] = rss.margins(view, np.full(len(view.x), walks), p).scaled.tolist()
    return result


@pytest.mark.parametrize(
    ("rear_mps", "front_mps", "distance_m"),
    [
        (10.0, 8.0, 25.0),  # 10 + 1 + 12²/8 - 8²/16 = 11 + 18 - 4
        (10.0, 0.0, 29.0),  # the vehicle ahead stands
        (0.0, 0.0, 1.5),  # 0 + 1 + 2²/8: even from rest, the response time is driven
        (10.0, 24.0, 0.0),  # 29 - 36 < 0
        (20.0, 20.0, 56.5),  # 20 + 1 + 22²/8 - 20²/16 = 21 + 60.5 - 25
    ],
)
def test_longitudinal_distance_in_the_same_direction(rear_mps, front_mps, distance_m):
    assert same_direction(rear_mps, front_mps, P) == pytest.approx(distance_m)


@pytest.mark.parametrize(
    ("ego_mps", "other_mps", "distance_m"),
    [
        (10.0, 8.0, 50.5),  # (10 + 12)/2 + 12²/8 + (8 + 10)/2 + 10²/8 = 11 + 18 + 9 + 12.5
        (0.0, 0.0, 3.0),  # twice 1 + 0.5
        (10.0, 0.0, 30.5),  # 29 + 1.5
    ],
)
def test_longitudinal_distance_in_opposite_directions(ego_mps, other_mps, distance_m):
    assert opposite_direction(ego_mps, other_mps, P) == pytest.approx(distance_m)


@pytest.mark.parametrize(
    ("ego_mps", "other_mps", "distance_m"),
    [
        (0.0, 0.0, 0.85),  # 0.1 + 2 · (0.25 + 0.5²/2)
        (1.0, 0.0, 2.85),  # 0.1 + (1.25 + 1.5²/2) + 0.375
        (0.0, 1.0, 2.85),
        (1.0, 1.0, 4.85),  # 0.1 + 2 · 2.375
        (-0.5, -0.5, 0.1),  # both drift apart: (-0.5 + 0)/2 + 0 each, so only the fluctuation is left
    ],
)
def test_lateral_distance(ego_mps, other_mps, distance_m):
    assert lateral(ego_mps, other_mps, P) == pytest.approx(distance_m)


def lateral_approach(ego_mps: float, other_mps: float, p: RssParameters) -> float:
    """Def. 6 by simulation, m: acceleration towards each other, then lateral braking."""
    dt, approach = 1e-4, 0.0
    for speed_mps in (ego_mps, other_mps):
        for _ in range(round(p.response_s / dt)):
            approach += (speed_mps + p.lateral_accel_mps2 * dt / 2) * dt
            speed_mps += p.lateral_accel_mps2 * dt
        while speed_mps != 0.0:
            less = min(abs(speed_mps), p.lateral_brake_mps2 * dt)
            slower = speed_mps - math.copysign(less, speed_mps)
            approach += (speed_mps + slower) / 2 * dt
            speed_mps = slower
    return approach


@pytest.mark.parametrize(
    ("ego", "other"), [(0.5, 0.5), (1.0, -0.2), (1.5, -1.2), (-1.5, 1.9), (0.0, 0.0), (-2.0, -1.0)]
)
def test_the_lateral_distance_is_what_def_6_says_in_words_for_who_moves_away_too(ego, other):
    expected = P.fluctuation_m + max(lateral_approach(ego, other, P), 0.0)
    assert lateral(ego, other, P) == pytest.approx(expected, abs=1e-3)


def view_of(ego_mps: float, *others: tuple[float, float, float, float, float]) -> RelativeView:
    """Ego at the origin along x; others: x, y, heading, vx, vy."""
    columns = np.array([(0.0, 0.0, 0.0, ego_mps, 0.0), *others]).T
    x, y, heading, vx, vy = columns
    frame = frame_of(x_m=x, y_m=y, heading_rad=heading, vx_mps=vx, vy_mps=vy, length_m=4.0, width_m=2.0)
    return relative_view(frame)


def test_margin_to_a_leader_is_the_gap_minus_the_distance():
    longitudinal, _ = margins(view_of(10.0, (34.0, 0, 0, 8, 0)), P)
    assert longitudinal.tolist() == pytest.approx([5.0])  # 30 m gap, 25 m wanted


def test_margin_to_an_oncoming_vehicle_uses_the_opposite_direction_distance():
    longitudinal, _ = margins(view_of(10.0, (44.0, 0, math.pi, -8, 0)), P)
    assert longitudinal.tolist() == pytest.approx([-10.5])  # 40 m gap, 50.5 m wanted


def test_margin_to_a_follower_takes_the_follower_as_the_rear_vehicle():
    longitudinal, _ = margins(view_of(8.0, (-34.0, 0, 0, 10, 0)), P)
    assert longitudinal.tolist() == pytest.approx([5.0])


@pytest.mark.parametrize("side", [1, -1])
def test_lateral_margin_is_the_same_on_both_sides(side):
    _, parallel = margins(view_of(10.0, (0, side * 5.0, 0, 10, 0)), P)
    _, closing = margins(view_of(10.0, (0, side * 5.0, 0, 10, -side * 1.0)), P)
    _, leaving = margins(view_of(10.0, (0, side * 5.0, 0, 10, side * 1.0)), P)
    assert parallel.tolist() == pytest.approx([3.0 - 0.85])
    assert closing.tolist() == pytest.approx([3.0 - 2.85])
    # 0.1 + [0.375 + (-0.75 - 0.5²/2)]_+ = 0.1
    assert leaving.tolist() == pytest.approx([2.9])


def test_the_scaled_margin_is_the_larger_of_both_each_in_its_scale():
    leader, beside = (34.0, 0, 0, 8, 0), (1.0, 3.0, 0, 10, 0)
    assert scaled(view_of(10.0, leader)) == pytest.approx(
        [5 / 25]
    )  # 25 m are wanted, more than what is driven in 0.85 s
    assert scaled(view_of(10.0, beside)) == pytest.approx([(1 - 0.85) / LATERAL_SCALE_M])


@settings(deadline=None)  # the first call compiles
@given(
    st.floats(0, 30),
    st.tuples(*(st.floats(-80, 80), st.floats(-40, 40), st.floats(-4, 4), st.floats(-30, 30), st.floats(-30, 30))),
    st.booleans(),
)
def test_the_scaled_margin_is_negative_exactly_where_both_margins_are(ego_mps, other, walks):
    view = view_of(ego_mps, other)
    [along], [across] = margins(view, P, walks=walks)
    [margin] = scaled(view, walks=walks)
    assert (margin < 0) == (along < 0 and across < 0)
    assert SCALED_LOW <= margin <= SCALED_HIGH
    assert abs(along) <= LONGITUDINAL_CAP_M
    assert abs(across) <= LATERAL_CAP_M


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("ego_mps", "other"),
    [
        pytest.param(0.0, (10.0, 0.0, math.pi / 2, 0, 10), id="cross traffic passes an ego at its stop line"),
        pytest.param(0.0, (10.0, -20.0, math.pi / 2, 0, 10), id="cross traffic comes past an ego at its stop line"),
        pytest.param(12.0, (20.0, -14.0, math.pi / 2, 0, 0), id="cross traffic waits at its red light"),
        pytest.param(12.0, (20.0, -28.0, math.pi / 2, 0, 8), id="cross traffic brakes for its red light"),
        pytest.param(14.0, (30.0, 3.3, math.pi, -14, 0), id="oncoming in the opposite lane"),
        pytest.param(4.0, (20.0, -2.0, math.pi - 0.35, -9.4, 3.4), id="oncoming past an ego that begins to turn"),
        pytest.param(13.0, (19.0, 0.0, 0.0, 13, 0), id="a leader at SUMO's headway of 1 s"),
        pytest.param(14.0, (0.0, 3.2, 0.0, 14, 0), id="beside it in the next lane"),
    ],
)
def test_undisturbed_traffic_is_not_dangerous(ego_mps, other, side):
    x, y, heading, vx, vy = other
    assert scaled(view_of(ego_mps, (x, side * y, side * heading, vx, side * vy)), RssParameters())[0] > 0


@pytest.mark.parametrize("braking_mps2", [6.0, 8.0, 9.0])
def test_an_ego_that_brakes_too_late_wins_no_margin_back(braking_mps2):
    """In metres it would: hard braking shortens the distance more than room."""
    contact_mps = 4.0
    falling = []
    for speed_mps in np.arange(12.0, contact_mps, -0.25):
        gap_m = (speed_mps**2 - contact_mps**2) / (2 * braking_mps2)
        falling.append(scaled(view_of(speed_mps, (4.0 + gap_m, 0.2, 0, 0, 0)), RssParameters())[0])
    assert np.all(np.diff(falling) < 0)
    assert falling[-1] > -1.0
