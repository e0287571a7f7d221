import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from risk_sac.geometry import RelativeView, relative_view
from risk_sac.risk.ttc import TTC_CAP_S, time_to_collision
from tests.builders import frame_of

LENGTH_M, WIDTH_M = 4.6, 1.85


def view_of(*others: tuple[float, float, float, float, float], ego_mps: float = 20.0) -> RelativeView:
    """The ego at the origin, driving along x; each other is x, y, heading, vx, vy."""
    columns = np.array([(0.0, 0.0, 0.0, ego_mps, 0.0), *others]).T
    x, y, heading, vx, vy = columns
    frame = frame_of(x_m=x, y_m=y, heading_rad=heading, vx_mps=vx, vy_mps=vy, length_m=LENGTH_M, width_m=WIDTH_M)
    return relative_view(frame)


def test_ttc_to_a_leader_is_the_gap_over_the_closing_speed() -> None:
    assert time_to_collision(view_of((34.6, 0, 0, 15, 0))).tolist() == pytest.approx([6.0])  # 30 m at 5 m/s


def test_each_actor_gets_its_own_ttc() -> None:
    ttc = time_to_collision(view_of((34.6, 0, 0, 15, 0), (64.6, 0, math.pi, -10, 0), (20, 3.3, 0, 10, 0)))
    assert ttc.tolist() == pytest.approx([6.0, 2.0, TTC_CAP_S])


def test_no_course_of_collision_takes_the_cap() -> None:
    assert time_to_collision(view_of((34.6, 0, 0, 25, 0))).tolist() == [TTC_CAP_S]


def test_touching_bodies_have_no_time_left() -> None:
    assert time_to_collision(view_of((4.0, 0, 0, 25, 0))).tolist() == [0.0]


@settings(deadline=None)  # the first call compiles
@given(
    st.tuples(*(st.floats(-50, 50), st.floats(-50, 50), st.floats(-4, 4), st.floats(-20, 20), st.floats(-20, 20))),
    st.floats(0, 20),
)
def test_ttc_is_finite_and_within_its_range(other: tuple[float, float, float, float, float], ego_mps: float) -> None:
    ttc = time_to_collision(view_of(other, ego_mps=ego_mps))[0]
    assert 0.0 <= ttc <= TTC_CAP_S
