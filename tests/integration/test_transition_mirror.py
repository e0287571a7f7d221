"""The mirror of transitions against the simulator."""

from contextlib import closing

import numpy as np

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env import RiskSacEnv
from risk_sac.pretraining.mirror import Mirror
from risk_sac.prior.policy import Layout
from risk_sac.problem import Problem
from risk_sac.types import Scene, Vector

TOLERANCE = 0.03  # SUMO's cars on the right slow down a little for those on their left
SCENE = {
    "ego_speed_mps": 12.0,
    "lead_gap_m": 20.0,
    "lead_speed_mps": 11.0,
    "left_offset_m": 4.0,
    "left_speed_mps": 12.0,
    "right_offset_m": -6.0,
    "right_speed_mps": 10.0,
    "follower_gap_m": 25.0,
    "friction": 0.9,
}
MIRRORED = SCENE | {"left_offset_m": -6.0, "left_speed_mps": 10.0, "right_offset_m": 4.0, "right_speed_mps": 12.0}


def observations(env: RiskSacEnv, scene: dict[str, float], actions: list[Vector]) -> list[Vector]:
    seen = [env.reset(seed=3, options={"scene": Scene(family="low", values=scene)})[0]]
    return seen + [env.step(action)[0] for action in actions]


def test_the_simulator_shows_a_mirrored_scene_as_the_mirror_does() -> None:
    spec = RunSpec(family="low", method="sac", seed=3, ego=EgoConfig(driver="idm-aeb"))  # SUMO's driver keeps right
    mirror = Mirror.of(Layout.of(Problem.from_spec(spec)))
    assert mirror is not None
    actions = [np.array([0.0, 0.0, 0.4, -0.5, -0.3, 0.2], np.float32)] * 8
    with closing(RiskSacEnv.of(spec)) as env:
        seen = observations(env, SCENE, actions)
        mirrored = observations(env, MIRRORED, [mirror.action(action) for action in actions])
    assert not np.allclose(seen[-1], mirrored[-1], atol=10 * TOLERANCE)  # the scene has two unlike sides
    for own, other in zip(seen, mirrored, strict=True):
        np.testing.assert_allclose(mirror.observation(own), other, atol=TOLERANCE)
        np.testing.assert_array_equal(mirror.observation(mirror.observation(own)), own)


def test_families_with_unlike_sides_have_no_mirror() -> None:
    for family in ("mixed", "dense"):
        assert Mirror.of(Layout.of(Problem.from_spec(RunSpec(family=family, method="sac", seed=3)))) is None
