"""`risk-sac run` as a user starts it: a process of its own, interrupted and resumed."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

RUN = [sys.executable, "-c", "import sys; from risk_sac.cli import main; sys.exit(main())", "run"]
# Small networks and a short warm-up, so that the few episodes learn and none is over before a signal arrives.
SPEC = """
family: mixed
method: risk-sac
seed: 2
budget: {evaluation_episodes: 1}
learner: {agent: {hidden_sizes: [32, 32], batch_size: 32, warmup_steps: 100}}
"""


@pytest.fixture(autouse=True)
def spec_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "spec.yaml").write_text(SPEC)
    monkeypatch.chdir(tmp_path)


def command(folder: Path, episodes: int) -> list[str]:
    return [*RUN, "--spec", "spec.yaml", "--episodes", str(episodes), "--out", str(folder)]


def results(folder: Path) -> dict[str, Any]:
    stored: dict[str, Any] = json.loads((folder / "results.json").read_text())
    return stored


def risk_sac_run(folder: Path, episodes: int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(folder, episodes), capture_output=True, text=True)


def test_three_episodes_from_start_to_summary(tmp_path: Path) -> None:
    done = risk_sac_run(tmp_path, 3)
    assert done.returncode == 0, done.stderr
    assert re.search(r"ECR \(95 %\)", done.stdout)
    stored = results(tmp_path)
    assert stored["finished"] is True
    assert stored["metrics"]["episodes"] == 3
    assert stored["evaluation"]["episodes"] == 1


def test_interrupted_and_resumed_run_equals_an_uninterrupted_one(tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert risk_sac_run(whole, 5).returncode == 0
    process = subprocess.Popen(
        command(parts, 5),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    episodes = parts / "episodes.jsonl"
    while not (episodes.exists() and episodes.read_text().count("\n") >= 2):
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    printed, complaint = process.communicate()
    assert process.returncode == 130, complaint
    assert re.search(r"Stopped after [2-5] of 6 episodes\. The same command again goes on", printed)
    assert results(parts)["finished"] is False

    resumed = risk_sac_run(parts, 5)
    assert resumed.returncode == 0, resumed.stderr
    assert results(parts)["digest"] == results(whole)["digest"]
    assert episodes.read_bytes() == (whole / "episodes.jsonl").read_bytes()
