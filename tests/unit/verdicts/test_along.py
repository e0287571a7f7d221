import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.geometry import Size
from risk_sac.verdicts.along import Along, along, lane_conflict, towards
from risk_sac.verdicts.course import Body
from risk_sac.verdicts.path import polyline

LANE_M = 3.3
CAR = Size(2.3, 0.9)


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("across", "offset", "expected"),
    [
        (3.3, 0.0, 0.0),  # in the middle of the lane beside
        (2.8, -0.5, 0.5),
        (3.8, 0.5, -0.5),
        (1.7, -1.6, 1.6),  # at its edge
        (1.6, 1.6, 1.7),  # and just over it: SUMO has it on the ego's lane now
        (1.8, 1.6, 1.7),  # the ego itself drives 0.2 m to the right
        (0.0, 0.0, 3.3),
        (6.6, 0.0, -3.3),  # two lanes away
    ],
)
def test_offset_towards_the_ego_from_the_lane_beside(side: int, across: float, offset: float, expected: float) -> None:
    assert towards(side * across, side * offset, LANE_M) == pytest.approx(expected)


@given(st.floats(-9.0, 9.0))
def test_a_wrapped_offset_says_what_the_place_says(across: float) -> None:
    offset = (across + LANE_M / 2) % LANE_M - LANE_M / 2
    assert towards(across, offset, LANE_M) == pytest.approx(towards(across, math.nan, LANE_M))


def seen(gap: float, ttc: float = math.inf, across: float = 0.0, aside: float = math.inf) -> Along[float]:
    return Along(gap, -gap - 9.2, ttc, across, 0.0, 10.0, aside)


@pytest.mark.parametrize(
    ("other", "accel", "offset", "expected"),
    [
        (seen(10.0, 1.9), 0.0, 0.0, (True, True)),
        (seen(10.0, 2.1), 0.0, 0.0, (False, True)),  # goes on, but does not begin
        (seen(10.0, 4.1), 0.0, 0.0, (False, False)),
        (seen(39.0), -5.1, 0.0, (True, True)),
        (seen(39.0), -4.9, 0.0, (False, False)),
        (seen(41.0), -8.0, 0.0, (False, False)),  # 4 s at 10 m/s
        (seen(10.0, 1.0, 3.3), 0.0, 0.0, (False, False)),  # keeps to its lane
        (seen(10.0, 1.0, 2.9), 0.0, -0.4, (True, True)),
        (seen(10.0, 1.0, 2.95), 0.0, -0.35, (False, False)),
        (seen(-1.0, math.inf, 2.9, 3.9), 0.0, -0.4, (True, True)),  # alongside, and comes nearer
        (seen(-1.0, math.inf, 2.9, 4.1), 0.0, -0.4, (False, False)),  # slowly
        (seen(-9.3, math.inf, 2.9), 0.0, -0.4, (False, False)),  # behind
        (seen(10.0, 1.0, 3.7), 0.0, 0.4, (False, False)),  # moves away
    ],
)
def test_when_a_conflict_begins_and_when_it_goes_on(
    other: Along, accel: float, offset: float, expected: tuple[bool, bool]
) -> None:
    assert lane_conflict(other, 10.0, offset, accel, LANE_M, wary=False) == expected


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("towards_mps", "expected"), [(0.6, 2.0), (0.3, 4.0), (0.0, math.inf), (-0.6, math.inf)])
def test_the_sides_touch_when_the_room_between_them_is_gone(side: int, towards_mps: float, expected: float) -> None:
    path = polyline(np.array([0.0, 100.0]), np.array([0.0, 0.0]), 0.0)
    other = Body(21.0, side * 3.0, 0.0, 10.0, -side * towards_mps, CAR)  # 1.2 m between two cars 1.8 m wide
    assert along(path, 0, 20.0, 10.0, CAR, other).aside_s == pytest.approx(expected)
