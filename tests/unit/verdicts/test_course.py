import math

import numpy as np
import pytest

from risk_sac.geometry import Size
from risk_sac.verdicts.course import Body, entry_distance, time_to_touch
from risk_sac.verdicts.path import polyline

CAR = Size(2.3, 0.9)
STRAIGHT = polyline(np.array([0.0, 100.0]), np.zeros(2))


def test_time_to_touch_a_standing_body() -> None:
    ahead = Body(44.6, 0.0, 0.0, 0.0, 0.0, CAR)  # 40 m between the bumpers
    assert time_to_touch(STRAIGHT, 0.0, 20.0, CAR, ahead, 4.0) == pytest.approx(2.0, abs=0.051)
    assert time_to_touch(STRAIGHT, 0.0, 9.0, CAR, ahead, 4.0) == math.inf  # 4.4 s
    beside = ahead._replace(y=1.81)
    assert time_to_touch(STRAIGHT, 0.0, 20.0, CAR, beside, 4.0) == math.inf


def test_a_bend_leads_away_from_what_is_straight_ahead() -> None:
    bend = polyline(np.array([0.0, 10.0, 10.0]), np.array([0.0, 0.0, 50.0]))
    straight_on, round_it = Body(40.0, 0.0, 0.0, 0.0, 0.0, CAR), Body(10.0, 30.0, 0.0, 0.0, 0.0, CAR)
    assert time_to_touch(bend, 0.0, 10.0, CAR, straight_on, 4.0) == math.inf
    assert time_to_touch(bend, 0.0, 10.0, CAR, round_it, 4.0) == pytest.approx(3.68, abs=0.051)


def test_entry_distance_to_the_corridor() -> None:
    # From the right, nose first: its front is 10 m from its centre's start less 2.3, the corridor's edge at -0.9.
    y = np.linspace(-20.0, 5.0, 2501)
    north = np.full(len(y), math.pi / 2)
    entry, meets = entry_distance(STRAIGHT, 0, 50.0, CAR, np.full(len(y), 30.0), y, north, CAR)
    assert entry == pytest.approx(20.0 - 2.3 - 0.9, abs=0.02)
    assert meets == pytest.approx(30.0, abs=2.3 + 2.3)
    entry, _ = entry_distance(STRAIGHT, 0, 20.0, CAR, np.full(len(y), 30.0), y, north, CAR)
    assert entry == math.inf
