import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.scenario.ground import areas, is_convex, ribbon, triangles

ELL = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]
BEND = [(0.0, 0.0), (10.0, 0.0), (17.0, 7.0), (17.0, 20.0)]


def turned(points, angle):
    cos, sin = math.cos(angle), math.sin(angle)
    return [(x * cos - y * sin, x * sin + y * cos) for x, y in points]


@given(st.floats(-3.1, 3.1), st.booleans())
def test_triangles_cover_an_outline_of_any_shape_and_nothing_else(angle: float, clockwise: bool) -> None:
    outline = turned(ELL, angle)
    found = triangles(outline[::-1] if clockwise else outline)
    assert sum(shapely.Polygon(each).area for each in found) == pytest.approx(shapely.Polygon(outline).area)
    assert all(is_convex(each) for each in found)
    rng = np.random.default_rng(1)
    points = rng.uniform(-5, 5, (200, 2))
    inside = [any(area.contains(*point) for area in areas(found)) for point in points]
    assert inside == shapely.contains_xy(shapely.Polygon(outline), points).tolist()


@given(st.floats(-3.1, 3.1))
def test_a_ribbon_keeps_its_width_round_bends(angle: float) -> None:
    line = turned(BEND, angle)
    cover = shapely.union_all([shapely.Polygon(quad) for quad in ribbon(line, 3.0)])
    expected = shapely.LineString(line).buffer(1.5, cap_style="flat", join_style="mitre")
    assert cover.symmetric_difference(expected).area < 0.01 * expected.area
