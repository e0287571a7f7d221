"""Literals are worked out by hand; the reference minimises over time by brute force."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.geometry import RelativeView, relative_view
from risk_sac.risk.ttc import BEHIND_S_PER_M, DRIFT_MPS, SPEED_SHARE, WALK_MPS, time_to_encounter
from tests.builders import frame_of

Other = tuple[float, float, float, float, float]


def view_of(ego_mps: float, other: Other) -> RelativeView:
    """The ego at the origin, driving along x; the other is x, y, heading, vx, vy; both 4 m by 2 m."""
    x, y, heading, vx, vy = np.array([(0.0, 0.0, 0.0, ego_mps, 0.0), other]).T
    frame = frame_of(x_m=x, y_m=y, heading_rad=heading, vx_mps=vx, vy_mps=vy, length_m=4.0, width_m=2.0)
    return relative_view(frame)


def encounter(ego_mps: float, other: Other, *, walks: bool = False) -> float:
    [found] = time_to_encounter(view_of(ego_mps, other), np.array([walks]))
    return float(found)


def by_brute_force(view: RelativeView, walks: bool) -> float:
    """The formula, term by term, over a fine grid of times."""
    time = np.arange(0.0, 60.0, 1e-3)
    cos, sin = view.cos[0], view.sin[0]
    normals = np.array([(1, 0), (0, 1), (cos, sin), (-sin, cos)])
    ego = math.hypot(view.ego_vx, view.ego_vy)
    other = 0.0 if walks else math.hypot(view.vx[0] + view.ego_vx, view.vy[0] + view.ego_vy)
    speeds = SPEED_SHARE * (ego * abs(normals[:, 0]) + other * abs(normals @ (cos, sin)))
    closing = (WALK_MPS if walks else DRIFT_MPS) + speeds
    apart = (view.separation[:, 0] + time[:, None] * (normals @ (view.vx[0], view.vy[0]))).__abs__()
    left = np.maximum((apart - view.reach[:, 0]) / closing, 0.0).max(axis=1)
    return float((time + left).min() + BEHIND_S_PER_M * max(-view.ego_half_length - view.x[0], 0.0))


speed, place = st.floats(0, 20), st.floats(-25, 25)
others = st.tuples(place, place, st.floats(-4, 4), st.floats(-20, 20), st.floats(-20, 20))


@settings(deadline=None, max_examples=100)  # the first call compiles
@given(speed, others, st.booleans())
def test_it_is_the_formula_s_minimum_over_time(ego_mps: float, other: Other, walks: bool) -> None:
    view = view_of(ego_mps, other)
    assert encounter(ego_mps, other, walks=walks) == pytest.approx(by_brute_force(view, walks), abs=0.15)


def test_a_leader_as_fast_as_the_ego_is_met_at_a_share_of_both_speeds() -> None:
    assert encounter(10.0, (16.0, 0, 0, 10, 0)) == pytest.approx(12 / (0.3 + 0.2 * 20))


def test_a_car_beside_the_ego_is_met_by_drifting() -> None:
    assert encounter(10.0, (0.0, 3.2, 0, 10, 0)) == pytest.approx(1.2 / 0.3)


@pytest.mark.parametrize("side", [1, -1])
def test_a_cut_in_is_seen_as_soon_as_it_begins(side: int) -> None:
    drifting = encounter(10.0, (0.0, side * 3.2, 0, 10, -side * 1.0))
    assert drifting == pytest.approx(1.2)  # and so before the gap has shrunk at all


def test_who_comes_from_behind_fades_out() -> None:
    beside, behind, farther = (encounter(10.0, (x, 3.2, 0, 10, 0)) for x in (-2.0, -2.5, -4.0))
    assert beside == pytest.approx(4.0)
    assert behind == pytest.approx(4.0 + 0.5 * BEHIND_S_PER_M)
    assert farther > behind


@pytest.mark.parametrize("miss_m", np.arange(0.0, 6.0, 0.05).tolist())
def test_a_near_miss_is_continuous_where_ttc_jumps(miss_m: float) -> None:
    """A crossing car that passes ever farther behind the ego."""
    near, farther = (encounter(10.0, (20.0, -20.0 - m, math.pi / 2, 0, 10)) for m in (miss_m, miss_m + 0.05))
    assert abs(farther - near) < 0.05


@pytest.mark.parametrize("braking_mps2", [3.0, 6.0, 9.0])
def test_an_ego_that_brakes_too_late_wins_no_time_back(braking_mps2: float) -> None:
    contact_mps = 3.0
    falling = []
    for speed_mps in np.arange(14.0, contact_mps, -0.25):
        gap_m = (speed_mps**2 - contact_mps**2) / (2 * braking_mps2)
        falling.append(encounter(speed_mps, (4.0 + gap_m, 0.2, 0, 0, 0)))
    assert np.all(np.diff(falling) < 0)
