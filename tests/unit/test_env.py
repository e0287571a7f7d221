import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from risk_sac.config import FamilyName, RewardConfig, RunSpec
from risk_sac.env import RiskSacEnv, make_default, register_envs
from risk_sac.errors import InfeasibleScene, SceneError
from risk_sac.problem import Problem
from risk_sac.risk.rss import LATERAL_CAP_M, LONGITUDINAL_CAP_M
from risk_sac.scenario.families import FAMILIES
from risk_sac.types import Collision, Scene

NAMES: tuple[FamilyName, ...] = ("low", "mixed", "dense")
each_family = pytest.mark.parametrize("family", NAMES)
Outcome = tuple[np.ndarray, float, bool, bool, dict[str, object]]


@pytest.fixture
def low() -> Iterator[RiskSacEnv]:
    with closing(make_default("low")) as env:
        yield env


def middle(family: FamilyName, **changes: float) -> Scene:
    """The scene in the middle of a family's space, changed."""
    space = FAMILIES[family].space
    scene = space.from_unit(np.full(space.dimension, 0.5))
    return replace(scene, values=dict(scene.values) | changes)


def episode(env: RiskSacEnv, seed: int, action_seed: int = 0, **options: Scene) -> list[Outcome]:
    """Everything a random episode returns, its reset first."""
    generator = np.random.default_rng(action_seed)
    observation, info = env.reset(seed=seed, options=options or None)
    outcomes: list[Outcome] = [(observation, 0.0, False, False, info)]
    while not (outcomes[-1][2] or outcomes[-1][3]):
        outcomes.append(env.step(generator.uniform(-1, 1, env.action_size).astype(np.float32)))
    return outcomes


def same(one: list[Outcome], other: list[Outcome]) -> bool:
    return len(one) == len(other) and all(
        np.array_equal(a[0], b[0]) and a[1:] == b[1:] for a, b in zip(one, other, strict=True)
    )


@each_family
def test_gymnasiums_checker_accepts_the_registered_environment(family: str) -> None:
    register_envs()
    with closing(gym.make(f"RiskSAC/{family.capitalize()}-v0")) as env:
        check_env(env.unwrapped, skip_render_check=True)


def test_registering_twice_is_harmless() -> None:
    register_envs()
    register_envs()
    assert "RiskSAC/Low-v0" in gym.registry


@each_family
def test_the_same_seed_gives_the_same_episode_to_the_last_bit(family: FamilyName) -> None:
    with closing(make_default(family)) as env:
        first = episode(env, 3)
        episode(env, 4, action_seed=1)  # what came before leaves no trace
        again = episode(env, 3)
    with closing(make_default(family)) as env:
        afresh = episode(env, 3)
    assert same(first, again)
    assert same(first, afresh)


@each_family
def test_another_seed_gives_another_episode(family: FamilyName) -> None:
    with closing(make_default(family)) as env:
        assert not same(episode(env, 3), episode(env, 5))


@each_family
def test_one_scene_under_two_seeds_starts_alike_and_then_differs(family: FamilyName) -> None:
    with closing(make_default(family)) as env:
        one, other = (episode(env, seed, scene=middle(family)) for seed in (1, 2))
        assert np.allclose(one[0][0], other[0][0], atol=0.1)  # but for a first step of SUMO's noise
        assert not same(one, other)


@each_family
def test_observations_stay_in_the_space_and_every_number_is_finite(family: FamilyName) -> None:
    with closing(make_default(family)) as env:
        for seed in range(5):
            for observation, reward, _, _, info in episode(env, seed):
                assert env.observation_space.contains(observation)
                assert math.isfinite(reward)
                assert math.isfinite(info["robustness"])  # type: ignore[arg-type]
                assert 0.0 <= info.get("cost", 0.0) <= 1.0  # type: ignore[operator]


@each_family
def test_an_episode_ends_at_the_horizon_or_at_a_contact(family: FamilyName) -> None:
    with closing(make_default(family)) as env:
        for seed in range(6):
            outcomes = episode(env, seed)
            *_, (_, _, terminated, truncated, info) = outcomes
            assert not any(o[2] or o[3] for o in outcomes[:-1])
            assert terminated == ("collision" in info)
            assert truncated == (len(outcomes) - 1 == FAMILIES[family].horizon_steps)


