"""The road that an ego perceives, on every net, against geometry."""

import math
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import libsumo
import numpy as np
import pytest

import sumo_nets
from risk_sac.config import EgoConfig
from risk_sac.egos.driving import lane_edges
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.sim.roads import road_around, signals_at
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.types import Lane, Road, Role, Signal

ROUTES = {
    "low": [("road",)],
    "mixed": [("e1", "e2", "e3"), ("w3", "w2", "w1")],
    "dense": [("from_south", "to_west"), ("from_east", "to_west"), ("from_west", "to_south")],
}


@pytest.fixture(scope="module")
def sim():
    with closing(SumoSimulation(EgoConfig())) as simulation:
        yield simulation


def alone(family: str, route: tuple[str, ...], lane: int = 1) -> Layout:
    space = FAMILIES[family].space
    layout = FAMILIES[family].layout(space.from_unit(np.full(space.dimension, 0.5)).values)
    ego = VehicleStart(id="ego", role=Role.EGO, route=route, lane=lane, position_m=50.0, speed_mps=8.0)
    return replace(layout, ego=ego, vehicles=(), pedestrians=())


def loaded(sim: SumoSimulation, family: str, route: tuple[str, ...]) -> Road:
    sim.reset(alone(family, route), 0)
    return road_around(route)


def lane(road: Road, id_: str) -> Lane:
    return next(each for each in road.lanes if each.id == id_)


def test_the_route_through_a_junction_is_marked_and_its_signals_are_told(sim):
    road = loaded(sim, "dense", ("from_south", "to_west"))
    on_route = {each.id for each in road.lanes if each.on_route}
    assert on_route == {"from_south_2", ":centre_11_0", ":centre_21_0", "to_west_1", "to_west_2"}
    assert {"from_north_1", "from_north_2", "to_north_1"} <= {each.id for each in road.lanes}
    assert {line.lane for line in road.stop_lines} == {"from_south_1", "from_south_2"}
    left = road.stop_lines.index(next(line for line in road.stop_lines if line.leads_to == ":centre_11_0"))
    shown = set()
    for _ in range(600):
        libsumo.simulationStep()
        signals = signals_at(road.stop_lines)
        letter = libsumo.trafficlight.getRedYellowGreenState("centre")[road.stop_lines[left].link]
        assert signals[left] is {"r": Signal.RED, "y": Signal.YELLOW, "g": Signal.GREEN}[letter.lower()]
        shown.add(signals[left])
    assert shown == {Signal.RED, Signal.YELLOW, Signal.GREEN}


@pytest.mark.parametrize(("family", "route"), [(f, r) for f, routes in ROUTES.items() for r in routes])
def test_neighbours_are_beside_a_lane_and_successors_behind_it(sim, family, route):
    road = loaded(sim, family, route)
    for each in road.lanes:
        (x, y), (dx, dy) = each.line[:, 0], each.line[:, 1] - each.line[:, 0]
        for neighbour, side in ((each.left, 1.0), (each.right, -1.0)):
            if neighbour:
                other = lane(road, neighbour).line[:, 0]
                across = (dx * (other[1] - y) - dy * (other[0] - x)) / math.hypot(dx, dy)
                assert across == pytest.approx(side * 3.3, abs=0.3)
        for following in each.successors:
            assert math.dist(each.line[:, -1], lane(road, following).line[:, 0]) < 0.5


def test_a_road_turned_by_a_quarter_is_the_same_turned(sim):
    south = loaded(sim, "dense", ("from_south", "to_west"))
    east = loaded(sim, "dense", ("from_east", "to_south"))

    def route(road):
        return sorted((each for each in road.lanes if each.on_route), key=lambda each: each.line[0, 0])

    turned = [each.line[[1, 0]] * [[-1.0], [1.0]] for each in route(south)]
    for line in turned:
        assert any(line.shape == each.line.shape and np.allclose(line, each.line, atol=0.02) for each in route(east))
    assert len(south.stop_lines) == len(east.stop_lines)


def test_a_marking_that_may_not_be_crossed_is_told(sim, tmp_path):
    net = (Path(sumo_nets.__file__).parent / "low/low.net.xml").read_text()
    (tmp_path / "solid.net.xml").write_text(
        net.replace('<lane id="road_1"', '<lane id="road_1" changeLeft="authority"')
    )
    sim.reset(replace(alone("low", ("road",)), net=str(tmp_path / "solid.net.xml")), 0)
    middle = lane(road_around(("road",)), "road_1")
    assert middle.left == "road_2"
    assert not middle.may_change_left
    assert middle.may_change_right


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_the_edges_of_a_bend_keep_their_distance(mirrored):
    turn = np.linspace(0.0, math.pi / 2, 30)
    arc = np.array((20.0 * np.sin(turn), mirrored * 20.0 * (1.0 - np.cos(turn))))
    bend = Lane("bend", arc, 4.0, 10.0, "", "", False, False, (), True)
    left, right = lane_edges(bend)
    centre = np.array([[0.0], [mirrored * 20.0]])
    np.testing.assert_allclose(np.hypot(*(left - centre)), 20.0 - mirrored * 2.0, atol=0.02)
    np.testing.assert_allclose(np.hypot(*(right - centre)), 20.0 + mirrored * 2.0, atol=0.02)
