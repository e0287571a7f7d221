"""Egos that change lanes or leave the road, in real episodes."""

from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.execution.evaluate import run
from risk_sac.records import EpisodeRecord, Outcome
from risk_sac.world.types import Frame

pytestmark = pytest.mark.usefixtures("steering_egos")
LANES_Y_M = np.array([-3.3, 0.0, 3.3])  # middles of the lanes of low; the ego begins in the second
EDGE_Y_M = -4.95
STEPS = 166  # 1.5 s of lead-in and 15 s
LEAD = 0  # its acceleration in the joint action


def drive(family: str, driver: str, seed: int, *, lead: float | None = None) -> list[Frame]:
    """Frames of an episode without attack, or with a commanded lead vehicle."""
    spec = RunSpec(family=family, method="random", seed=0, ego=EgoConfig(driver=driver))
    with closing(RiskSacEnv(RiskSacEnv.of(spec).problem, spec.learner.reward, controlled=lead is not None)) as env:
        env.reset(seed=seed)
        action = np.zeros(env.action_size, dtype=np.float32)
        action[LEAD] = lead or 0.0
        ended = False
        while not ended:
            *_, terminated, truncated, _ = env.step(action)
            ended = terminated or truncated
        return env.trace.frames


def search(driver: str, family: str, method: str, episodes: int, folder) -> list[EpisodeRecord]:
    budget = {"episodes": episodes}
    spec = RunSpec(family=family, method=method, seed=5, budget=budget, ego=EgoConfig(driver=driver))
    assert run(spec, folder, lambda done, metrics: None).finished
    lines = (folder / "episodes.jsonl").read_bytes().splitlines()
    return [EpisodeRecord.model_validate_json(line) for line in lines]


def test_an_ego_comes_back_to_its_lane():
    frames = drive("low", "overtaker", 0)
    assert max(frame.y_m[0] for frame in frames) > LANES_Y_M[2] - 0.3
    assert abs(frames[-1].y_m[0] - LANES_Y_M[1]) < 0.1


@pytest.mark.parametrize(("driver", "episodes"), [("lane-changer", 60), ("off-roader", 20)])
def test_no_episode_of_an_ego_that_steers_is_invalid(driver, episodes, tmp_path):
    records = search(driver, "low", "random", episodes, tmp_path)
    assert len(records) == episodes
    assert all(record.outcome is not Outcome.INVALID for record in records)


def test_an_ego_that_leaves_the_road_drives_on_to_the_horizon():
    frames = drive("low", "off-roader", 5, lead=-1.0)
    assert len(frames) == STEPS
    assert max_edge_m(frames) > 1.0


def max_edge_m(frames: list[Frame]) -> float:
    """How far the ego's whole body was off the right edge."""
    return max(EDGE_Y_M - frame.y_m[0] - frame.width_m[0] / 2 for frame in frames)


def test_an_ego_that_drives_off_into_nowhere_is_where_it_drove_to():
    frames = drive("low", "runaway", 0)
    assert len(frames) == STEPS
    assert frames[-1].y_m[0] < -200.0
    steps_m = np.hypot(np.diff([f.x_m[0] for f in frames]), np.diff([f.y_m[0] for f in frames]))
    np.testing.assert_allclose(steps_m[16:], [f.speed_mps[0] * 0.1 for f in frames[17:]], atol=0.02)
