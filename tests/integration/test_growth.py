"""A run's kept state does not grow with its episodes, and resumes."""

import hashlib
import io

import pytest
import torch

from risk_sac.config import Budget, RunSpec
from risk_sac.run_folder import checkpoint
from risk_sac.search import loop
from risk_sac.search.run import CHECKPOINT, PLAYED, ROW
from tests.listener import Listener
from tests.load.growth import drawn

SPEC = RunSpec(family="low", method="archive", seed=0, budget=Budget(episodes=400))


@pytest.fixture(autouse=True)
def nothing_is_simulated(monkeypatch):
    monkeypatch.setattr(loop, "play", drawn)


def played(folder, limit=10**9):
    return loop.execute_run(SPEC, folder, Listener(limit))


def test_a_checkpoint_of_many_episodes_is_no_larger_than_that_of_few(tmp_path):
    played(tmp_path, limit=100)
    few = (tmp_path / CHECKPOINT).stat().st_size
    assert played(tmp_path).finished
    assert (tmp_path / CHECKPOINT).stat().st_size <= 1.1 * few


def test_a_run_goes_on_with_its_processor_time_and_begins_anew_without_it(tmp_path):
    whole = played(tmp_path / "whole")
    for name in ("kept", "lost"):
        first = played(tmp_path / name, limit=30)
        if name == "lost":
            (tmp_path / name / PLAYED).unlink()
        rest = played(tmp_path / name)
        assert rest.digest == whole.digest
        assert (rest.episode_cpu_s[:30] == first.episode_cpu_s) == (name == "kept")
        assert list(rest.episode_cpu_s) == sorted(rest.episode_cpu_s)


def test_a_run_goes_on_from_a_checkpoint_of_an_earlier_version(tmp_path):
    first = played(tmp_path, limit=30)
    path, known = tmp_path / CHECKPOINT, {4: "ab" * 32}
    state = checkpoint.load(path, SPEC.digest) | {"series": known, "episode_cpu_s": list(first.episode_cpu_s)}
    archive = io.BytesIO()
    torch.save({"run_digest": SPEC.digest, "state": state}, archive)
    path.write_bytes(archive.getvalue() + hashlib.sha256(archive.getvalue()).digest())
    (tmp_path / PLAYED).unlink()
    assert played(tmp_path).episode_cpu_s[:30] == first.episode_cpu_s
    assert (tmp_path / PLAYED).read_bytes()[4 * ROW.size + 8 : 5 * ROW.size].hex() == known[4]
