"""Each ODD field acts or is refused; weather, light, trucks limit sight."""

from collections.abc import Mapping
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from risk_sac.config import Odd, RunSpec
from risk_sac.env.env import RiskSacEnv, make_default
from risk_sac.errors import InfeasibleScene, OddError
from risk_sac.scenario.limits import LOW_BEAM_M
from risk_sac.scenario.odd import paths
from risk_sac.world.types import STEP_S, Frame, Kind, Scene

BRAKE, STEPS = -1.0, 60
FOG_M, CLEAR_M = 40.0, 2000.0
EGOS: list[dict[str, Any]] = [
    {},
    {"profile": "careful"},
    {"profile": "perfect"},
    {"driver": "idm-aeb"},
    {"driver": "rss", "sensor": {"range_m": 200.0}},
]
each_ego = pytest.mark.parametrize("ego", EGOS, ids=lambda ego: ego.get("driver", ego.get("profile", "default")))


def play(
    family: str, environment: Mapping[str, Any], ego: Mapping[str, Any], **changes: float
) -> list[tuple[Frame, np.ndarray]]:
    """Frames of an episode with braking adversaries, and actors seen in each."""
    spec = RunSpec.model_validate(
        {"family": family, "method": "random", "seed": 0, "ego": ego, "odd": {"environment": environment}}
    )
    with closing(RiskSacEnv.of(spec)) as env:
        middle = env.problem.space.from_unit(np.full(env.problem.space.dimension, 0.5))
        env.reset(seed=3, options={"scene": Scene(family, {**middle.values, **changes})})
        for _ in range(STEPS):
            *_, terminated, _, _ = env.step(np.tile(np.float32([BRAKE, 0.0]), env.action_size // 2))
            if terminated:
                break
        seen = [each.assessment.seen.copy() for each in env.trace.measures]
        return list(zip(env.trace.frames, seen, strict=True))


def distances(frame: Frame) -> np.ndarray:
    return np.hypot(frame.x_m[1:] - frame.x_m[0], frame.y_m[1:] - frame.y_m[0])


@each_ego
def test_nothing_is_seen_beyond_the_visibility_of_the_scene_and_the_ego_brakes_later(ego: dict[str, Any]) -> None:
    stated = {"visibility_m": {"low": FOG_M, "high": CLEAR_M}}
    fog, clear = (play("low", stated, ego, lead_gap_m=50, visibility_m=each_m) for each_m in (FOG_M, CLEAR_M))
    far = [(frame, seen) for frame, seen in fog if (distances(frame) > FOG_M).any()]
    assert far
    assert not any(seen[distances(frame) > FOG_M].any() for frame, seen in far)
    assert any(seen[distances(frame) > FOG_M].any() for frame, seen in clear)
    behind = [[frame.x_m[0] for frame, _ in played] for played in (fog, clear)]
    assert behind[0] != behind[1]


@pytest.mark.parametrize("driver", [{}, {"driver": "rss"}])
def test_at_night_pedestrians_beyond_the_low_beam_are_not_seen(driver: dict[str, Any]) -> None:
    ego = driver | {"sensor": {"occlusion": False}}  # else the truck hides the pedestrian by day, too
    changes = {"ego_distance_m": 80.0, "occluder_distance_m": 25.0, "pedestrian_speed_mps": 1.0}
    stated = {"time_of_day": ["day", "night"]}
    night, day = (play("mixed", stated, ego, night=night, **changes) for night in (1.0, 0.0))

    def sees_a_far_pedestrian(played: list[tuple[Frame, np.ndarray]]) -> bool:
        return any(
            (seen & (frame.kind[1:] == Kind.PEDESTRIAN) & (distances(frame) > LOW_BEAM_M)).any()
            for frame, seen in played
        )

    assert sees_a_far_pedestrian(day)
    assert not sees_a_far_pedestrian(night)
    assert any(seen[distances(frame) > LOW_BEAM_M].any() for frame, seen in night)  # vehicles carry lights


def test_heavy_rain_makes_the_road_slippery() -> None:
    spec = RunSpec.model_validate(
        {
            "family": "low",
            "method": "random",
            "seed": 0,
            "odd": {"environment": {"precipitation": ["heavy_rain"]}},
        }
    )
    with closing(RiskSacEnv.of(spec)) as env:
        env.reset(seed=0)
        assert 0.4 <= env.layout.friction <= 0.55
        [braking] = [each.formula for each in env.problem.requirements if each.name == "bounded_braking"]
        assert braking.endswith(">= 3.53)")  # 0.9 · 0.4 · 9.81


NARROWER = {
    "scenery.lanes": {"low": 4, "high": 5},
    "scenery.speed_limit_mps": {"low": 1, "high": 9},
    "scenery.signal_types": ["fixed_time"],
    "scenery.crossing_types": ["signalised"],
    "environment.friction": {"low": 0.4, "high": 0.5},
    "environment.visibility_m": {"low": 40, "high": 60},
    "environment.precipitation": ["heavy_rain"],
    "environment.time_of_day": ["night"],
    "dynamic.actor_kinds": ["vehicle"],
    "dynamic.ego_speed_mps": {"low": 7, "high": 9},
    "dynamic.vehicle_speed_mps": {"low": 0, "high": 4},
    "dynamic.vehicle_accel_mps2": {"low": -2, "high": 1},
    "dynamic.vehicle_lateral_speed_mps": {"low": 0, "high": 0.3},
    "dynamic.vehicle_lateral_accel_mps2": {"low": 0, "high": 0.3},
    "dynamic.pedestrian_speed_mps": {"low": 0, "high": 0.5},
    "dynamic.pedestrian_accel_mps2": {"low": -0.3, "high": 0.3},
    "dynamic.pedestrian_turn_radps": {"low": 0, "high": 0.2},
    "dynamic.vehicle_jerk_mps3": {"low": 0, "high": 3},
    "dynamic.behaviour": "emergency",
}
SEEDS = range(4)
REFUSED = ("scenery.lanes", "scenery.speed_limit_mps", "dynamic.actor_kinds")


def episodes(odd: Mapping[str, Any]) -> bytes:
    """Positions and seen actors, with the same seeds, actions and unit points."""
    ego = {"sensor": {"occlusion": False}}
    spec = RunSpec.model_validate({"family": "mixed", "method": "random", "seed": 0, "odd": odd, "ego": ego})
    played = b""
    with closing(RiskSacEnv.of(spec)) as env:
        for seed in SEEDS:
            draw, actions = np.random.default_rng(seed), np.random.default_rng(seed)
            try:
                env.reset(
                    seed=seed,
                    options={"scene": env.problem.space.from_unit(draw.random(env.problem.space.dimension))},
                )
            except InfeasibleScene:
                continue
            for _ in range(40):
                *_, terminated, _, _ = env.step(actions.uniform(-1, 1, env.action_size).astype(np.float32))
                if terminated:
                    break
            played += b"".join(frame.x_m.tobytes() + frame.y_m.tobytes() for frame in env.trace.frames)
            played += b"".join(each.assessment.seen.tobytes() for each in env.trace.measures)
    return played


@pytest.fixture(scope="module")
def usual() -> bytes:
    return episodes({})


def test_there_is_a_narrower_value_of_each_field() -> None:
    assert set(NARROWER) == set(paths(Odd()))


@pytest.mark.parametrize("path", NARROWER)
def test_each_field_of_an_odd_acts_or_is_refused(path: str, usual: bytes) -> None:
    branch, name = path.split(".")
    odd = {branch: {name: NARROWER[path]}}
    if path in REFUSED:
        with pytest.raises(OddError) as refused:
            episodes(odd)
        assert refused.value.field == f"odd.{path}"
    else:
        assert episodes(odd) != usual


SCENES, WATCHED_STEPS = 40, 80
HIDDEN_S = 0.5
NEAR_M, FAR_M = 3.0, 45.0  # between the ego and the pedestrian, along the road


def test_a_pedestrian_is_hidden_in_half_of_the_mixed_scenes_though_nobody_attacks() -> None:
    """For half a second or more while the ego comes near."""
    draw = np.random.default_rng(5)
    hidden = count = 0
    with closing(make_default("mixed")) as env:
        space, idle = env.problem.space, np.zeros(env.action_size, dtype=np.float32)
        for seed in range(SCENES):
            try:
                env.reset(seed=seed, options={"scene": space.from_unit(draw.random(space.dimension))})
            except InfeasibleScene:
                continue
            count += 1
            unseen = 0
            for _ in range(WATCHED_STEPS):
                *_, terminated, _, _ = env.step(idle)
                frame, seen = env.trace.frames[-1], env.trace.measures[-1].assessment.seen
                walker = frame.ids.index("pedestrian")
                ahead_m = frame.x_m[walker] - frame.x_m[0]
                unseen += bool(NEAR_M < ahead_m < FAR_M and not seen[walker - 1])
                if terminated:
                    break
            hidden += unseen * STEP_S >= HIDDEN_S - 1e-9
    print(f"hidden in {hidden} of {count} scenes")
    assert hidden >= 0.5 * count
