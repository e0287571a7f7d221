import math
from contextlib import closing
from dataclasses import replace
from itertools import combinations

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from shapely import Point, Polygon
from shapely import box as shapely_box
from shapely.affinity import rotate, translate

from risk_sac.config import FamilyName, RewardConfig, RunSpec
from risk_sac.env.env import RiskSacEnv, make_default
from risk_sac.env.problem import Problem
from risk_sac.errors import InfeasibleScene
from risk_sac.records import Collision, Grade, Severity
from risk_sac.risk.rss import time_to_encounter
from risk_sac.scenario.families import FAMILIES
from risk_sac.scenario.reading import shipped_names
from risk_sac.world.geometry import relative_view
from risk_sac.world.types import Frame, Kind, Scene
from tests.unit.env.episodes import Outcome, episode, same

NAMES: tuple[FamilyName, ...] = ("low", "mixed", "dense")
LEAD_IN_STEPS = 15
each_family = pytest.mark.parametrize("family", NAMES)


@pytest.fixture
def low():
    with closing(make_default("low")) as env:
        yield env


def middle(family: FamilyName, **changes: float) -> Scene:
    """The scene in the middle of a family's space, changed."""
    space = FAMILIES[family].space
    scene = space.from_unit(np.full(space.dimension, 0.5))
    return replace(scene, values=dict(scene.values) | changes)


@each_family
def test_gymnasiums_checker_accepts_the_registered_environment(family):
    with closing(gym.make(f"RiskSAC/{family.capitalize()}-v0", render_mode="rgb_array")) as env:
        check_env(env.unwrapped, skip_render_check=True)  # which opens a second one; libsumo has one simulation


def test_every_shipped_scenario_is_registered():
    registered = {spec.kwargs.get("family") for id_, spec in gym.registry.items() if id_.startswith("RiskSAC/")}
    assert registered == set(shipped_names())
    assert gym.spec("RiskSAC/MotorwayCutIn-v0").kwargs == {"family": "motorway_cut_in"}


@each_family
def test_the_same_seed_gives_the_same_episode_to_the_last_bit(family):
    with closing(make_default(family)) as env:
        first = episode(env, 3)
        episode(env, 4, action_seed=1)  # what came before leaves no trace
        again = episode(env, 3)
    with closing(make_default(family)) as env:
        afresh = episode(env, 3)
    assert same(first, again)
    assert same(first, afresh)


@each_family
def test_every_number_is_finite_and_an_episode_ends_at_the_horizon_or_at_a_contact(family):
    with closing(make_default(family)) as env:
        for seed in range(5):
            outcomes = episode(env, seed)
            for observation, reward, _, _, info in outcomes:
                assert env.observation_space.contains(observation)
                assert math.isfinite(reward)
                assert math.isfinite(info["robustness"])
                assert 0.0 <= info.get("cost", 0.0) <= 1.0
            *_, (_, _, terminated, truncated, info) = outcomes
            assert terminated == ("collision" in info)
            assert truncated == (len(outcomes) - 1 == FAMILIES[family].horizon_steps)


def refusal(env: RiskSacEnv, scene: Scene) -> str | None:
    """The rule of C_hard that a scene breaks."""
    try:
        env.reset(seed=0, options={"scene": scene})
    except InfeasibleScene as error:
        return error.reason
    return None


# In the second and a half before the release the ego brakes for actors that it sees: the conflict left then counts.
STANDING = {"ego_speed_mps": 0.0, "lead_speed_mps": 0.0}
TOWARDS_STANDING = {"ego_speed_mps": 16.0, "lead_speed_mps": 0.0}
LEADERS: list[tuple[dict[str, float], str | None]] = [
    ({"lead_gap_m": -2.0, **STANDING}, "initial_overlap"),
    ({"lead_gap_m": 0.3, **STANDING}, "initial_gap"),
    ({"lead_gap_m": 0.7, **STANDING}, None),
    ({"lead_gap_m": 15.0, **TOWARDS_STANDING}, "initial_overlap"),  # it has run into the leader by then
    ({"lead_gap_m": 20.0, **TOWARDS_STANDING}, "initial_ttc"),  # 1.95 m ahead at 4.9 m/s, still braking
    ({"lead_gap_m": 8.0, "ego_speed_mps": 16.0, "lead_speed_mps": 6.0}, "initial_rss"),  # 0.96 m behind 6 m/s
    ({"lead_gap_m": 30.0, **TOWARDS_STANDING}, "initial_conflict"),  # braking, with a TTC below 2 s
    ({"lead_gap_m": 60.0, **TOWARDS_STANDING}, None),
]


@pytest.mark.parametrize(("changes", "rule"), LEADERS, ids=[f"{c['lead_gap_m']} m, {r}" for c, r in LEADERS])
def test_a_scene_is_refused_by_what_it_has_come_to_at_the_release(low, changes, rule):
    family = FAMILIES["low"]
    wide = replace(family.space, parameters=tuple(replace(p, low=-100, high=100) for p in family.space.parameters))
    low.problem = replace(low.problem, space=wide)
    assert refusal(low, middle("low", **changes)) == rule


