"""`risk-sac run` as a user starts it, interrupted and resumed."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from risk_sac import cli

# Small networks and a short warm-up, so that the few episodes learn and none is over before a signal arrives.
SPEC = """
family: low
method: risk-sac
seed: 2
budget: {evaluation_episodes: 1}
learner: {agent: {hidden_sizes: [32, 32], batch_size: 32, warmup_steps: 100}, warm_start: {episodes: 1}}
"""
EPISODES = 5


def arguments(folder: Path) -> list[str]:
    spec = folder.with_suffix(".yaml")
    spec.write_text(SPEC)
    return ["run", "--spec", str(spec), "--episodes", str(EPISODES), "--out", str(folder)]


def results(folder: Path) -> dict[str, Any]:
    stored: dict[str, Any] = json.loads((folder / "results.json").read_text())
    return stored


def test_interrupted_and_resumed_run_equals_an_uninterrupted_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert cli.main(arguments(whole)) == 0
    printed = capsys.readouterr().out
    assert re.search(r"ECR \(95 %\)", printed)
    assert re.search(r"search\s+no_contact +failure .*evaluation\s+no_contact +failure", printed, re.DOTALL)
    stored = results(whole)
    assert (stored["finished"], stored["metrics"]["episodes"], stored["evaluation"]["episodes"]) == (True, EPISODES, 1)

    command = [sys.executable, "-m", "risk_sac", *arguments(parts)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    episodes = parts / "episodes.jsonl"
    while not (episodes.exists() and episodes.read_text().count("\n") >= 2):
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate()
    assert process.returncode == 130, complaint
    assert re.search(r"Stopped after [2-5] of 6 episodes\. The same command again goes on", complaint)
    assert results(parts)["finished"] is False

    assert cli.main(arguments(parts)) == 0
    assert results(parts)["digest"] == stored["digest"]
    assert episodes.read_bytes() == (whole / "episodes.jsonl").read_bytes()
