"""Pretraining: streams and policies that are interrupted, and the mirror of transitions."""

import hashlib
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch

from risk_sac.config import EgoConfig, RunSpec
from risk_sac.env.env import RiskSacEnv
from risk_sac.env.problem import Problem
from risk_sac.errors import ConfigError
from risk_sac.lab.pretraining import episodes, policy
from risk_sac.lab.pretraining.episodes import EpisodeStream
from risk_sac.lab.pretraining.policy import PolicyTraining
from risk_sac.search.prior.mirror import Mirror
from risk_sac.search.prior.policy import PolicyLayout
from risk_sac.world.types import Scene, Vector


def test_an_interrupted_stream_goes_on_as_if_it_had_not_been(tmp_path, monkeypatch):
    monkeypatch.setattr(episodes, "CHUNK", 12)
    monkeypatch.setattr(episodes, "TURN", 6)
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for folder in (whole, parts):
        folder.mkdir()
    EpisodeStream("low", 5, 0).play(whole, 3)
    EpisodeStream("low", 5, 0).play(parts, 2)
    EpisodeStream("low", 5, 0).play(parts, 3)
    names = sorted(path.name for path in whole.iterdir())
    assert names == [f"low-00-000{k}.npz" for k in range(3)]
    for name in names:
        assert (whole / name).read_bytes() == (parts / name).read_bytes()


def trained(
    folder: Path,
    episodes: int,
    jobs: int,
    *,
    interrupted: bool = False,
    stages: Sequence[policy.TrainingStage] = policy.STAGES,
) -> PolicyTraining:
    """Trains a policy; an interruption comes after the curve's first point."""
    folder.mkdir()
    for points in (1, None) if interrupted else (None,):
        training = PolicyTraining("low", 5, episodes, stages=stages)
        with ProcessPoolExecutor(jobs, multiprocessing.get_context("fork")) as pool:
            list(islice(training.run(pool, folder), points))
    return training


def digest(training: PolicyTraining) -> str:
    """SHA-256 of the weights of policy and critics."""
    networks = training.agent.networks()
    return hashlib.sha256(b"".join(layer.tobytes() for layers in networks for layer in layers)).hexdigest()


SHORT = tuple(
    stage._replace(begins=begins, decisions=40) for stage, begins in zip(policy.STAGES, (0.0, 0.5), strict=True)
)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shortens the training to few episodes that still act and learn."""
    monkeypatch.setattr(policy, "EPISODES", 1)
    monkeypatch.setattr(policy, "TURNS", 2)
    monkeypatch.setattr(policy, "EVALUATED_EVERY", 3)
    monkeypatch.setattr(policy, "EVALUATION_TURNS", 2)


@pytest.mark.usefixtures("short")
def test_a_policy_is_the_same_however_it_was_trained(tmp_path):
    """One process or two, in one go or interrupted."""
    whole = trained(tmp_path / "whole", 12, 2, stages=SHORT)
    parts = trained(tmp_path / "parts", 12, 1, interrupted=True, stages=SHORT)
    assert whole.curve == parts.curve
    assert [point["episodes"] for point in whole.curve] == [6, 12]
    assert digest(whole) == digest(parts) != digest(PolicyTraining("low", 5, 12))  # and it has learnt


@pytest.mark.torture
def test_a_thousand_episodes_give_the_same_weights_again(tmp_path):
    once, again = (trained(tmp_path / name, 1000, jobs) for name, jobs in (("once", 2), ("again", 1)))
    assert digest(once) == digest(again)
    assert once.curve == again.curve


@pytest.mark.skipif(torch.cuda.is_available(), reason="has the GPU that it must lack")
def test_a_gpu_that_is_not_there_is_refused_in_one_line():
    with pytest.raises(ConfigError, match=r"^--device: .*no CUDA device here.*'cpu'"):
        PolicyTraining("low", 5, 100, "cuda")


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


def test_the_simulator_shows_a_mirrored_scene_as_the_mirror_does():
    spec = RunSpec(family="low", method="sac", seed=3, ego=EgoConfig(driver="idm-aeb"))  # SUMO's driver keeps right
    mirror = Mirror.of(PolicyLayout.of(Problem.from_spec(spec)))
    assert mirror is not None
    # Both brake: before the release their accelerations differ by side, and the count of pedals has a threshold.
    actions = [np.array([0.0, 0.0, -0.5, -0.5, -0.3, 0.2], np.float32)] * 8
    with closing(RiskSacEnv.of(spec)) as env:
        seen = observations(env, SCENE, actions)
        mirrored = observations(env, MIRRORED, [mirror.action(action) for action in actions])
    assert not np.allclose(seen[-1], mirrored[-1], atol=10 * TOLERANCE)  # the scene has two unlike sides
    for own, other in zip(seen, mirrored, strict=True):
        np.testing.assert_allclose(mirror.observation(own), other, atol=TOLERANCE)
        np.testing.assert_array_equal(mirror.observation(mirror.observation(own)), own)


def test_families_with_unlike_sides_have_no_mirror():
    for family in ("mixed", "dense"):
        assert Mirror.of(PolicyLayout.of(Problem.from_spec(RunSpec(family=family, method="sac", seed=3)))) is None
