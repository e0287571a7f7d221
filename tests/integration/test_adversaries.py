"""Adversaries stay physically possible, measured from bodies that SUMO drove."""

from collections.abc import Iterator
from contextlib import closing
from typing import NamedTuple

import numpy as np
import pytest

from risk_sac.config import EgoConfig, FamilyName
from risk_sac.env.env import RiskSacEnv, make_default
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.limits import GRAVITY_MPS2, Limits, limits_from_odd
from risk_sac.sim.control import Adversaries
from risk_sac.sim.sumo import SumoSimulation
from risk_sac.world.geometry import overlapping_pairs
from risk_sac.world.types import STEP_S, Floats, Frame
from tests.builders import moved

ROUNDING = 0.02  # of SUMO's positions and speeds, divided by the step where a derivative is taken
WINDOW = 9  # steps, 0.8 s, over which an acceleration is fitted to positions: SUMO's lanes have corners
EPISODES = 12  # a multiple of four: each way to act
NAMES: tuple[FamilyName, ...] = ("low", "mixed", "dense")


def actions(seed: int, size: int) -> Iterator[Floats]:
    """Yields endless joint actions: uniform, biased, bang-bang or flat out, by seed."""
    g = np.random.default_rng(seed)
    value, bias = np.ones(size), g.uniform(-1, 1, size)
    while True:
        match seed % 4:
            case 0:
                value = g.uniform(-1, 1, size)
            case 1:
                value = np.clip(bias + 0.4 * g.normal(size=size), -1, 1)
            case kind:
                value = np.where(g.random(size) < 0.1, g.choice((-1.0, 1.0), size), value)
                value[::2] = 1.0 if kind == 3 else value[::2]
        yield value


class Driven(NamedTuple):
    """An episode from the release on."""

    limits: Limits
    friction: float
    frames: list[Frame]


def driven(env: RiskSacEnv) -> Driven:
    """The episode that `env` has just ended."""
    problem = env.problem
    friction = problem.family.layout(problem.space.from_unit(env._unit_scene).values).friction
    frames = list(env.trace.frames[-env._steps - 1 :])
    return Driven(limits_from_odd(problem.odd, friction), friction, frames)


def at_random(name: FamilyName) -> list[Driven]:
    episodes = []
    with closing(make_default(name)) as env:
        for seed in range(EPISODES):
            env.reset(seed=seed)
            ended, source = False, actions(seed, env.action_size)
            while not ended:
                _, _, terminated, truncated, _ = env.step(next(source).astype(np.float32))
                assert "inside_limits" not in env._artefacts, seed
                ended = terminated or truncated
            episodes.append(driven(env))
    return episodes


Episodes = tuple[FamilyName, list[Driven]]


@pytest.fixture(scope="module", params=NAMES)
def episodes(request: pytest.FixtureRequest) -> Episodes:
    return request.param, at_random(request.param)


def track(frames: list[Frame], id_: str, name: str) -> Floats:
    """One actor's column over the frames that have it."""
    return np.array([getattr(f, name)[f.ids.index(id_)] for f in frames if id_ in f.ids])


