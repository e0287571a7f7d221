"""Pretraining: streams and policies that are interrupted."""

import hashlib
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import torch

from risk_sac.errors import ConfigError
from risk_sac.lab.pretraining import episodes, policy
from risk_sac.lab.pretraining.episodes import EpisodeStream, ScriptEpisode, write_episodes
from risk_sac.lab.pretraining.policy import PolicyTraining
from risk_sac.scenario.families import family_named
from risk_sac.search.prior.coordinates import Coordinates


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


FAMILIES = ("low", "left_turn_car")


def scripts(folder: Path) -> Path:
    """Writes script episodes as if each had failed SUMO's driver."""
    random = np.random.default_rng(0)
    for family in FAMILIES:
        points = random.random((5, Coordinates.of(family_named(family)).dimension))
        failed = [ScriptEpisode(point=point, ego="default", steps=9, kind="cut-in") for point in points]
        write_episodes(folder / f"{family}-00-0000.npz", failed)
    return folder


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
        training = PolicyTraining(scripts(folder), 5, episodes, families=FAMILIES, stages=stages)
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
    assert (
        digest(whole) == digest(parts) != digest(PolicyTraining(scripts(tmp_path), 5, 12, families=FAMILIES))
    )  # and it has learnt


@pytest.mark.torture
def test_a_thousand_episodes_give_the_same_weights_again(tmp_path):
    once, again = (trained(tmp_path / name, 1000, jobs) for name, jobs in (("once", 2), ("again", 1)))
    assert digest(once) == digest(again)
    assert once.curve == again.curve


@pytest.mark.skipif(torch.cuda.is_available(), reason="has the GPU that it must lack")
def test_a_gpu_that_is_not_there_is_refused_in_one_line(tmp_path):
    with pytest.raises(ConfigError, match=r"^--device: .*no CUDA device here.*'cpu'"):
        PolicyTraining(tmp_path, 5, 100, "cuda")


def test_without_scripts_that_failed_an_ego_no_policy_is_trained(tmp_path):
    with pytest.raises(ConfigError, match=r"^--streams: no script of low .*play more scripts first"):
        PolicyTraining(tmp_path, 5, 100, families=["low"])
