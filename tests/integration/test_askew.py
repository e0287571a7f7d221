"""Drivers of SUMO's and an ego that stands askew, its tail in the lane beside its own."""

import math
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.geometry import relative_view
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.sim.ego import Belief
from risk_sac.sim.paths import Along
from risk_sac.sim.pilot import Motion
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.types import Frame, Role

MIXED = FAMILIES["mixed"].layout(FAMILIES["mixed"].space.from_unit(np.full(10, 0.5)).values)
LANES_Y_M = {1: -4.95, 2: -1.65}  # their middles; lane 2 is the left one
X_M, ASIDE_M, TURNED_RAD = 150.0, 1.15, math.radians(30.0)  # its front is in the middle of its lane, its tail beside
STEPS = 100


class Standing:
    """Stands where it is told."""

    def __init__(self, motion: Motion) -> None:
        self._motion = motion

    def begin(self, layout: Layout, seed: int, frame: Frame) -> Motion:
        return self._motion

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        return self._motion


@pytest.mark.parametrize("wary", [True, False])
@pytest.mark.parametrize(("own", "beside"), [(2, 1), (1, 2)])
@pytest.mark.parametrize("speed_mps", [6.0, 12.0])
def test_who_comes_beside_an_ego_that_stands_askew_stops_for_it_only_if_drivers_are_wary(
    own: int, beside: int, speed_mps: float, wary: bool
) -> None:
    towards = math.copysign(1.0, LANES_Y_M[beside] - LANES_Y_M[own])
    askew = Motion(X_M, LANES_Y_M[own] + towards * ASIDE_M, -towards * TURNED_RAD, 0.0)
    layout = replace(
        MIXED,
        ego=_car("ego", Role.EGO, own, X_M, 0.0),
        pedestrians=(),
        wary=wary,
        vehicles=(_car("other", Role.BACKGROUND, beside, X_M - 60.0, speed_mps),),
    )
    with closing(SumoSimulation(EgoConfig(), pilot=Standing(askew))) as sim:
        sim.reset(layout, 1)
        sim.hand_over_ego()
        frames = [sim.step() for _ in range(STEPS)]
    assert any(relative_view(frame).overlap[0] for frame in frames) != wary
    assert frames[-1].x_m[1] > X_M - 20.0  # it came near


def _car(id_: str, role: Role, lane: int, position_m: float, speed_mps: float) -> VehicleStart:
    return VehicleStart(id=id_, role=role, route=("e1", "e2"), lane=lane, position_m=position_m, speed_mps=speed_mps)
