"""Predicted paths beside what SUMO's drivers then drive, on every net."""

import math
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import libsumo
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sumo_nets
from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.limits import Limits, limits_from_odd
from risk_sac.sim.lookout import project
from risk_sac.sim.paths import AHEAD_M, STATION, X, Y, path_along, path_through
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.sim.vehicle_control import BODY_M, CAP, GRID_M, HERE, SOON, bends
from risk_sac.world.types import Role
from tests.roads import arc_m, road

LEGS = ("south", "east", "north", "west")  # counter-clockwise
ROUTES = (
    [("low", ("road",), lane, 200.0) for lane in (0, 1, 2)]
    + [
        ("mixed", route, lane, 300.0 if route[0] == "e2" else 250.0)
        for route in (("e1", "e2"), ("e2", "e3"), ("w3", "w2"), ("w2", "w1"))
        for lane in (1, 2)
    ]
    + [
        ("dense", (f"from_{leg}", f"to_{LEGS[(LEGS.index(leg) + turn) % 4]}"), 1 if turn == 1 else 2, 190.0)
        for leg in LEGS
        for turn in (1, 2, 3)  # right, straight on, left
    ]
)


@pytest.fixture(scope="module")
def sim():
    with closing(SumoSimulation(EgoConfig())) as simulation:
        yield simulation


def alone(family: str, route: tuple[str, ...], lane: int, position_m: float) -> Layout:
    space = FAMILIES[family].space
    layout = FAMILIES[family].layout(space.from_unit(np.full(space.dimension, 0.5)).values)
    ego = VehicleStart(id="ego", role=Role.EGO, route=route, lane=lane, position_m=position_m, speed_mps=8.0)
    return replace(layout, ego=ego, vehicles=(), pedestrians=())


@pytest.mark.parametrize(
    ("family", "route", "lane", "position_m"), ROUTES, ids=[f"{r[0]} {r[1]} {r[2]}" for r in ROUTES]
)
def test_a_vehicle_drives_along_its_path(sim, family, route, lane, position_m):
    frame = sim.reset(alone(family, route, lane, position_m), 0)
    path, station_m, offset_m, _ = sim.along("ego")
    np.testing.assert_allclose(np.hypot(*np.diff(path[:2])), np.diff(path[STATION]))
    assert path[STATION, 0] == 0.0
    assert path[STATION, -1] >= min(AHEAD_M, 1.0)
    assert abs(offset_m) < 0.5
    libsumo.vehicle.setLaneChangeMode("ego", 0)
    before_m = 0.0
    for _ in range(200):
        front = [
            float(c[0]) + 2.3 * f(float(frame.heading_rad[0]))
            for c, f in ((frame.x_m, math.cos), (frame.y_m, math.sin))
        ]
        at_m, aside_m, _ = project(path, *front)
        assert abs(aside_m) < 0.73, at_m  # within its lane of 3.3 m; it is 1.85 m wide
        assert at_m >= before_m - 0.1
        before_m = at_m
        frame = sim.step()
    assert before_m > station_m + 50.0 or frame.signal.name == "RED"


def test_a_lane_shorter_than_it_is_drawn_has_its_vehicles_where_they_are(sim, tmp_path):
    """Outer lanes of a bend are so: an edge has one length."""
    shipped = (Path(sumo_nets.__file__).parent / "low" / "low.net.xml").read_text()
    net = tmp_path / "short.net.xml"
    net.write_text(shipped.replace('length="1200.00"', 'length="1190.00"'))
    frame = sim.reset(replace(alone("low", ("road",), 1, 600.0), net=str(net)), 0)
    front_m = float(frame.x_m[0]) + 2.3
    assert front_m > 605.0
    assert sim.along("ego").station_m == pytest.approx(front_m, abs=0.05)


NODES = '<node id="0" x="0" y="0"/><node id="1" x="100" y="0"/><node id="2" x="200" y="0"/><node id="3" x="500" y="0"/>'
EDGES = (
    '<edge id="a" from="0" to="1" numLanes="1"/><edge id="b" from="1" to="2" numLanes="2"/>'
    '<edge id="c" from="2" to="3" numLanes="1"/><edge id="d" from="2" to="4" numLanes="1"/>'
)
LINK = '<connection from="{}" to="{}" fromLane="{}" toLane="{}"/>'