@each_family
def test_hardly_a_random_scene_has_bodies_that_overlap_before_the_release(family):
    generator = np.random.default_rng(5)
    with closing(make_default(family)) as env:
        space = env.problem.space
        reasons = [refusal(env, space.from_unit(generator.random(space.dimension))) for _ in range(100)]
    assert reasons.count("initial_overlap") <= 1
    assert sum(reason is not None for reason in reasons) <= 10


def test_a_scene_is_refused_by_bodies_that_overlap_at_its_start_although_they_part_before_the_release(low):
    parameters = FAMILIES["low"].space.parameters
    low.problem = replace(
        low.problem,
        space=replace(low.problem.space, parameters=tuple(replace(p, low=-100, high=100) for p in parameters)),
    )
    inside = {"follower_gap_m": -1.0, "lead_gap_m": 60.0, "lead_speed_mps": 14.0}
    with pytest.raises(InfeasibleScene, match=r"initial_overlap by 'ego' and 'follower'") as refused:
        low.reset(seed=0, options={"scene": middle("low", **inside)})
    assert refused.value.reason == "initial_overlap"
    assert refusal(low, middle("low", **inside | {"follower_gap_m": 5.0})) is None


# Ego at 12.6 m/s, 30 m before the zebra; the pedestrian at the kerb, at 1.4 m/s: both are there in three seconds.
MEETING = {
    "crossing": 0.0,
    "ego_speed_mps": 10.0,
    "ego_distance_m": 30.0,
    "occluder_distance_m": 25.0,
    "occluder_speed_mps": 5.0,
    "pedestrian_offset_m": 0.0,
    "pedestrian_setback_m": 0.3,
    "pedestrian_speed_mps": 1.4,
    "friction": 1.0,
}


@pytest.mark.parametrize(
    ("changes", "rule"),
    [
        ({}, "initial_conflict"),
        ({"ego_distance_m": 38.0, "pedestrian_setback_m": 1.3}, "initial_conflict"),
        ({"ego_distance_m": 38.0, "pedestrian_setback_m": 1.5}, None),
        ({"pedestrian_speed_mps": 0.0}, None),
        ({"ego_distance_m": 25.0, "pedestrian_speed_mps": 0.8}, None),
        ({"occluder_distance_m": 10.0}, None),
    ],
    ids=["at the kerb", "0.9 s from it", "1.1 s from it", "standing", "more than 1 s behind the ego by then", "hidden"],
)
def test_a_scene_is_refused_if_the_careful_driver_already_sees_a_pedestrian_coming(changes, rule):
    with closing(make_default("mixed")) as env:
        assert refusal(env, middle("mixed", **(MEETING | changes))) == rule


def test_a_refused_scene_leaves_the_environment_usable(low):
    expected = episode(low, 3)
    assert refusal(low, middle("low", lead_gap_m=8.0, ego_speed_mps=16.0, lead_speed_mps=6.0)) == "initial_rss"
    assert same(episode(low, 3), expected)


@each_family
def test_scenes_that_are_let_in_are_plausible_and_fair(family):
    with closing(make_default(family)) as env:
        for seed in range(30):
            env.reset(seed=seed)
            (frame, measures), released = (env.trace.frames[-1], env.trace.measures[-1]), env.trace.released
            boxes = [box(*pose) for pose in zip(*bodies(frame), strict=True)]
            apart = [a.distance(b) for a, b in combinations(boxes, 2)]
            assert min(apart) > 0.0, seed
            assert min(boxes[0].distance(other) for other in boxes[1:]) >= 0.5, seed
            assert measures.signals["ttc_s"] >= 1.0, seed
            assert released == len(env.trace.frames) - 1 == LEAD_IN_STEPS
            for row in np.flatnonzero(frame.kind == Kind.PEDESTRIAN):
                place = Point(frame.x_m[row], frame.y_m[row])
                layout = FAMILIES[family].layout(env.problem.space.from_unit(env._unit_scene).values)
                assert not any(a.contains(place.x, place.y) for a in layout.roadway), seed


def bodies(frame: Frame) -> tuple[np.ndarray, ...]:
    return frame.x_m, frame.y_m, frame.heading_rad, frame.length_m, frame.width_m


def box(x: float, y: float, heading: float, length: float, width: float) -> Polygon:
    turned = rotate(shapely_box(-length / 2, -width / 2, length / 2, width / 2), heading, (0, 0), use_radians=True)
    return translate(turned, x, y)


@each_family
def test_nobody_attacks_before_the_release(family):
    with closing(make_default(family)) as env:
        starts = []
        for action in (-1.0, 1.0):
            env.reset(seed=4)
            env.step(np.full(env.action_size, action, dtype=np.float32))
            starts.append(env.trace.frames[: LEAD_IN_STEPS + 1])
        for one, other in zip(*starts, strict=True):
            assert all(map(np.array_equal, bodies(one), bodies(other)))
        frames = starts[0]
    layout = FAMILIES[family].layout(env.problem.space.from_unit(env._unit_scene).values)
    for walker in layout.pedestrians:
        row = frames[0].ids.index(walker.id)
        moved_m = walker.speed_mps * 1.5
        expected = (
            walker.x_m + moved_m * math.cos(walker.heading_rad),
            walker.y_m + moved_m * math.sin(walker.heading_rad),
        )
        assert (frames[-1].x_m[row], frames[-1].y_m[row]) == pytest.approx(expected)


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
    """Computes R_risk from recorded series alone, by the paper's formulas."""
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