def test_the_time_left_runs_down_to_zero(low: RiskSacEnv) -> None:
    outcomes = episode(low, 0)
    assert outcomes[0][0][-1] == 1.0
    assert outcomes[1][0][-1] == pytest.approx(1 - 1 / 150)


def test_a_scene_whose_bodies_overlap_is_infeasible(low: RiskSacEnv) -> None:
    family = FAMILIES["low"]
    tight = replace(family.space, parameters=tuple(replace(p, low=-100, high=100) for p in family.space.parameters))
    low.problem = replace(low.problem, space=tight)
    with pytest.raises(InfeasibleScene) as overlap:
        low.reset(seed=0, options={"scene": middle("low", lead_gap_m=-2.0)})
    assert overlap.value.reason == "initial_overlap"
    with pytest.raises(InfeasibleScene) as gap:
        low.reset(seed=0, options={"scene": middle("low", lead_gap_m=0.3)})
    assert gap.value.reason == "initial_gap"


def test_a_scene_that_collides_by_itself_is_infeasible(low: RiskSacEnv) -> None:
    scene = middle("low", lead_gap_m=8.0, ego_speed_mps=16.0, lead_speed_mps=6.0)  # 8 m closed at 10 m/s
    with pytest.raises(InfeasibleScene, match="initial_ttc") as error:
        low.reset(seed=0, options={"scene": scene})
    assert error.value.reason == "initial_ttc"


def test_a_refused_scene_leaves_the_environment_usable(low: RiskSacEnv) -> None:
    expected = episode(low, 3)
    with pytest.raises(InfeasibleScene):
        low.reset(seed=0, options={"scene": middle("low", lead_gap_m=8.0, ego_speed_mps=16.0, lead_speed_mps=6.0)})
    assert same(episode(low, 3), expected)


@pytest.mark.parametrize(
    "scene",
    [
        middle("low", lead_gap_m=7.9),
        middle("low", lead_gap_m=math.nan),
        middle("low", moon_phase=0.5),
        middle("mixed"),
    ],
    ids=["out of bounds", "NaN", "unknown parameter", "another family"],
)
def test_a_scene_outside_the_space_is_refused(low: RiskSacEnv, scene: Scene) -> None:
    with pytest.raises(SceneError) as error:
        low.reset(seed=0, options={"scene": scene})
    assert not isinstance(error.value, InfeasibleScene)


def collision_of(outcomes: list[Outcome]) -> Collision | None:
    collision = outcomes[-1][4].get("collision")
    assert collision is None or isinstance(collision, Collision)
    return collision


def first_contacts(env: RiskSacEnv, wanted: int) -> list[list[Outcome]]:
    """Episodes that end in contact, with actions that keep to a manoeuvre."""
    found = []
    for seed in range(200):
        generator, action = np.random.default_rng(seed), np.zeros(env.action_size)
        observation, info = env.reset(seed=seed)
        outcomes: list[Outcome] = [(observation, 0.0, False, False, info)]
        while not (outcomes[-1][2] or outcomes[-1][3]):
            action = np.clip(0.95 * action + 0.3 * generator.standard_normal(len(action)), -1, 1)
            outcomes.append(env.step(action.astype(np.float32)))
        if outcomes[-1][2]:
            found.append(outcomes)
        if len(found) == wanted:
            break
    return found


def reward_by_hand(series: dict[str, np.ndarray], step: int, config: RewardConfig, bonus: float) -> float:
    """R_risk from the recorded time series alone, by the formulas of the paper."""
    ahead = [j for j in range(1, len(series["ids"])) if is_ahead(series, step, j)]
    ttc = min([series["ttc_s"][step, j] for j in ahead], default=10.0)
    along = {j: series["rss_longitudinal_m"][step, j] for j in ahead}
    across = {j: series["rss_lateral_m"][step, j] for j in ahead}
    danger = any(along[j] < 0 and across[j] < 0 for j in ahead)
    return bonus + config.ttc_weight * math.exp(-ttc / config.ttc_scale_s) + config.rss_weight * danger