def fitted_acceleration(x: Floats, y: Floats) -> Floats:
    """Amount of the second derivative of parabolas through `WINDOW` positions each."""
    time = (np.arange(WINDOW) - WINDOW // 2) * STEP_S
    weights = 2 * np.linalg.pinv(np.vander(time, 3))[0]
    return np.hypot(np.convolve(x, weights, "valid"), np.convolve(y, weights, "valid"))


def test_no_body_leaves_its_friction_circle(episodes: Episodes) -> None:
    name, all_driven = episodes
    for seed, (_, friction, frames) in enumerate(all_driven):
        for id_ in FAMILIES[name].vehicles:
            x, y = track(frames, id_, "x_m"), track(frames, id_, "y_m")
            if len(x) > WINDOW:
                assert fitted_acceleration(x, y).max() <= friction * GRAVITY_MPS2, (seed, id_)


def test_vehicles_keep_their_limits_along_and_across_the_lane(episodes: Episodes) -> None:
    name, all_driven = episodes
    for seed, (limits, _, frames) in enumerate(all_driven):
        for id_ in FAMILIES[name].vehicles:
            speed, lateral = track(frames, id_, "speed_mps"), track(frames, id_, "lateral_mps")
            accel = np.diff(speed) / STEP_S
            assert np.all((speed >= 0) & (speed <= limits.speed_mps + ROUNDING)), (seed, id_)
            assert np.all((accel <= limits.accel_mps2 + ROUNDING) & (accel >= -limits.brake_mps2 - ROUNDING)), (
                seed,
                id_,
            )
            assert np.all(np.abs(np.diff(accel)) <= limits.jerk_mps3 * STEP_S + ROUNDING), (seed, id_)
            assert np.all(np.abs(lateral[1:]) <= limits.lateral_mps + ROUNDING), (seed, id_)
            assert np.all(np.abs(np.diff(lateral)) / STEP_S <= limits.lateral_accel_mps2 + ROUNDING), (seed, id_)
            assert np.all(np.abs(lateral[1:]) <= limits.slip * speed[1:] + ROUNDING), (seed, id_)


def test_no_body_turns_more_tightly_than_a_car(episodes: Episodes) -> None:
    name, all_driven = episodes
    for seed, (limits, _, frames) in enumerate(all_driven):
        for id_ in FAMILIES[name].vehicles:
            heading = np.unwrap(track(frames, id_, "heading_rad"))
            way = np.concatenate(
                ([0.0], np.cumsum(np.hypot(*(np.diff(track(frames, id_, c)) for c in ("x_m", "y_m")))))
            )
            for start in range(len(way)):
                end = int(np.searchsorted(way, way[start] + 5.0))  # about a car's length
                if end < len(way):
                    tightest = limits.curvature_per_m * (way[end] - way[start])
                    assert abs(heading[end] - heading[start]) <= tightest, (seed, id_)


def test_pedestrians_accelerate_and_turn_as_a_person_can(episodes: Episodes) -> None:
    name, all_driven = episodes
    for seed, (limits, _, frames) in enumerate(all_driven):
        for id_ in FAMILIES[name].pedestrians:
            x, y, speed = (track(frames, id_, column) for column in ("x_m", "y_m", "speed_mps"))
            if len(x) < 3:
                continue
            assert np.hypot(np.diff(x, 2), np.diff(y, 2)).max() / STEP_S**2 <= limits.walk_disc_mps2 + ROUNDING, seed
            assert speed.max() <= limits.walk_speed_mps
            assert np.hypot(np.diff(x), np.diff(y)).max() <= limits.walk_speed_mps * STEP_S + 1e-9
            jerk = np.diff(speed, 2) / STEP_S**2
            assert np.abs(jerk).max() <= limits.walk_jerk_mps3 + ROUNDING
            rate = np.diff(track(frames, id_, "heading_rad")) / STEP_S
            assert np.abs(rate).max() <= limits.heading_rate_radps + 1e-9
            assert np.all(np.maximum(speed[1:], speed[:-1]) * np.abs(rate) <= limits.walk_disc_mps2 + 1e-6)


def test_adversaries_keep_out_of_all_bodies_but_the_egos(episodes: Episodes) -> None:
    # Two adversaries that rush into each other's way cannot always avoid each other, the less the gentler they brake.
    _, all_driven = episodes
    inside = [seed for seed, (_, _, frames) in enumerate(all_driven) if any(map(others_overlap, frames))]
    assert len(inside) <= 2, inside


def others_overlap(frame: Frame) -> bool:
    return any(first > 0 for first, _ in overlapping_pairs(frame.state))


def test_a_vehicle_whose_lane_ends_stops_before_the_end_within_its_limits() -> None:
    end_m, beside_m = 796.0, -7.0  # of lane main_0
    fronts = []
    for _, _, frames in at_random("lane_drop"):
        x, y, length = (track(frames, "merging", name) for name in ("x_m", "y_m", "length_m"))
        fronts += (x + length / 2)[y < beside_m].tolist()
    assert end_m - 10.0 < max(fronts) < end_m


@pytest.mark.parametrize("name", NAMES)
def test_a_vehicle_that_does_not_obey_or_leaps_is_reported(name: FamilyName) -> None:
    family = FAMILIES[name]
    layout = family.layout(family.space.from_unit(np.full(family.space.dimension, 0.5)).values)
    with closing(SumoSimulation(EgoConfig())) as sim:
        frame = sim.reset(layout, 0)
        sim.release()
        adversaries = Adversaries(family, limits_from_odd(family.odd, layout.friction), frame)
        for _ in range(5):
            adversaries.command([1.0, 0.2] * len(family.adversaries), frame, sim)
            frame = sim.step()
            assert adversaries.keep_limits(frame)
        adversaries.command([1.0, 0.2] * len(family.adversaries), frame, sim)
        frame = sim.step()
        for change in ("speed_mps", "vx_mps", "lateral_mps"):
            row = frame.ids.index(family.vehicles[0])
            column = getattr(frame, change).copy()
            column[row] += 30.0 if column[row] >= 0 else -30.0
            assert not adversaries.keep_limits(moved(frame, **{change: column})), change
            adversaries.keep_limits(frame)
