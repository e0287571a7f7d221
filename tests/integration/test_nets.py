"""SUMO's driver on each shipped net in traffic: arrives, touches nothing."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.sim.paths import HEADING, LIMIT, STATION, Y
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.geometry import overlapping_pairs
from risk_sac.world.types import Frame, Role, Signal

GAP_S = 2.0
RAMP, MAIN = ("ramp", "weave", "out"), ("main", "weave", "out")
RING = ("ring_south", "ring_to_east", "ring_east", "ring_to_north")
STEPS = 200


@pytest.fixture(scope="module")
def sim() -> Iterator[SumoSimulation]:
    with closing(SumoSimulation(EgoConfig())) as simulation:
        yield simulation


def car(id_: str, route: tuple[str, ...], lane: int, position_m: float, speed_mps: float) -> VehicleStart:
    role = Role.EGO if id_ == "ego" else Role.BACKGROUND
    return VehicleStart(id=id_, role=role, route=route, lane=lane, position_m=position_m, speed_mps=speed_mps)


def queue(name: str, route: tuple[str, ...], lane: int, first_m: float, speed_mps: float, cars: int):
    """Cars that follow each other at `GAP_S`."""
    apart_m = 4.6 + GAP_S * speed_mps
    return [car(f"{name}{i}", route, lane, first_m - i * apart_m, speed_mps) for i in range(cars)]


SCENES = {
    "motorway": ("motorway", car("ego", ("main",), 1, 400, 33), queue("left", ("main",), 2, 550, 36, 4)),
    "merging": ("motorway_ramp", car("ego", RAMP, 0, 300, 20), queue("main", MAIN, 0, 590, 28, 5)),
    "merged before": ("motorway_ramp", car("ego", MAIN, 0, 380, 30), queue("ramp", RAMP, 0, 350, 20, 3)),
    "lane drop": ("lane_drop", car("ego", ("main", "out"), 0, 560, 25), queue("main", ("main", "out"), 1, 740, 24, 5)),
    "rural": ("rural", car("ego", ("eastbound",), 0, 300, 25), queue("other", ("westbound",), 0, 1500, 25, 5)),
    "street": ("urban_street", car("ego", ("eastbound",), 2, 200, 13), queue("other", ("westbound",), 2, 700, 13, 5)),
    "roundabout": (
        "roundabout",
        car("ego", ("from_south", *RING[1:], "to_north"), 0, 150, 12),
        queue("west", ("from_west", "ring_to_south", *RING[:2], "to_east"), 0, 220, 10, 4),
    ),
    "left turn": (
        "priority_junction",
        car("ego", ("from_south", "to_west"), 1, 150, 12),
        queue("north", ("from_north", "to_south"), 1, 220, 13, 4),
    ),
    "minor road": (
        "priority_junction",
        car("ego", ("from_west", "to_east"), 1, 150, 12),
        queue("north", ("from_north", "to_south"), 1, 220, 13, 4),
    ),
}


def play(sim: SumoSimulation, scene: str, seed: int) -> list[Frame]:
    net, ego, others = SCENES[scene]
    frames = [sim.reset(Layout(net=f"{net}/{net}.net.xml", ego=ego, vehicles=tuple(others)), seed)]
    while len(frames) < STEPS and not overlapping_pairs(frames[-1].state):
        frames.append(sim.step())
    return frames


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("scene", SCENES)
def test_sumos_driver_touches_nothing(sim, scene, seed):
    frames = play(sim, scene, seed)
    assert len(frames) == STEPS
    assert not any(frame.teleported for frame in frames)


@pytest.mark.parametrize(("scene", "dead_lane_y_m"), [("merging", -8.75), ("lane drop", -8.75)])
def test_an_ego_leaves_a_lane_that_ends(sim, scene, dead_lane_y_m):
    ends = [play(sim, scene, seed)[-1] for seed in range(1, 7)]
    merged = [frame.y_m[0] > dead_lane_y_m + 1.75 for frame in ends]
    assert sum(merged) >= 5
    assert np.mean([frame.speed_mps[0] for frame in ends]) > 15.0


def test_the_path_leaves_an_acceleration_lane_in_three_seconds_at_the_limit(sim):
    play(sim, "merged before", 1)
    path = sim._roads._lane(RAMP, "weave_0").way.path
    turned = np.flatnonzero(np.abs(path[HEADING]) > 1e-3)
    assert len(turned) == 1
    begins, ends = path[STATION, turned[0]], path[STATION, turned[0] + 1]
    assert (ends - begins) / 36.0 == pytest.approx(3.0, abs=0.1)
    assert path[LIMIT, turned[0]] == 36.0
    assert path[Y, -1] == -5.25


def test_every_signal_of_a_net_is_read(sim):
    ego = car("ego", ("from_south", "to_north"), 1, 100, 10)
    frame = sim.reset(Layout(net="dense/dense.net.xml", ego=ego, vehicles=()), 1)
    assert frame.signal is not Signal.NONE
    assert 0.0 < frame.stop_line_m < 135.0
