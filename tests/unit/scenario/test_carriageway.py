import math

import numpy as np
import pytest

from risk_sac.risk.own_motion import depth
from risk_sac.scenario.carriageway import ANY_WAY, SECTORS, Carriageway, carriageway_of, sector_of
from risk_sac.scenario.maps.net import Edge, Lane, Net

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
def test_a_road_of_two_directions(x_m: float, y_m: float, sector: int, depth_m: float) -> None:
    assert depth_at(shipped("mixed"), x_m, y_m, sector) == pytest.approx(depth_m, abs=1e-3)


@pytest.mark.parametrize("sector", [EAST, NORTH, WEST, SOUTH, ANY_WAY])
def test_a_junction_belongs_to_all_directions_but_its_walkways_do_not(sector: int) -> None:
    dense = shipped("dense")
    assert depth_at(dense, 0.0, 0.0, sector) > 10.0
    assert depth_at(dense, 14.0, 14.0, sector) < -2.0  # the corner where pedestrians wait


def test_from_a_junction_a_road_leads_on_only_in_its_direction() -> None:
    """Along the road to the east, whose lanes away from the junction are the southern ones."""
    dense = shipped("dense")
    for x_m in (17.0, 19.6, 22.0, 40.0):
        assert depth_at(dense, x_m, -4.8, EAST) > 1.6
    assert depth_at(dense, 22.0, 4.8, EAST) == pytest.approx(-2.4, abs=1e-3)  # its mouth, at 19.6
    assert depth_at(dense, 22.0, 4.8, WEST) > 1.6
    assert depth_at(dense, 22.0, 4.8, NORTH) > 1.6  # a crossing road, of either direction


@pytest.mark.parametrize("name", ["mixed", "dense"])
def test_no_seam_between_lanes_junctions_and_squares(name: str) -> None:
    """A metre more to the side is a metre less deep, wherever a lane is driven."""
    carriageway = shipped(name)
    for x_m in np.arange(-60.0, 60.0, 0.37):
        x_m, y_m = (x_m + 300.0, -4.95) if name == "mixed" else (x_m, -6.45)
        assert depth_at(carriageway, x_m, y_m, EAST) >= 1.65 - 1e-3


def bend(radius_m: float, width_m: float = 3.2) -> Carriageway:
    """A lane that turns left by 90° about the origin, from the east, and one that comes back outside of it."""
    angles = np.linspace(0.0, math.pi / 2, 60)
    roads = []
    for name, r, order in (("on", radius_m, 1), ("back", radius_m + width_m, -1)):
        line = [(r * math.cos(a), r * math.sin(a)) for a in angles][::order]
        lane = Lane(f"{name}_0", name, 0, r * math.pi / 2, width_m, 13.9, tuple(line), True)
        roads.append(Edge(name, "a", "b", (lane,)))
    return Carriageway(Net(edges={edge.id: edge for edge in roads}))


@pytest.mark.parametrize("radius_m", [15.0, 60.0])
def test_a_bend_is_as_wide_as_its_lane(radius_m: float) -> None:
    carriageway = bend(radius_m)
    for angle in np.linspace(0.2, math.pi / 2 - 0.2, 30):
        sector = sector_of(angle + math.pi / 2)
        for outwards_m, depth_m in ((0.0, 1.6), (1.0, 0.6), (-1.0, 0.6), (3.2, -1.6), (-3.2, -1.6)):
            r = radius_m + outwards_m
            at = depth_at(carriageway, r * math.cos(angle), r * math.sin(angle), sector)
            assert at == pytest.approx(depth_m, abs=0.03)


@pytest.mark.parametrize("sector", [*range(SECTORS), ANY_WAY])
def test_outlines_are_closed_to_the_last_digit(sector: int) -> None:
    edges = shipped("dense").around(5.0, 5.0, sector).edges
    assert sorted(map(tuple, edges[:, :2])) == sorted(map(tuple, edges[:, 2:4]))
