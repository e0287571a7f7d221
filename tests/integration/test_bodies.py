"""Every row of the table of bodies, spawned, driven, seen and respected."""

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from risk_sac.config import EgoConfig, RewardConfig, RunSpec, SensorConfig
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.scenario.bodies import BODIES, BodyName, body_of
from risk_sac.scenario.layout import Layout, PedestrianStart, StaticStart, VehicleStart
from risk_sac.scenario.limits import limits_from_odd
from risk_sac.world.types import Frame, Role

ROUTE = ("e1", "e2", "e3")  # of the mixed family's net: two lanes, middles at y = -4.95 and -1.65, kerb at -6.6
RIGHT_Y_M, KERB_Y_M = -4.95, -6.6
STEPS = 30
LANES = [name for name, body in BODIES.items() if "lanes" in body.moves]
FREELY = [name for name, body in BODIES.items() if "freely" in body.moves]


def problem_with(
    vehicles: Sequence[VehicleStart] = (),
    pedestrians: Sequence[PedestrianStart] = (),
    statics: Sequence[StaticStart] = (),
    ego: EgoConfig | None = None,
) -> Problem:
    """Problem of mixed with other actors; the ego drives at 10 m/s."""
    base = Problem.from_spec(RunSpec(family="mixed", method="random", seed=0, ego=ego or EgoConfig()))
    start = VehicleStart(id="ego", role=Role.EGO, route=ROUTE, lane=1, position_m=100.0, speed_mps=10.0)

    def layout(xi: dict[str, float]) -> Layout:
        actors = {"vehicles": tuple(vehicles), "pedestrians": tuple(pedestrians), "statics": tuple(statics)}
        return replace(base.family.layout(xi), ego=start, **actors)

    ids = {"vehicles": tuple(v.id for v in vehicles), "pedestrians": tuple(p.id for p in pedestrians)}
    return replace(base, family=replace(base.family, layout=layout, **ids))


def played(problem: Problem, steps: int = STEPS, action: Sequence[float] = ()) -> list[Frame]:
    with closing(RiskSacEnv(problem, RewardConfig())) as env:
        env.reset(seed=1)
        for _ in range(steps):
            _, _, terminated, _, _ = env.step(np.array(action, dtype=np.float32))
            if terminated:
                break
        assert "inside_limits" not in env._artefacts
        series = env.trace.series()
        assert [body_of(code).name for code in series["body"]] == [
            body_of(code).name for code in env.trace.frames[0].body
        ]
        return list(env.trace.frames)


def in_lane(name: BodyName) -> VehicleStart:
    return VehicleStart(
        id="other", role=Role.ADVERSARY, route=ROUTE, lane=2, position_m=130.0, speed_mps=6.0, body=name
    )


def standing(name: BodyName, y_m: float, heading_rad: float = 0.0, x_m: float = 200.0) -> StaticStart:
    return StaticStart(id="thing", x_m=x_m, y_m=y_m, heading_rad=heading_rad, body=name)


def check_row(frame: Frame, name: BodyName) -> None:
    body = BODIES[name]
    assert body_of(int(frame.body[-1])) == body
    assert (frame.length_m[-1], frame.width_m[-1]) == (body.length_m, body.width_m)


@pytest.mark.parametrize("name", LANES)
def test_a_body_in_a_lane_has_its_rows_size_and_keeps_its_rows_limits(name):
    problem = problem_with(vehicles=[in_lane(name)])
    frames = played(problem, action=(1.0, 0.0))
    limits = limits_from_odd(problem.odd, 0.6).of(BODIES[name])
    check_row(frames[-1], name)
    assert frames[-1].speed_mps[-1] > 8.0 or name == "bicycle"
    assert max(frame.speed_mps[-1] for frame in frames) <= limits.speed_mps + 0.02
    assert max(frame.accel_mps2[-1] for frame in frames[16:]) <= limits.accel_mps2 + 0.05


