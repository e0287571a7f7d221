import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from risk_sac.config import Interval
from risk_sac.errors import SceneError
from risk_sac.maps.carriageway import ANY_WAY, SECTORS, Carriageway, carriageway_of, sector_of
from risk_sac.risk.publish import depth
from risk_sac.scenario.layout import areas, is_convex, ribbon, triangles
from risk_sac.scenario.space import Parameter, SceneSpace
from risk_sac.world.net import Edge, Net, NetLane
from risk_sac.world.types import Scene

ELL = [(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]
BEND = [(0.0, 0.0), (10.0, 0.0), (17.0, 7.0), (17.0, 20.0)]


def turned(points, angle):
    cos, sin = math.cos(angle), math.sin(angle)
    return [(x * cos - y * sin, x * sin + y * cos) for x, y in points]


@given(st.floats(-3.1, 3.1), st.booleans())
def test_triangles_cover_an_outline_of_any_shape_and_nothing_else(angle, clockwise):
    outline = turned(ELL, angle)
    found = triangles(outline[::-1] if clockwise else outline)
    assert sum(shapely.Polygon(each).area for each in found) == pytest.approx(shapely.Polygon(outline).area)
    assert all(is_convex(each) for each in found)
    rng = np.random.default_rng(1)
    points = rng.uniform(-5, 5, (200, 2))
    inside = [any(area.contains(*point) for area in areas(found)) for point in points]
    assert inside == shapely.contains_xy(shapely.Polygon(outline), points).tolist()


@given(st.floats(-3.1, 3.1))
def test_a_ribbon_keeps_its_width_round_bends(angle):
    line = turned(BEND, angle)
    cover = shapely.union_all([shapely.Polygon(quad) for quad in ribbon(line, 3.0)])
    expected = shapely.LineString(line).buffer(1.5, cap_style="flat", join_style="mitre")
    assert cover.symmetric_difference(expected).area < 0.01 * expected.area


EAST, NORTH, WEST, SOUTH = 0, 3, 6, 9  # sectors


def depth_at(carriageway: Carriageway, x_m: float, y_m: float, sector: int) -> float:
    return depth(carriageway.around(x_m, y_m, sector).edges, x_m, y_m)


def shipped(name: str) -> Carriageway:
    return carriageway_of(f"{name}/{name}.net.xml")


@pytest.mark.parametrize(
    ("x_m", "y_m", "sector", "depth_m"),
    [
        pytest.param(500.0, -1.0, EAST, 1.0, id="a metre from the oncoming lanes"),
        pytest.param(500.0, -6.0, EAST, 0.6, id="beside the sidewalk"),
        pytest.param(500.0, -7.85, EAST, -1.25, id="on the sidewalk"),
        pytest.param(500.0, 2.0, EAST, -2.0, id="on an oncoming lane"),
        pytest.param(500.0, 2.0, WEST, 2.0, id="the same place in its own direction"),
        pytest.param(500.0, 2.0, ANY_WAY, 4.6, id="the same place for an ego that overtakes"),
        pytest.param(300.0, 2.0, EAST, -2.0, id="on an oncoming lane at a crossing"),
        pytest.param(300.0, -3.3, EAST, 3.3, id="on the pedestrian crossing"),
        pytest.param(300.0, -7.6, EAST, -1.0, id="on the walkway beside the pedestrian crossing"),
    ],
)
def test_a_road_of_two_directions(x_m, y_m, sector, depth_m):
    assert depth_at(shipped("mixed"), x_m, y_m, sector) == pytest.approx(depth_m, abs=1e-3)


@pytest.mark.parametrize("sector", [EAST, NORTH, WEST, SOUTH, ANY_WAY])
def test_a_junction_belongs_to_all_directions_but_its_walkways_do_not(sector):
    dense = shipped("dense")
    assert depth_at(dense, 0.0, 0.0, sector) > 10.0
    assert depth_at(dense, 14.0, 14.0, sector) < -2.0  # the corner where pedestrians wait


def test_from_a_junction_a_road_leads_on_only_in_its_direction():
    """East of the junction, lanes that lead away are the southern ones."""
    dense = shipped("dense")
    for x_m in (17.0, 19.6, 22.0, 40.0):
        assert depth_at(dense, x_m, -4.8, EAST) > 1.6
    assert depth_at(dense, 22.0, 4.8, EAST) == pytest.approx(-2.4, abs=1e-3)  # its mouth, at 19.6
    assert depth_at(dense, 22.0, 4.8, WEST) > 1.6
    assert depth_at(dense, 22.0, 4.8, NORTH) > 1.6  # a crossing road, of either direction


@pytest.mark.parametrize("name", ["mixed", "dense"])
def test_no_seam_between_lanes_junctions_and_squares(name):
    """A metre to the side costs a metre of depth anywhere."""
    carriageway = shipped(name)
    for x_m in np.arange(-60.0, 60.0, 0.37):
        x_m, y_m = (x_m + 300.0, -4.95) if name == "mixed" else (x_m, -6.45)
        assert depth_at(carriageway, x_m, y_m, EAST) >= 1.65 - 1e-3


def bend(radius_m: float, width_m: float = 3.2) -> Carriageway:
    """Lane that turns left by 90°, and one back outside of it."""
    angles = np.linspace(0.0, math.pi / 2, 60)
    roads = []
    for name, r, order in (("on", radius_m, 1), ("back", radius_m + width_m, -1)):
        line = [(r * math.cos(a), r * math.sin(a)) for a in angles][::order]
        lane = NetLane(f"{name}_0", name, 0, r * math.pi / 2, width_m, 13.9, tuple(line), True)
        roads.append(Edge(name, "a", "b", (lane,)))
    return Carriageway(Net(edges={edge.id: edge for edge in roads}))


@pytest.mark.parametrize("radius_m", [15.0, 60.0])
def test_a_bend_is_as_wide_as_its_lane(radius_m):
    carriageway = bend(radius_m)
    for angle in np.linspace(0.2, math.pi / 2 - 0.2, 30):
        sector = sector_of(angle + math.pi / 2)
        for outwards_m, depth_m in ((0.0, 1.6), (1.0, 0.6), (-1.0, 0.6), (3.2, -1.6), (-3.2, -1.6)):
            r = radius_m + outwards_m
            at = depth_at(carriageway, r * math.cos(angle), r * math.sin(angle), sector)
            assert at == pytest.approx(depth_m, abs=0.03)


@pytest.mark.parametrize("sector", [*range(SECTORS), ANY_WAY])
def test_outlines_are_closed_to_the_last_digit(sector):
    edges = shipped("dense").around(5.0, 5.0, sector).edges
    assert sorted(map(tuple, edges[:, :2])) == sorted(map(tuple, edges[:, 2:4]))


SPACE = SceneSpace(
    "low",
    (
        Parameter("gap_m", "m", 5.0, 45.0, "gap to the leader"),
        Parameter("speed_mps", "m/s", 0.1, 0.7, "speed of the leader", "dynamic.vehicle_speed_mps"),
        Parameter("lane", "1", 1.0, 1.0, "a parameter without room"),
    ),
)


def test_the_cubes_corners_are_the_bounds():
    assert SPACE.dimension == 3
    assert SPACE.names == ("gap_m", "speed_mps", "lane")
    assert SPACE.from_unit(np.zeros(3)).values == {"gap_m": 5.0, "speed_mps": 0.1, "lane": 1.0}
    assert SPACE.from_unit(np.ones(3)).values == {"gap_m": 45.0, "speed_mps": 0.7, "lane": 1.0}
    assert SPACE.from_unit(np.array([0.25, 0.5, 0.3])).values["gap_m"] == 15.0


@given(arrays(np.float64, 3, elements=st.floats(0, 1)))
def test_a_point_comes_back_from_its_scene(point):
    scene = SPACE.from_unit(point)
    SPACE.check(scene)
    np.testing.assert_allclose(SPACE.to_unit(scene)[:2], point[:2], atol=1e-12)
    assert SPACE.to_unit(scene)[2] == 0.0


@pytest.mark.parametrize(
    ("family", "change", "message"),
    [
        ("dense", {}, "family 'dense'; wanted 'low'"),
        ("low", {"gap_m": 50.0}, r"gap_m is 50 m; the 'low' family allows \[5, 45\]"),
        ("low", {"gap_m": float("nan")}, "gap_m is nan"),
        ("low", {"speed_mps": float("inf")}, "speed_mps is inf"),
        ("low", {"spede_mps": 0.5}, r"unknown parameters \['spede_mps'\]"),
        ("low", {"lane": None}, r"lacks \['lane'\]"),
    ],
)
def test_scenes_outside_the_space_are_refused(family, change, message):
    values = {"gap_m": 10.0, "speed_mps": 0.5, "lane": 1.0} | change
    scene = Scene(family, {name: value for name, value in values.items() if value is not None})
    with pytest.raises(SceneError, match=message):
        SPACE.check(scene)


def test_narrowing_intersects_and_keeps_the_rest():
    narrowed = SPACE.narrow({"gap_m": Interval(low=-10, high=20)})
    assert [(p.low, p.high) for p in narrowed.parameters] == [(5.0, 20.0), (0.1, 0.7), (1.0, 1.0)]
    assert SPACE.narrow({}) == SPACE