def test_the_reward_is_the_one_computed_by_hand_from_the_recorded_series(low):
    config = RewardConfig()
    for run in (lambda: episode(low, 1), lambda: first_contacts(low, 1)[0]):
        outcomes = run()
        series = low.trace.series()
        collision = collision_of(outcomes)
        for step, (_, reward, terminated, _, _) in enumerate(outcomes[1:], start=1):
            bonus = 0.0
            if terminated and collision is not None and not collision.valid:
                bonus = -config.degenerate_collision
            elif terminated and collision is not None:
                shares = {
                    Grade.PREVENTABLE: 1.0,
                    Grade.FULL_BRAKING: config.unpreventable,
                    Grade.UNAVOIDABLE: config.unavoidable,
                }
                worth = shares[collision.judgement.grade]
                worth *= config.minor if collision.severity is Severity.MINOR else 1.0
                bonus = worth * config.valid_collision
            at = LEAD_IN_STEPS + step
            assert reward == pytest.approx(reward_by_hand(series, at, config, bonus), abs=1e-9)


@each_family
def test_sumo_is_asked_about_vehicles_alone_and_early_conflicts_are_artefacts(family):
    with closing(make_default(family)) as env:
        collisions = [c for c in map(collision_of, first_contacts(env, 1)) if c is not None]
    assert collisions
    for collision in collisions:
        assert (collision.simulator_agrees is None) == (collision.other_kind == "pedestrian")
        began_s = collision.judgement.conflict_s
        assert began_s <= collision.time_s + 0.1
        noticed_s = collision.judgement.noticed_s
        assert noticed_s <= began_s
        assert collision.verdicts["conflict_after_release"] == (noticed_s >= 1.0 - 1e-6)
        assert collision.artefact or collision.verdicts["conflict_after_release"]


@each_family
def test_without_control_actions_are_ignored(family):
    spec = RunSpec(family=family, method="no-adversary", seed=0)
    with closing(RiskSacEnv(Problem.from_spec(spec), spec.learner.reward, controlled=False)) as env:
        scene = middle(family)
        one, other = episode(env, 1, action_seed=1, scene=scene), episode(env, 1, action_seed=2, scene=scene)
        assert same(one, other)
        series = env.trace.series()
    for id_ in FAMILIES[family].pedestrians:
        column = series["ids"].tolist().index(id_)
        assert np.ptp(series["x_m"][LEAD_IN_STEPS:, column]) == 0.0
        assert np.ptp(series["y_m"][LEAD_IN_STEPS:, column]) == 0.0


@pytest.mark.parametrize(
    "action",
    [
        np.full(6, np.nan),
        np.array([0, 0, 0, 0, 0, np.inf]),
        np.zeros((1, 6)),
        None,
        np.array(["0"] * 6),
        np.zeros(6, dtype=complex),
        [0.0, [0.0], 0.0],
        [10**400] * 6,
        torch.zeros(6, requires_grad=True),
    ],
    ids=lambda action: repr(action)[:30],
)
def test_an_action_that_is_none_is_refused_and_the_episode_goes_on(low, action):
    expected = episode(low, 3)
    low.reset(seed=3)
    with pytest.raises(ValueError, match=r"^action: got .*; wanted shape \(6,\), finite numbers in \[-1, 1\]$"):
        low.step(action)
    generator = np.random.default_rng(0)
    assert low.step(generator.uniform(-1, 1, 6).astype(np.float32))[1] == expected[1][1]


def test_the_nearest_miss_is_the_least_time_to_encounter_while_ahead_and_in_sight_and_the_ego_on_the_move(low):
    frames = counted = 0
    for seed in range(6):
        episode(low, seed)
        series, released = low.trace.series(), low.trace.released
        least = {}
        for i, name in enumerate(series["ids"][1:], start=1):
            ahead = series["x_m"][released:, i] > series["x_m"][released:, 0]  # the road leads straight to the east
            seen, moves = series["visible"][released:, i] == 1, series["speed_mps"][released:, 0] >= 1.0
            counts = ahead & seen & moves
            frames, counted = frames + len(counts), counted + counts.sum()
            times_s = [
                time_to_encounter(relative_view(frame), frame.kind[1:] == Kind.PEDESTRIAN)[frame.ids.index(name) - 1]
                for frame, count in zip(low.trace.frames[released:], counts, strict=True)
                if count
            ]
            if times_s:
                least[name] = min(times_s)
        assert low.trace.encounters_s(series["ids"]) == least
    assert 0.1 < counted / frames < 0.9
