import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.limits import Limits, limits_from_odd
from risk_sac.sim.paths import Path, path_through
from risk_sac.sim.vehicle_control import BODY_M, CAP, GRID_M, HERE, SOON, bends
from tests.roads import arc_m, road

LIMITS = limits_from_odd(FAMILIES["dense"].odd, friction=0.8)
radii = st.floats(6, 60)


def corner(turn_rad: float) -> Path:
    """10 m straight, a corner, 10 m straight."""
    return with_headings(0.0, turn_rad, turn_rad)


def with_headings(*heading_rad: float) -> Path:
    """Two pieces of 10 m; points and speeds do not matter."""
    return path_through(np.zeros(3), np.zeros(3), np.array([0.0, 10.0, 20.0]), np.array(heading_rad), np.full(3, 13.89))


def test_a_corner_turns_the_body_over_its_own_length_by_hand() -> None:
    got = bends(corner(0.46), LIMITS)
    assert got[HERE] == pytest.approx([0.0] * 20 + [0.1] * 10 + [0.0] * 11)  # 10 to 14.5 m: 0.46 rad / 4.6 m
    assert got[SOON] == pytest.approx([0.0] * 10 + [0.1] * 20 + [0.0] * 11)  # from 5 m before


def test_a_bend_is_approached_by_hand() -> None:
    limits = Limits(
        speed_mps=20, accel_mps2=3, brake_mps2=8, grip_mps2=5, lateral_accel_mps2=1,
        walk_speed_mps=2, walk_accel_mps2=1.5, walk_brake_mps2=1.5,
    )  # fmt: skip
    assert limits.cornering_mps2 == pytest.approx(3.0)
    assert limits.approach_mps2 == pytest.approx(3.0)  # 3² + (3 + 1)² = 5²
    cap = bends(corner(0.46), limits)[CAP]
    assert cap[10] == cap[29] == pytest.approx(math.sqrt(3.0 / 0.1))
    assert cap[0] == pytest.approx(math.sqrt(30.0 + 2 * 3.0 * 5.0))  # 5 m before
    assert cap[30] > 1000


@settings(max_examples=30)
@given(radii, st.floats(0.3, math.pi), st.floats(0.2, 4))
def test_an_arc_has_its_own_curvature_and_the_speed_for_it(radius: float, turn: float, piece: float) -> None:
    got = bends(road(radius, turn_rad=turn, piece_m=piece), LIMITS)
    start, end = (round(s / GRID_M) for s in arc_m(radius, turn))
    body = math.ceil((BODY_M + piece) / GRID_M)
    inside = slice(start + body, end - math.ceil(piece / GRID_M))
    mean = np.array(got[HERE][inside])
    if len(mean) > 4 * body:  # on average, for the corners of a coarse arc come one by one
        assert mean.mean() == pytest.approx(1 / radius, rel=0.25)
    assert np.all(np.array(got[CAP]) ** 2 * np.array(got[HERE]) <= LIMITS.cornering_mps2 + 1e-9)


@settings(max_examples=30)
@given(radii, st.floats(0.3, math.pi))
def test_every_cap_can_be_braked_to(radius: float, turn: float) -> None:
    square = bends(road(radius, turn_rad=turn), LIMITS)[CAP] ** 2
    assert np.all(square[:-1] - square[1:] <= 2 * LIMITS.approach_mps2 * GRID_M + 1e-6)


def test_a_heading_that_passes_pi_is_no_bend() -> None:
    got = bends(with_headings(math.pi - 0.01, -math.pi + 0.01, -math.pi + 0.01), LIMITS)
    assert max(got[HERE]) == pytest.approx(0.02 / BODY_M)
