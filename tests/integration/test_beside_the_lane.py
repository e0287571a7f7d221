"""Egos beside their first lane, on either side: SUMO's and drivers' view."""

import math
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace

import libsumo
import numpy as np
import pytest

from risk_sac.config import EgoConfig, Odd
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.layout import Layout, VehicleStart
from risk_sac.scenario.limits import limits_from_odd
from risk_sac.scenario.odd import intersect
from risk_sac.search.scripts import Genes, Seen, act, cue
from risk_sac.sim.control import Adversaries
from risk_sac.sim.ego import Belief
from risk_sac.sim.paths import HEADING, STATION, Along, X, Y, way_of
from risk_sac.sim.pilot import Motion
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import STEP_S, Frame, Role, Signal


class Told:
    """Drives as a function of time says, whatever is in the way."""

    def __init__(self) -> None:
        self.motion: Callable[[float], Motion] = lambda time_s: Motion(0.0, 0.0, 0.0, 0.0)
        self.paths: list[Along] = []

    def begin(self, layout: Layout, seed: int, frame: Frame) -> Motion:
        self.paths = []
        return self.motion(0.0)

    def drive(self, frame: Frame, belief: Belief, along: Along) -> Motion:
        self.paths.append(along)
        return self.motion(len(self.paths) * STEP_S)


@pytest.fixture(scope="module")
def pilot() -> Told:
    return Told()


@pytest.fixture(scope="module")
def sim(pilot: Told) -> Iterator[SumoSimulation]:
    with closing(SumoSimulation(EgoConfig(), pilot=pilot)) as simulation:
        yield simulation


def middle(family: str) -> Layout:
    space = FAMILIES[family].space
    layout = FAMILIES[family].layout(space.from_unit(np.full(space.dimension, 0.5)).values)
    return replace(layout, vehicles=(), pedestrians=(), wary=False)


LOW, MIXED, DENSE = middle("low"), middle("mixed"), middle("dense")


def car(id_: str, route: tuple[str, ...], lane: int, position_m: float, speed_mps: float) -> VehicleStart:
    role = Role.EGO if id_ == "ego" else Role.BACKGROUND
    return VehicleStart(id=id_, role=role, route=route, lane=lane, position_m=position_m, speed_mps=speed_mps)


def play(sim: SumoSimulation, layout: Layout, steps: int) -> list[Frame]:
    sim.reset(layout, 1)
    sim.hand_over_ego()
    frames = []
    while len(frames) < steps and not sim.ego_arrived:
        frames.append(sim.step())
    return frames


@pytest.mark.parametrize("side", [1, -1])
def test_who_drives_past_an_ego_in_the_ditch_does_not_mind_it(sim, pilot, side):
    pilot.motion = lambda time_s: Motion(300.0, side * 8.0, 0.3, 0.0)
    lane = 1 + side
    layout = replace(
        LOW, ego=car("ego", ("road",), lane, 300.0, 0.0), vehicles=(car("o", ("road",), lane, 240.0, 12.0),)
    )
    frames = play(sim, layout, 80)
    assert frames[-1].x_m[1] > 310.0
    assert min(frame.speed_mps[1] for frame in frames) > 11.9


@pytest.mark.parametrize("y_m", [1.65, 0.0], ids=["on the oncoming lane", "half over the line"])
def test_who_comes_towards_an_ego_on_its_lane_stops_until_the_ego_is_back(sim, pilot, y_m):
    back_s = 9.0
    pilot.motion = lambda time_s: Motion(150.0, y_m if time_s < back_s else -1.65, 0.0, 0.0)
    layout = replace(
        MIXED,
        ego=car("ego", ("e1", "e2"), 2, 152.0, 0.0),
        vehicles=tuple(car(f"o{lane}", ("w1",), lane, 70.0, 12.0) for lane in (1, 2)),  # none may pass on the other
    )
    frames = play(sim, layout, 140)
    assert not any(relative_view(frame).overlap.any() for frame in frames)
    meets = frames[0].ids.index("o2")
    x_m = [frame.x_m[meets] for frame in frames if "o2" in frame.ids]
    assert min(x_m[: round(back_s / STEP_S)]) > 150.0
    assert min(x_m) < 140.0


