import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.verdicts.path import polyline, pose_at, project, recorded_path

CORNER = polyline(np.array([0.0, 10.0, 10.0]), np.array([0.0, 0.0, 10.0]))  # east, then north


@pytest.mark.parametrize(
    ("s", "pose"),
    [
        (0.0, (0.0, 0.0)),
        (4.0, (4.0, 0.0)),
        (13.0, (10.0, 3.0)),
        (25.0, (10.0, 15.0)),  # on beyond the end
        (-3.0, (-3.0, 0.0)),
    ],
)
def test_a_path_goes_on_straight_beyond_its_ends(s: float, pose: tuple[float, float]) -> None:
    assert pose_at(CORNER, s)[:2] == pytest.approx(pose)


@pytest.mark.parametrize(
    ("x", "y", "s", "left"),
    [(5.0, 2.0, 5.0, 2.0), (12.0, 5.0, 15.0, -2.0), (9.0, 20.0, 30.0, 1.0), (-2.0, -1.0, -2.0, -1.0)],
)
def test_the_nearest_point_of_a_path(x: float, y: float, s: float, left: float) -> None:
    assert project(CORNER, 0, x, y)[:2] == pytest.approx((s, left))


@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50)), min_size=2, max_size=8, unique=True), st.floats(0, 1)
)
def test_a_point_of_the_path_projects_onto_itself(points: list[tuple[float, float]], share: float) -> None:
    x, y = np.array(points).T
    path = polyline(x, y)
    here = pose_at(path, share * path.s[-1])
    s, left, _ = project(path, 0, here[0], here[1])
    assert left == pytest.approx(0.0, abs=1e-6)
    assert pose_at(path, s)[:2] == pytest.approx(here[:2], abs=1e-5)


def test_a_stop_on_the_way_does_not_disturb_a_recorded_path() -> None:
    x = np.array([0.0, 5.0, 5.0, 5.0, 9.0])
    path = recorded_path(x, np.zeros(5), np.array([0.0, 0.0, 2 * math.pi, 0.0, 0.0]))
    assert pose_at(path, 7.0) == pytest.approx((7.0, 0.0, 0.0))
    assert project(path, 1, 8.0, 1.0) == pytest.approx((8.0, 1.0, 0.0))
