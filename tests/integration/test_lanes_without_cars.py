"""Actors that start at a kerb or on a bus lane."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.bodies import BODIES, BodyName
from risk_sac.scenario.families import FAMILIES, Family
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.limits import limits_from_odd
from risk_sac.scenario.reading import FOLDER
from risk_sac.sim.control import Adversaries
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.types import SPEED, Floats, Role, X, Y

STREET = FOLDER / "urban_street/urban_street.net.xml"  # eastbound_1 is a kerb lane, the centre of lane 2 is at -1.65 m
LIMITS = limits_from_odd(FAMILIES["low"].odd, 1.0)
KERB_Y_M, LANE_Y_M = -4.4, -1.65


@pytest.fixture(scope="module")
def sim() -> Iterator[SumoSimulation]:
    with closing(SumoSimulation(EgoConfig())) as simulation:
        yield simulation


def street(role: Role, body: BodyName, net: str = str(STREET)) -> Layout:
    ego = VehicleStart(id="ego", role=Role.EGO, route=("eastbound",), lane=2, position_m=50.0, speed_mps=8.0)
    other = replace(ego, id="actor", role=role, lane=1, position_m=200.0, speed_mps=5.0, body=body)
    return Layout(net=net, ego=ego, vehicles=(other,))


def driven(sim: SumoSimulation, layout: Layout, steps: int, action: tuple[float, float] | None = None) -> Floats:
    """States of the actor, `T x 5`."""
    frame = sim.reset(layout, 1)
    for _ in range(15):
        frame = sim.step()
    family = cast(Family, SimpleNamespace(vehicles=("actor",), pedestrians=(), adversaries=("actor",)))
    adversaries = Adversaries(family, LIMITS, frame)
    sim.hand_over_ego()
    if action is not None:
        sim.release()
    states = [frame.state[:, 1]]
    for _ in range(steps):
        if action is not None:
            adversaries.command(list(action), frame, sim)
        frame = sim.step()
        assert action is None or adversaries.keep_limits(frame)
        states.append(frame.state[:, 1])
    return np.array(states)


@pytest.mark.parametrize("body", [name for name, row in BODIES.items() if "lanes" in row.moves])
def test_adversary_pulls_out_from_the_kerb(sim: SumoSimulation, body: BodyName) -> None:
    states = driven(sim, street(Role.ADVERSARY, body), 60, (0.5, 1.0))
    assert states[0, Y] == pytest.approx(KERB_Y_M, abs=0.2)
    assert states[:, Y].max() > LANE_Y_M
    assert np.all(np.diff(states[:, X]) > 0.0)


def test_adversary_stays_at_the_kerb_unless_it_steers(sim: SumoSimulation) -> None:
    states = driven(sim, street(Role.ADVERSARY, "car"), 60, (0.0, 0.0))
    assert states[:, Y] == pytest.approx(KERB_Y_M, abs=0.2)


def test_bus_of_the_traffic_keeps_to_a_bus_lane(sim: SumoSimulation, tmp_path: Path) -> None:
    net = tmp_path / "bus.net.xml"
    net.write_text(STREET.read_text().replace('allow="custom1"', 'allow="bus"'))
    states = driven(sim, street(Role.BACKGROUND, "bus", str(net)), 60)
    assert states[:, Y] == pytest.approx(KERB_Y_M, abs=0.2)
    assert states[-1, SPEED] > states[0, SPEED] > 4.0