@pytest.mark.parametrize("beside_m", [2.0, 6.0, 20.0])
@pytest.mark.parametrize("side", [1, -1])
def test_an_ego_that_drives_round_a_red_light_has_passed_it(sim, pilot, side, beside_m):
    """But not one that is off in the fields."""
    aside_m = side * beside_m
    pilot.motion = lambda time_s: Motion(3.15 + aside_m * min(time_s, 1.0), -60.0 + 10.0 * time_s, math.pi / 2, 10.0)
    ego = car("ego", ("from_south", "to_north"), 2, 190.0, 10.0)
    frames = play(sim, replace(DENSE, ego=ego, signal_offset_s=30.0), 60)
    assert frames[0].signal is Signal.RED
    lines_m = np.minimum([frame.stop_line_m for frame in frames], 1000.0)
    passed = np.flatnonzero(np.diff(lines_m) > 1.0)
    if beside_m > 10.0:
        assert not len(passed)
        return
    (step,) = passed
    assert frames[step].signal is Signal.RED
    assert frames[step].y_m[0] + 2.3 == pytest.approx(-19.6, abs=1.0)


@pytest.mark.parametrize(("lane", "to"), [(1, "to_west"), (2, "to_east")], ids=["turns left", "turns right"])
def test_the_path_of_a_lane_that_leads_elsewhere_leads_back_to_the_route(sim, lane, to):
    route = ("from_south", to)
    sim.reset(replace(DENSE, ego=car("ego", route, lane, 100.0, 10.0)), 1)
    path, (line,), complete, *_ = way_of(route, f"from_south_{lane}")
    assert complete
    own_m, other_m = (6.45, 3.15) if lane == 1 else (3.15, 6.45)
    straight = path[:, path[Y] < -19.0]
    assert straight[X, 0] == own_m
    assert straight[X, -1] == other_m
    left_from = straight[Y, np.flatnonzero(straight[X] == own_m)[-1]]
    assert left_from == pytest.approx(-69.6)  # 50 m before the end
    assert line.station_m == pytest.approx(230.4, abs=0.3)
    assert path[STATION, -1] > 350.0
    turn = 1 if to == "to_west" else -1
    assert path[HEADING, -1] - path[HEADING, 0] == pytest.approx(turn * math.pi / 2, abs=0.02)
    assert np.abs(np.diff(path[HEADING])).max() < 0.3


def test_an_ego_that_reaches_the_end_of_its_route_has_arrived(sim, pilot):
    pilot.motion = lambda time_s: Motion(1180.0 + 10.0 * time_s, 0.0, 0.0, 10.0)
    frames = play(sim, replace(LOW, ego=car("ego", ("road",), 1, 1150.0, 10.0)), 60)
    assert sim.ego_arrived
    assert len(frames) < 25
    assert 1200.0 <= frames[-1].x_m[0] + 2.3 < 1201.1


@pytest.mark.parametrize("beside_m", [0.0, 4.0])
def test_an_ego_s_path_stays_that_of_its_first_lane(sim, pilot, beside_m):
    away_m = beside_m + 3.3
    pilot.motion = lambda time_s: Motion(300.0 + 10.0 * time_s, -min(2.0 * time_s, away_m), 0.0, 10.0)
    play(sim, replace(LOW, ego=car("ego", ("road",), 1, 300.0, 10.0)), 50)
    path, station_m, offset_m, _ = pilot.paths[-1]
    assert path[Y, 0] == 0.0
    assert offset_m == pytest.approx(-away_m)
    assert station_m == pytest.approx(300.0 + 49.0 + 2.3)
    assert bool(libsumo.vehicle.getLaneID("ego")) == (beside_m == 0.0)
    assert libsumo.vehicle.getPosition("ego") == pytest.approx((352.3, -away_m))


