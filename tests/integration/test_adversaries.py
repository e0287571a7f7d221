"""Adversaries that can exist on a road, measured from the bodies that SUMO drove."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import FamilyName
from risk_sac.env import RiskSacEnv, make_default
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.limits import GRAVITY_MPS2, Limits, limits_from_odd
from risk_sac.types import STEP_S, Floats, Frame

ROUNDING = 0.02  # of SUMO's positions and speeds, divided by the step where a derivative is taken
WINDOW = 9  # steps, 0.8 s, over which an acceleration is fitted to positions: SUMO's lanes have corners
EPISODES = 20
NAMES: tuple[FamilyName, ...] = ("low", "mixed", "dense")
each_family = pytest.mark.parametrize("name", NAMES)


def actions(seed: int, size: int) -> Iterator[Floats]:
    """Endless joint actions: uniform, drawn to a bias, bang-bang, or flat out, by turns."""
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


def drive(env: RiskSacEnv, seed: int) -> tuple[float, list[Frame]]:
    """Friction, and the frames from the release on; not only until the first contact, for the control does not stop."""
    env.reset(seed=seed)
    source, steps = actions(seed, env.action_size), env.problem.family.horizon_steps
    for _ in range(steps):
        env.step(next(source).astype(np.float32))
        assert env._inside_limits, seed
    friction = env.problem.family.layout(env.problem.space.from_unit(env._unit_scene).values).friction
    return friction, list(env.trace.frames[-steps - 1 :])


@pytest.fixture(scope="module", params=NAMES)
def episodes(request: pytest.FixtureRequest) -> tuple[FamilyName, list[tuple[Limits, float, list[Frame]]]]:
    family = FAMILIES[request.param]
    with closing(make_default(request.param)) as env:
        driven = [drive(env, seed) for seed in range(EPISODES)]
    return request.param, [(limits_from_odd(family.odd, friction), friction, frames) for friction, frames in driven]


def track(frames: list[Frame], id_: str, name: str) -> Floats:
    """One actor's column over the frames that have it."""
    return np.array([getattr(f, name)[f.ids.index(id_)] for f in frames if id_ in f.ids])


def fitted_acceleration(x: Floats, y: Floats) -> Floats:
    """Amount of the second derivative of parabolas through `WINDOW` positions each."""
    time = (np.arange(WINDOW) - WINDOW // 2) * STEP_S
    weights = 2 * np.linalg.pinv(np.vander(time, 3))[0]
    return np.hypot(np.convolve(x, weights, "valid"), np.convolve(y, weights, "valid"))


Episodes = tuple[FamilyName, list[tuple[Limits, float, list[Frame]]]]


def test_no_body_leaves_its_friction_circle(episodes: Episodes) -> None:
    name, driven = episodes
    for seed, (_, friction, frames) in enumerate(driven):
        for id_ in FAMILIES[name].vehicles:
            x, y = track(frames, id_, "x_m"), track(frames, id_, "y_m")
            if len(x) > WINDOW:
                assert fitted_acceleration(x, y).max() <= friction * GRAVITY_MPS2, (seed, id_)


def test_vehicles_keep_their_limits_along_and_across_the_lane(episodes: Episodes) -> None:
    name, driven = episodes
    for seed, (limits, _, frames) in enumerate(driven):
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
    name, driven = episodes
    for seed, (limits, _, frames) in enumerate(driven):
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
    name, driven = episodes
    for seed, (limits, _, frames) in enumerate(driven):
        for id_ in FAMILIES[name].pedestrians:
            x, y, speed = (track(frames, id_, column) for column in ("x_m", "y_m", "speed_mps"))
            assert np.hypot(np.diff(x, 2), np.diff(y, 2)).max() / STEP_S**2 <= limits.walk_disc_mps2 + ROUNDING, seed
            assert speed.max() <= limits.walk_speed_mps
            assert np.hypot(np.diff(x), np.diff(y)).max() <= limits.walk_speed_mps * STEP_S + 1e-9
            jerk = np.diff(speed, 2) / STEP_S**2
            assert np.abs(jerk).max() <= limits.walk_jerk_mps3 + ROUNDING
            rate = np.diff(track(frames, id_, "heading_rad")) / STEP_S
            assert np.abs(rate).max() <= limits.heading_rate_radps + 1e-9
            assert np.all(np.maximum(speed[1:], speed[:-1]) * np.abs(rate) <= limits.walk_disc_mps2 + 1e-6)