@pytest.mark.parametrize("own", [0, 1])
def test_where_a_lane_forks_the_path_leads_over_the_one_that_leads_on(sim, tmp_path, own):
    """The other lane leads off the route, to the right or left."""
    links = [("a", "b", 0, 0), ("a", "b", 0, 1), ("b", "c", own, 0), ("b", "d", 1 - own, 0)]
    parts = {
        "nodes": NODES + f'<node id="4" x="300" y="{-80 if own else 80}"/>',
        "edges": EDGES,
        "connections": "".join(LINK.format(*link) for link in links),
    }
    options = []
    for name, content in parts.items():
        (tmp_path / name).write_text(f"<{name}>{content}</{name}>")
        options += [f"--{name[:-1]}-files", tmp_path / name]
    net = tmp_path / "fork.net.xml"
    command = [Path(sys.executable).parent / "netconvert", *options, "--no-turnarounds", "-o", net]
    subprocess.run(command, capture_output=True, check=True)
    layout = replace(alone("low", ("a", "b", "c"), 0, 50.0), net=str(net), signal=None)
    sim.reset(layout, 0)
    points = sim.along("ego").path
    assert points[X, -1] > 300.0
    for _ in range(140):
        frame = sim.step()
        _, offset_m, _ = project(points, float(frame.x_m[0]), float(frame.y_m[0]))
        assert abs(offset_m) < 0.73
    assert libsumo.vehicle.getRoadID("ego") == "c"


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
@pytest.mark.parametrize(
    ("behind", "expected"),
    [
        ((100.0, 0.0), [(0, 0), (100, 0), (200, 0)]),  # where the one before it ends
        ((100.0, 0.01), [(0, 0), (95, 0), (100, 0.01), (200, 0)]),  # as rounded to centimetres
        ((100.0, 1.0), [(0, 0), (95, 0), (100, 1), (200, 0)]),
        ((99.5, 0.5), [(0, 0), (95, 0), (99.5, 0.5), (200, 0)]),  # before it
        ((100.0, 1.1), [(0, 0), (100, 0), (100, 1.1), (200, 0)]),  # another place
    ],
)
def test_a_lane_that_begins_beside_the_end_of_another_is_led_to_without_a_step(side, behind, expected):
    x, y = behind
    lines = [np.array([(0.0, 0.0), (100.0, 0.0)]), np.array([(x, side * y), (200.0, 0.0)])]
    points = path_along(lines, [13.9, 13.9])
    np.testing.assert_allclose(points[[X, Y]].T, [(x, side * y) for x, y in expected])
    np.testing.assert_allclose(np.hypot(*np.diff(points[[X, Y]])), np.diff(points[STATION]))


LIMITS = limits_from_odd(FAMILIES["dense"].odd, friction=0.8)
radii = st.floats(6, 60)


def corner(turn_rad: float) -> np.ndarray:
    """10 m straight, a corner, 10 m straight."""
    return with_headings(0.0, turn_rad, turn_rad)


def with_headings(*heading_rad: float) -> np.ndarray:
    """Two pieces of 10 m; points and speeds do not matter."""
    return path_through(np.zeros(3), np.zeros(3), np.array([0.0, 10.0, 20.0]), np.array(heading_rad), np.full(3, 13.89))


def test_a_corner_turns_the_body_over_its_own_length_by_hand():
    got = bends(corner(0.46), LIMITS)
    assert got[HERE] == pytest.approx([0.0] * 20 + [0.1] * 10 + [0.0] * 11)  # 10 to 14.5 m: 0.46 rad / 4.6 m
    assert got[SOON] == pytest.approx([0.0] * 10 + [0.1] * 20 + [0.0] * 11)  # from 5 m before


def test_a_bend_is_approached_by_hand():
    limits = Limits(
        speed_mps=20, accel_mps2=3, brake_mps2=8, grip_mps2=5, jerk_mps3=20, lateral_mps=1.2, lateral_accel_mps2=1,
        walk_speed_mps=2, walk_accel_mps2=1.5, walk_brake_mps2=1.5, heading_rate_radps=2,
    )  # fmt: skip
    assert limits.cornering_mps2 == pytest.approx(3.0)
    assert limits.approach_mps2 == pytest.approx(3.0)  # 3² + (3 + 1)² = 5²
    cap = bends(corner(0.46), limits)[CAP]
    assert cap[10] == cap[29] == pytest.approx(math.sqrt(3.0 / 0.1))
    assert cap[0] == pytest.approx(math.sqrt(30.0 + 2 * 3.0 * 5.0))  # 5 m before
    assert cap[30] > 1000


@settings(max_examples=30)
@given(radii, st.floats(0.3, math.pi), st.floats(0.2, 4))
def test_an_arc_has_its_own_curvature_and_the_speed_for_it(radius, turn, piece):
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
def test_every_cap_can_be_braked_to(radius, turn):
    square = bends(road(radius, turn_rad=turn), LIMITS)[CAP] ** 2
    assert np.all(square[:-1] - square[1:] <= 2 * LIMITS.approach_mps2 * GRID_M + 1e-6)


def test_a_heading_that_passes_pi_is_no_bend():
    got = bends(with_headings(math.pi - 0.01, -math.pi + 0.01, -math.pi + 0.01), LIMITS)
    assert max(got[HERE]) == pytest.approx(0.02 / BODY_M)


def test_of_a_lane_shorter_than_the_way_to_a_step_its_beginning_stays():
    lines = [np.array(line) for line in ([(0.0, 0.0), (3.0, 0.0)], [(3.0, 0.3), (9.0, 0.3)], [(9.0, 0.3), (50.0, 0.3)])]
    np.testing.assert_allclose(path_along(lines, [9.0, 8.0, 7.0])[[X, Y]].T, [(0, 0), (3, 0.3), (9, 0.3), (50, 0.3)])
