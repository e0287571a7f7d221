"""Adversaries that enter oncoming lanes, on roads of one or more lanes."""

import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from risk_sac.config import EgoConfig
from risk_sac.scenario.families import FAMILIES, Family
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.limits import limits_from_odd
from risk_sac.sim.collision import Contact, find_contact
from risk_sac.sim.control import Adversaries
from risk_sac.sim.ego import Belief
from risk_sac.sim.paths import Along, path_along
from risk_sac.sim.pilot import Motion, driven
from risk_sac.sim.solid import VehicleCommand
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.types import HEADING, LATERAL, SPEED, STEP_S, VX, VY, Floats, Frame, Role, X, Y

SPEED_MPS = 20.0
LIMITS = limits_from_odd(FAMILIES["low"].odd, 1.0)
LEAD_STEPS = 15


class Steady:
    """Keeps the speed and heading that the ego has at its handover."""

    def begin(self, layout: Layout, seed: int, frame: Frame) -> Motion:
        self.motion = Motion(*(float(frame.state[row, 0]) for row in (X, Y, HEADING)), SPEED_MPS)
        return self.motion

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        m = self.motion
        step_m = m.speed_mps * STEP_S
        self.motion = m._replace(
            x_m=m.x_m + step_m * math.cos(m.heading_rad), y_m=m.y_m + step_m * math.sin(m.heading_rad)
        )
        return self.motion


@pytest.fixture(scope="module")
def sim() -> Iterator[SumoSimulation]:
    with closing(SumoSimulation(EgoConfig(), pilot=Steady())) as simulation:
        yield simulation


def start(id_: str, role: Role, edge: str, position_m: float, lane: int = 0) -> VehicleStart:
    uses_oncoming = role is Role.ADVERSARY
    return VehicleStart(
        id=id_,
        role=role,
        route=(edge,),
        lane=lane,
        position_m=position_m,
        speed_mps=SPEED_MPS,
        uses_oncoming=uses_oncoming,
    )


def meeting(apart_m: float, ego_edge: str = "eastbound", edge: str = "westbound") -> Layout:
    """Two cars that come towards each other."""
    ego = start("ego", Role.EGO, ego_edge, 500.0)
    other = start("actor", Role.ADVERSARY, edge, 2000.0 - 500.0 - apart_m)
    return Layout(net="rural/rural.net.xml", ego=ego, vehicles=(other,))


def play(
    sim: SumoSimulation, layout: Layout, steers: list[float], drive: float = 0.0
) -> tuple[list[Frame], Contact | None, list[bool]]:
    """Returns frames, first contact, and whether the adversary left its lanes."""
    frame = sim.reset(layout, 1)
    for _ in range(LEAD_STEPS):
        frame = sim.step()
    family = cast(Family, SimpleNamespace(vehicles=("actor",), pedestrians=(), adversaries=("actor",)))
    adversaries = Adversaries(family, LIMITS, frame)
    sim.hand_over_ego()
    sim.release()
    frames, contact, outside = [frame], None, [False]
    for steer in steers:
        adversaries.command([drive, steer], frames[-1], sim)
        frames.append(sim.step())
        outside.append("actor" in sim._oncoming)
        assert adversaries.keep_limits(frames[-1])
        contact = find_contact(frames[-2], frames[-1])
        if contact is not None:
            break
    return frames, contact, outside


def in_own_frame(frames: list[Frame]) -> Floats:
    """Returns the adversary's way along and across, and turn, `T x 3`."""
    states = np.array([frame.state[:, 1] for frame in frames])
    dx, dy = states[:, X] - states[0, X], states[:, Y] - states[0, Y]
    cos, sin = round(math.cos(states[0, HEADING])), round(math.sin(states[0, HEADING]))
    return np.stack(
        (dx * cos + dy * sin, dy * cos - dx * sin, np.unwrap(states[:, HEADING]) - states[0, HEADING]), axis=1
    )


ACROSS = [1.0] * 60


def test_an_oncoming_adversary_enters_the_egos_lane_and_hits_it(sim):
    frames, contact, outside = play(sim, meeting(230.0), ACROSS)
    assert contact is not None
    assert contact.ego_zone == "front"
    assert outside[-1]
    assert frames[-1].y_m[1] < 0.0 < frames[0].y_m[1]


def test_an_oncoming_adversary_without_an_action_passes(sim):
    frames, contact, outside = play(sim, meeting(230.0), [0.0] * 80)
    assert contact is None
    assert not any(outside)
    assert frames[-1].x_m[1] < frames[-1].x_m[0]


def test_an_adversary_that_may_not_use_oncoming_lanes_stays_in_its_own(sim):
    layout = meeting(230.0)
    stays = replace(layout, vehicles=(replace(layout.vehicles[0], uses_oncoming=False),))
    frames, contact, _ = play(sim, stays, ACROSS)
    assert contact is None
    assert min(frame.y_m[1] - frame.width_m[1] / 2 for frame in frames) >= 0.0


def test_an_episode_beside_the_own_lanes_is_repeated_exactly(sim):
    first, second = (play(sim, meeting(230.0), ACROSS)[0] for _ in range(2))
    assert [frame.state.tobytes() for frame in first] == [frame.state.tobytes() for frame in second]


