"""`risk-sac run` as a user starts it: a process of its own, interrupted and resumed."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import pytest

RUN = [sys.executable, "-c", "import sys; from risk_sac.cli import main; sys.exit(main())", "run"]
# Small networks and a short warm-up, so that the few episodes learn and none is over before a signal arrives.
SPEC = """
family: mixed
method: risk-sac
seed: 2
budget: {evaluation_episodes: 1}
learner: {agent: {hidden_sizes: [32, 32], batch_size: 32, warmup_steps: 100}, warm_start: {episodes: 1}}
"""


EPISODES = 5


def command(folder: Path) -> list[str]:
    spec = folder.with_suffix(".yaml")
    spec.write_text(SPEC)
    return [*RUN, "--spec", str(spec), "--episodes", str(EPISODES), "--out", str(folder)]


def results(folder: Path) -> dict[str, Any]:
    stored: dict[str, Any] = json.loads((folder / "results.json").read_text())
    return stored


def risk_sac_run(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command(folder), capture_output=True, text=True)


class Whole(NamedTuple):
    """A run that was never interrupted."""

    folder: Path
    done: subprocess.CompletedProcess[str]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Whole:
    folder = tmp_path_factory.mktemp("cli") / "whole"
    return Whole(folder, risk_sac_run(folder))


def test_a_few_episodes_from_start_to_summary(whole: Whole) -> None:
    assert whole.done.returncode == 0, whole.done.stderr
    assert re.search(r"ECR \(95 %\)", whole.done.stdout)
    stored = results(whole.folder)
    assert stored["finished"] is True
    assert stored["metrics"]["episodes"] == EPISODES
    assert stored["evaluation"]["episodes"] == 1


def test_interrupted_and_resumed_run_equals_an_uninterrupted_one(whole: Whole, tmp_path: Path) -> None:
    parts = tmp_path / "parts"
    process = subprocess.Popen(
        command(parts),
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

    resumed = risk_sac_run(parts)
    assert resumed.returncode == 0, resumed.stderr
    assert results(parts)["digest"] == results(whole.folder)["digest"]
    assert episodes.read_bytes() == (whole.folder / "episodes.jsonl").read_bytes()
