"""The simulation's verbs, by what SUMO then does."""

import math
import shutil
from contextlib import closing
from dataclasses import replace

import libsumo
import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES, Family
from risk_sac.scenario.layout import Layout, PedestrianStart
from risk_sac.sim.solid import VehicleCommand
from risk_sac.sim.sumo import NETS, SumoSimulation
from risk_sac.world.types import Frame, Role


@pytest.fixture(scope="module")
def sim():
    with closing(SumoSimulation(EgoConfig())) as simulation:
        yield simulation


def middle(family: Family, **changes: float) -> Layout:
    scene = family.space.from_unit(np.full(family.space.dimension, 0.5))
    return family.layout(dict(scene.values) | changes)


def speed(frame: Frame, id_: str) -> float:
    return float(frame.speed_mps[frame.ids.index(id_)])


@pytest.mark.parametrize("folder", ["Tests, 2026", "a;b", "${HOME}", "100%", "ü é"])
def test_a_net_is_loaded_whatever_its_folder_is_called(sim, tmp_path, folder):
    layout = middle(FAMILIES["low"])
    (tmp_path / folder).mkdir()
    net = tmp_path / folder / "net.xml"
    shutil.copy(NETS / layout.net, net)
    assert sim.reset(replace(layout, net=str(net)), 0).ids == sim.reset(layout, 0).ids


def test_before_the_release_an_adversary_stops_for_whom_sumo_s_models_see(sim):
    layout = middle(FAMILIES["low"], left_speed_mps=14.0)
    left = next(v for v in layout.vehicles if v.id == "left")
    parked = replace(left, id="parked", role=Role.BACKGROUND, position_m=left.position_m + 30.0, speed_mps=0.0)
    sim.reset(replace(layout, vehicles=(left, parked)), 0)
    libsumo.vehicle.setSpeed("parked", 0.0)
    libsumo.vehicle.setLaneChangeMode("left", 0)
    for _ in range(60):
        frame = sim.step()
        assert not libsumo.simulation.getCollisions()
    assert speed(frame, "left") < 0.1


@pytest.mark.parametrize("side", ["left", "right"])
def test_only_after_the_release_a_command_is_driven_whatever_is_in_the_way(sim, side):
    def driven(*, released):
        layout = middle(FAMILIES["low"], **{f"{side}_speed_mps": 10.0})
        sim.reset(layout, 0)
        if released:
            sim.release()
        sim.apply({side: VehicleCommand(25.0, 0.0)}, {})
        return speed(sim.step(), side)

    assert driven(released=True) == 25.0
    assert driven(released=False) < 11.0


def pedestrian(id_: str, heading: float, speed_mps: float) -> PedestrianStart:
    return PedestrianStart(id=id_, role=Role.ADVERSARY, x_m=500.0, y_m=-9.0, heading_rad=heading, speed_mps=speed_mps)


@pytest.mark.parametrize("family", ["mixed", "dense"])
def test_a_released_driver_intends_to_stop_for_a_pedestrian_in_its_way(sim, family):
    adversary = FAMILIES[family].vehicles[0]

    def intended(ahead_m):
        layout = middle(FAMILIES[family], occluder_speed_mps=8.0, oncoming_speed_mps=8.0, oncoming_distance_m=60.0)
        only = next(v for v in layout.vehicles if v.id == adversary)
        frame = sim.reset(replace(layout, vehicles=(only,), pedestrians=()), 0)
        row = frame.ids.index(adversary)
        x, y, heading = (float(c[row]) for c in (frame.x_m, frame.y_m, frame.heading_rad))
        walker = PedestrianStart(
            id="pedestrian",
            role=Role.ADVERSARY,
            x_m=x + ahead_m * math.cos(heading),
            y_m=y + ahead_m * math.sin(heading),
            heading_rad=0.0,
            speed_mps=0.0,
        )
        sim.reset(replace(layout, vehicles=(only,), pedestrians=(walker,)), 0)
        sim.release()
        return sim.intended_accel()[adversary]

    assert intended(12.0) < -4.0
    assert intended(39.0) > -0.5
    assert intended(-12.0) > -0.5