def test_the_recorded_speeds_repeat_an_episode(sim):
    layout = meeting(230.0)
    first, _, _ = play(sim, layout, ACROSS)
    frame = sim.reset(layout, 1)
    for _ in range(LEAD_STEPS):
        frame = sim.step()
    sim.hand_over_ego()
    sim.release()
    for recorded in first[1:]:
        sim.apply({"actor": VehicleCommand(*(float(recorded.state[row, 1]) for row in (SPEED, LATERAL)))}, {})
        frame = sim.step()
        np.testing.assert_allclose(frame.state, recorded.state, atol=1e-9)


def test_both_directions_of_a_road_are_alike(sim):
    east, west = (
        in_own_frame(play(sim, meeting(1000.0, *edges), ACROSS, drive=1.0)[0])
        for edges in (("eastbound", "westbound"), ("westbound", "eastbound"))
    )
    np.testing.assert_allclose(east, west, atol=2e-3)
    assert east[-1, 1] > 1.5


def test_an_adversary_comes_back_and_is_handed_back_without_a_jolt(sim):
    steers = [1.0] * 30 + [-0.5] * 70 + [0.0] * 20
    frames, contact, outside = play(sim, meeting(1000.0), steers)
    assert contact is None
    assert outside[35]
    assert not outside[-1]
    states = np.array([frame.state[:, 1] for frame in frames])
    assert states[:, Y].min() < 0.0 < 0.925 <= states[-1, Y]
    assert np.abs(np.diff(states[1:, HEADING])).max() < 0.02
    accel = np.diff(states[1:, [VX, VY]], axis=0) / STEP_S
    assert np.abs(accel[:, 0]).max() < 1.0
    assert np.abs(accel[:, 1]).max() < LIMITS.lateral_accel_mps2 + 0.5


def test_no_adversary_leaves_the_outer_oncoming_lane(sim):
    frames, _, _ = play(sim, meeting(1000.0), [1.0] * 100)
    assert frames[-1].y_m[1] < -1.5
    assert min(frame.y_m[1] - frame.width_m[1] / 2 for frame in frames) >= -3.5


@pytest.mark.parametrize("edge", ["eastbound", "westbound"])
def test_an_adversary_does_not_use_the_kerb(sim, edge):
    other = {"eastbound": "westbound", "westbound": "eastbound"}[edge]
    ego, actor = start("ego", Role.EGO, other, 100.0, 2), start("actor", Role.ADVERSARY, edge, 200.0, 2)
    slow = Layout(
        net="urban_street/urban_street.net.xml",
        ego=replace(ego, speed_mps=10.0),
        vehicles=(replace(actor, speed_mps=10.0),),
    )
    frames, _, outside = play(sim, slow, [-1.0] * 40)
    assert max(abs(frame.y_m[1]) + frame.width_m[1] / 2 for frame in frames) <= 3.3
    assert not any(outside)


def test_an_edge_with_a_median_has_no_oncoming_lane_beside_it(sim):
    ego = VehicleStart(
        id="ego", role=Role.EGO, route=("from_south", "to_north"), lane=2, position_m=20.0, speed_mps=8.0
    )
    actor = replace(ego, id="actor", role=Role.ADVERSARY, position_m=60.0, uses_oncoming=True)
    frames, _, outside = play(sim, Layout(net="dense/dense.net.xml", ego=ego, vehicles=(actor,)), [1.0] * 40)
    assert not any(outside)
    assert min(frame.x_m[1] - frame.width_m[1] / 2 for frame in frames) >= 1.5


def test_a_driver_of_sumo_stops_for_an_adversary_in_its_lane(sim):
    layout = meeting(1000.0)
    car = start("car", Role.BACKGROUND, "eastbound", 900.0)
    met = replace(layout, vehicles=(layout.vehicles[0], replace(car, uses_oncoming=False)))
    frames, _, _ = play(sim, met, [1.0] * 140)
    assert min(frame.speed_mps[2] for frame in frames) < 5.0


@pytest.mark.parametrize("lateral_mps", [0.0, 1.0])
def test_the_front_follows_the_command_and_the_rear_axle_the_front(lateral_mps):
    path = path_along([np.array([(0.0, 0.0), (500.0, 0.0)])], [30.0])
    ends = []
    for side in (1, -1):
        motion, station_m = Motion(10.0, 0.0, 0.0, 10.0), 12.3
        for _ in range(50):
            motion = driven(motion, 4.6, Along(path, station_m, 0.0), VehicleCommand(10.0, side * lateral_mps))
            station_m += 1.0
        ends.append(motion)
    left, right = ends
    assert (left.x_m, left.y_m, left.heading_rad) == pytest.approx((right.x_m, -right.y_m, -right.heading_rad))
    front_y = left.y_m + 2.3 * math.sin(left.heading_rad)
    assert front_y == pytest.approx(5.0 * lateral_mps)
    assert left.heading_rad == pytest.approx(math.atan2(lateral_mps, 10.0), abs=1e-4)
