"""Lines that actors travel along."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.scenario.travel_line import line_of, polyline

ARC = np.linspace(0.0, math.pi / 2, 200)
BEND = line_of(np.column_stack((50.0 * np.sin(ARC), 50.0 * (1.0 - np.cos(ARC)))), ARC)


@given(st.floats(-20.0, 100.0), st.floats(-20.0, 20.0))
def test_a_point_beside_a_line_is_projected_to_where_it_was_taken_from(station_m: float, left_m: float) -> None:
    x_m, y_m, _ = BEND.pose(station_m, left_m)
    assert BEND.project(x_m, y_m) == pytest.approx((station_m, left_m), abs=0.25)


@given(st.floats(0.0, 78.0))
def test_a_bend_is_where_and_as_steep_as_its_circle(station_m: float) -> None:
    turned = station_m / 50.0
    expected = (50.0 * math.sin(turned), 50.0 * (1.0 - math.cos(turned)), turned)
    assert BEND.pose(station_m) == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_corner_has_the_heading_of_the_piece(side: float) -> None:
    line = polyline(np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0 * side]]), [None] * 3)
    assert line.length_m == 20.0
    assert line.pose(9.999)[2] == 0.0
    assert line.pose(10.001) == pytest.approx((10.0, 0.001 * side, side * math.pi / 2))
    assert line.pose(25.0)[:2] == pytest.approx((10.0, 15.0 * side))
    assert line.project(11.0, 5.0 * side) == pytest.approx((15.0, -side))


def test_a_line_between_points_that_repeat_keeps_its_length() -> None:
    line = polyline(np.array([[0.0, 0.0], [0.0, 0.0], [10.0, 0.0]]), [None] * 3, np.array([0.0, 2.0, 4.0]))
    assert line.length_m == 10.0
    assert line.pose(5.0) == (5.0, 0.0, 0.0)
    assert (line.station_at(1.0), line.station_at(3.0)) == (0.0, pytest.approx(5.0))


def test_a_body_may_face_another_way_than_it_travels() -> None:
    line = polyline(np.array([[0.0, 0.0], [10.0, 0.0]]), [math.pi, math.pi])
    assert line.pose(5.0, 1.0) == pytest.approx((5.0, 1.0, math.pi))
    assert line.direction_rad(5.0) == 0.0


def test_a_part_of_a_line_begins_and_ends_where_it_was_cut() -> None:
    part = BEND.cut(10.0, 40.0)
    assert part.length_m == pytest.approx(30.0)
    assert part.pose(12.0) == pytest.approx(BEND.pose(22.0), abs=1e-6)
