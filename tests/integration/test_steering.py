"""Egos that use other lanes than their first one, or leave the road, in real episodes."""

from contextlib import closing

import numpy as np
import pytest

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.types import Frame

pytestmark = pytest.mark.usefixtures("steering_egos")
LANES_Y_M = np.array([-3.3, 0.0, 3.3])  # middles of the lanes of low; the ego begins in the second


def undisturbed(family: str, driver: str, seed: int) -> list[Frame]:
    """The frames of an episode in which nobody attacks."""
    spec = RunSpec(family=family, method="random", seed=0, ego=EgoConfig(driver=driver))
    with closing(RiskSacEnv(RiskSacEnv.of(spec).problem, spec.learner.reward, controlled=False)) as env:
        env.reset(seed=seed)
        ended = False
        while not ended:
            *_, terminated, truncated, _ = env.step(np.zeros(env.action_size, dtype=np.float32))
            ended = terminated or truncated
        return env.trace.frames


def test_an_ego_changes_to_the_next_lane_and_stays_in_its_middle():
    frames = undisturbed("low", "lane-changer", 0)
    assert abs(frames[-1].y_m[0] - LANES_Y_M[2]) < 0.1
    assert abs(frames[-1].lane_offset_m[0]) < 0.1


def test_an_ego_comes_back_to_its_lane():
    frames = undisturbed("low", "overtaker", 0)
    assert max(frame.y_m[0] for frame in frames) > LANES_Y_M[2] - 0.3
    assert abs(frames[-1].y_m[0] - LANES_Y_M[1]) < 0.1