def is_ahead(series: dict[str, np.ndarray], step: int, j: int) -> bool:
    heading = series["heading_rad"][step, 0]
    dx, dy = (series[c][step, j] - series[c][step, 0] for c in ("x_m", "y_m"))
    return bool(dx * math.cos(heading) + dy * math.sin(heading) > -series["length_m"][0] / 2)


def test_the_reward_is_the_one_computed_by_hand_from_the_recorded_series(low: RiskSacEnv) -> None:
    config = RewardConfig()
    for run in (lambda: episode(low, 1), lambda: first_contacts(low, 1)[0]):
        outcomes = run()
        series = low.trace.series()
        collision = collision_of(outcomes)
        for step, (_, reward, terminated, _, _) in enumerate(outcomes[1:], start=1):
            bonus = 0.0
            if terminated and collision is not None:
                bonus = config.valid_collision if collision.valid else -config.degenerate_collision
            assert reward == pytest.approx(reward_by_hand(series, step, config, bonus), abs=1e-9)


def test_a_contact_pays_its_bonus_only_if_it_is_valid(low: RiskSacEnv) -> None:
    contacts = first_contacts(low, 12)
    valid = [collision_of(o).valid for o in contacts]  # type: ignore[union-attr]
    assert any(valid)
    assert not all(valid)
    for outcomes, is_valid in zip(contacts, valid, strict=True):
        assert outcomes[-1][1] > 9.0 if is_valid else outcomes[-1][1] < -1.0


def test_a_contact_is_recorded_with_its_facts(low: RiskSacEnv) -> None:
    (outcomes,) = first_contacts(low, 1)
    collision, series = collision_of(outcomes), low.trace.series()
    assert collision is not None
    other = series["ids"].tolist().index(collision.other_id)
    assert series["distance_m"][-1, other] == 0.0
    assert 0.0 < collision.time_s <= (len(outcomes) - 1) * 0.1 + 1e-9
    assert collision.ego_speed_mps == pytest.approx(series["speed_mps"][-1, 0])
    assert collision.ego_peak_braking_mps2 == pytest.approx(max(0.0, -series["accel_mps2"][:, 0].min()))
    assert -LONGITUDINAL_CAP_M <= collision.min_rss_margin_m <= LONGITUDINAL_CAP_M
    assert collision.other_role in ("adversary", "background")
    assert len(collision.verdicts) >= 8


@each_family
def test_the_trace_holds_every_frame_of_the_episode(family: FamilyName) -> None:
    with closing(make_default(family)) as env:
        outcomes = episode(env, 2)
        series = env.trace.series()
    assert len(series["time_s"]) == len(outcomes)
    assert series["actions"].shape == (len(outcomes), env.action_size)
    assert np.isnan(series["actions"][0]).all()
    np.testing.assert_allclose(np.diff(series["time_s"]), 0.1)
    np.testing.assert_allclose(series["soft_min"], [o[4]["robustness"] for o in outcomes])
    assert np.nanmax(np.abs(series["rss_lateral_m"])) <= LATERAL_CAP_M
    assert env.min_robustness == series["soft_min"].min()


@each_family
def test_without_control_actions_are_ignored(family: FamilyName) -> None:
    spec = RunSpec(family=family, method="no-adversary", seed=0)
    with closing(RiskSacEnv(Problem.from_spec(spec), spec.learner.reward, controlled=False)) as env:
        scene = middle(family)
        one, other = episode(env, 1, action_seed=1, scene=scene), episode(env, 1, action_seed=2, scene=scene)
        assert same(one, other)
        series = env.trace.series()
    for id_ in FAMILIES[family].pedestrians:
        column = series["ids"].tolist().index(id_)
        assert np.ptp(series["x_m"][:, column]) == 0.0


def test_actions_beyond_the_bounds_count_as_the_bounds(low: RiskSacEnv) -> None:
    def reached(size: float) -> np.ndarray:
        low.reset(seed=1, options={"scene": middle("low")})
        return np.array([low.step(np.full(6, size, dtype=np.float32))[0] for _ in range(10)])

    assert np.array_equal(reached(1.0), reached(7.0))
    assert not np.array_equal(reached(1.0), reached(0.5))


def test_a_closed_environment_can_start_again(low: RiskSacEnv) -> None:
    expected = episode(low, 3)
    low.close()
    assert same(episode(low, 3), expected)