@pytest.mark.parametrize("name", FREELY)
@pytest.mark.parametrize("side", [-1, 1])
def test_a_body_that_crosses_keeps_its_rows_limits_from_either_side(name, side):
    start = PedestrianStart(
        id="walker",
        role=Role.ADVERSARY,
        x_m=150.0,
        y_m=side * 12.0,
        heading_rad=-side * math.pi / 2,
        speed_mps=1.0,
        body=name,
    )
    problem = problem_with(pedestrians=[start])
    frames = played(problem, action=(1.0, 1.0 * side))
    limits = limits_from_odd(problem.odd, 1.0).of(BODIES[name])
    check_row(frames[-1], name)
    assert abs(frames[-1].y_m[-1]) < 10.0
    assert max(frame.speed_mps[-1] for frame in frames) <= limits.walk_speed_mps + 1e-9
    released = frames[16:]
    for before, after in pairwise(released):
        driven_m = math.hypot(after.x_m[-1] - before.x_m[-1], after.y_m[-1] - before.y_m[-1])
        turned = abs(after.heading_rad[-1] - before.heading_rad[-1])
        assert turned <= limits.walk_curvature_per_m * max(driven_m, 0.1 * after.speed_mps[-1]) * 1.1 + 1e-9


def test_a_bicycle_that_stands_does_not_turn():
    start = PedestrianStart(
        id="walker", role=Role.ADVERSARY, x_m=150.0, y_m=-12.0, heading_rad=1.0, speed_mps=0.0, body="bicycle"
    )
    frames = played(problem_with(pedestrians=[start]), action=(-1.0, 1.0))
    assert {frame.heading_rad[-1] for frame in frames} == {1.0}


@pytest.mark.parametrize("name", list(BODIES))
def test_sumos_ego_does_not_touch_a_body_that_stands_askew_in_its_lane(name):
    frames = played(problem_with(statics=[standing(name, RIGHT_Y_M, 0.8)]), steps=120)
    last = frames[-1]
    check_row(last, name)
    assert (last.x_m[-1], last.y_m[-1], last.heading_rad[-1]) == (200.0, RIGHT_Y_M, 0.8)
    assert last.role[-1] == Role.STATIC
    assert last.x_m[0] + last.length_m[0] / 2 < 200.0
    assert last.speed_mps[0] < 1.0


@pytest.mark.parametrize("name", ["van", "truck", "car"])
def test_sumos_ego_changes_lanes_round_a_body_along_its_lane(name):
    last = played(problem_with(statics=[standing(name, RIGHT_Y_M)]), steps=120)[-1]
    assert last.x_m[0] > 200.0 + last.length_m[-1]
    assert last.y_m[0] > -3.3


@pytest.mark.parametrize("name", list(BODIES))
def test_sumos_ego_passes_a_body_that_is_parked_beside_the_road(name):
    y_m = KERB_Y_M - BODIES[name].width_m / 2 - 0.2
    assert played(problem_with(statics=[standing(name, y_m)]), steps=120)[-1].x_m[0] > 220.0


@pytest.mark.parametrize("name", list(BODIES))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_body_hides_what_is_behind_it_if_its_row_says_so(name, side):
    sensor = EgoConfig(sensor=SensorConfig(range_m=100.0))
    slope, from_m = 8.0 / 35.3, 114.7  # of the line of sight, and where the ego's centre is at the release
    middle = standing(name, RIGHT_Y_M + side * 8.0, side * math.atan(slope) + math.pi / 2, x_m=150.0)
    behind = replace(middle, id="walker", x_m=162.0, y_m=RIGHT_Y_M + side * slope * (162.0 - from_m), body="child")
    problem = problem_with(statics=[middle, behind], ego=sensor)
    with closing(RiskSacEnv(problem, RewardConfig())) as env:
        env.reset(seed=1)
        assert env._perception.seen.tolist() == [True, not BODIES[name].conceals]
