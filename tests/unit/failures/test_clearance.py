from collections.abc import Callable

import numpy as np
import pytest

from risk_sac.failures.play import least_clearance_m
from risk_sac.failures.recording import Series

LENGTH_M, WIDTH_M, STEPS = 4.6, 1.85, 41
Motion = Callable[[np.ndarray], np.ndarray]


def scene(ego_mps: float, x_m: Motion, y_m: Motion, *, ego_stands_from_s: float = np.inf) -> Series:
    """Series of an ego along the x axis and one other car.

    Time counts from the release, x and y from the ego's start.
    """
    time = np.arange(STEPS) / 10
    speed = np.where(time < ego_stands_from_s, ego_mps, 0.0)
    ego_x = np.concatenate([[0.0], np.cumsum(speed[1:] / 10)])
    return {
        "time_s": 3.0 + time,
        "released_s": np.array(3.0),
        "ids": np.array(["ego", "other"]),
        "length_m": np.full(2, LENGTH_M),
        "width_m": np.full(2, WIDTH_M),
        "x_m": np.column_stack((ego_x, x_m(time))),
        "y_m": np.column_stack((0.0 * time, y_m(time))),
        "heading_rad": np.zeros((STEPS, 2)),
        "speed_mps": np.column_stack((speed, 0.0 * time)),
    }


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_neighbour_that_hangs_over_is_as_near_as_the_bodies(side: float):
    beside = scene(10.0, lambda t: 10.0 * t + 1.0, lambda t: side * (3.3 - np.minimum(t, 1.0)))
    assert least_clearance_m(beside) == pytest.approx(2.3 - WIDTH_M)


def test_a_car_ahead_counts_by_its_rear():
    assert least_clearance_m(scene(10.0, lambda t: 10.0 * t + 5.0, np.zeros_like)) == pytest.approx(5.0 - LENGTH_M)


@pytest.mark.parametrize("y_m", [0.0, 0.9])
def test_what_drives_up_from_behind_does_not_count(y_m: float):
    behind = scene(10.0, lambda t: 10.0 * t - 8.0 + t, lambda t: np.full_like(t, y_m))
    assert least_clearance_m(behind) == np.inf


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_car_that_overtakes_counts_once_it_is_beside(side: float):
    overtakes = scene(10.0, lambda t: 14.0 * t - 8.0, lambda t: np.full_like(t, side * (WIDTH_M + 0.3)))
    assert least_clearance_m(overtakes) == pytest.approx(0.3)


def test_a_body_that_reaches_a_standing_ego_counts_only_within_its_first_second():
    def comes(at_s: float) -> Series:
        return scene(
            10.0,
            lambda t: np.full_like(t, 12.0),
            lambda t: 4.0 - 2.0 * np.clip(t - at_s, 0, 1.2),
            ego_stands_from_s=1.0,
        )

    assert least_clearance_m(comes(0.9)) == 0.0
    assert least_clearance_m(comes(2.9)) > 0.5


def test_a_car_that_crosses_between_two_frames_counts():
    crossing = scene(0.6, lambda t: np.full_like(t, 5.0), lambda t: 60.0 * (t - 2.05))
    assert least_clearance_m(crossing) < 0.5
    assert abs(crossing["y_m"][:, 1]).min() > WIDTH_M