@pytest.mark.parametrize("wary", [True, False])
@pytest.mark.parametrize(("own_m", "beside_m"), [(-1.65, -4.95), (-4.95, -1.65)])
@pytest.mark.parametrize("speed_mps", [6.0, 12.0])
def test_who_comes_beside_an_ego_that_stands_askew_stops_for_it_only_if_drivers_are_wary(
    sim, pilot, own_m, beside_m, speed_mps, wary
):
    """Its front is in its lane, its tail in the one beside."""
    towards = math.copysign(1.0, beside_m - own_m)
    pilot.motion = lambda time_s: Motion(150.0, own_m + towards * 1.15, -towards * math.radians(30.0), 0.0)
    own, beside = (2, 1) if own_m > beside_m else (1, 2)
    other = car("other", ("e1", "e2"), beside, 90.0, speed_mps)
    layout = replace(MIXED, ego=car("ego", ("e1", "e2"), own, 150.0, 0.0), vehicles=(other,), wary=wary)
    frames = play(sim, layout, 100)
    assert any(relative_view(frame).overlap[0] for frame in frames) != wary
    assert frames[-1].x_m[1] > 130.0  # it came near


CUT_IN = Genes(active=1.0, place=0.7, aside=0.3, cue=0.4, drive=0.5, steer=1.0, lasts=1.0, after=0.5)  # at 2.9 s


def cut_in(sim: SumoSimulation, pilot: Told, begins: int, ends: int, beside: int) -> tuple[np.ndarray, np.ndarray]:
    """Lateral places of an ego and of a neighbour that cuts in."""
    low = FAMILIES["low"]
    id_ = "right" if beside < begins else "left"
    lanes = {"lead": (begins, 400.0), id_: (beside, 300.0), "left" if id_ == "right" else "right": (beside, 200.0)}
    others = [replace(car(name, ("road",), *where, 12.0), role=Role.ADVERSARY) for name, where in lanes.items()]
    y_m = 3.3 * (np.array([begins, ends]) - 1)
    pilot.motion = lambda time_s: Motion(300.0 + 12.0 * time_s, np.interp(time_s, [0.0, 2.5], y_m), 0.0, 12.0)
    sim.reset(replace(LOW, ego=car("ego", ("road",), begins, 302.3, 12.0), vehicles=tuple(others)), 1)
    sim.hand_over_ego()
    sim.release()
    frame = sim.step()
    emergency = intersect(low.odd, Odd.model_validate({"dynamic": {"behaviour": "emergency"}}))
    adversaries = Adversaries(low, limits_from_odd(emergency, 1.0), frame)  # the script is written for these limits
    row, slot, found, cued = frame.ids.index(id_), 2 * low.adversaries.index(id_), [], None
    for step in range(80):
        x, y = float(frame.x_m[row] - frame.x_m[0]), float(frame.y_m[row] - frame.y_m[0])
        seen = Seen(step * STEP_S, x, y, 1.0, 0.0, float(frame.speed_mps[row]), 12.0)
        cued = step if cued is None and cue(CUT_IN, seen, False) else cued
        action = np.zeros(2 * len(low.adversaries))
        action[slot : slot + 2] = act(CUT_IN, seen, -STEP_S if cued is None else (step - cued) * STEP_S, False)
        adversaries.command(action.tolist(), frame, sim)
        frame = sim.step()
        found.append((float(frame.y_m[0]), float(frame.y_m[row])))
    ego_m, other_m = np.array(found).T
    return ego_m, other_m


@pytest.mark.parametrize(("begins", "ends", "beside"), [(2, 2, 1), (1, 1, 0), (1, 2, 0)])
def test_a_neighbour_cuts_in_to_the_lane_where_the_ego_is(sim, pilot, begins, ends, beside):
    """It does so in any lane, and alike from left and right."""
    ego_m, other_m = cut_in(sim, pilot, begins, ends, beside)
    assert abs(other_m[-1] - ego_m[-1]) < 1.0
    assert abs(other_m[27] - ego_m[27]) > 1.8  # before its cue it is beside the ego
    mirrored_ego_m, mirrored_m = cut_in(sim, pilot, 2 - begins, 2 - ends, 2 - beside)
    np.testing.assert_allclose(mirrored_ego_m, -ego_m)
    np.testing.assert_allclose(mirrored_m, -other_m, atol=0.02)
