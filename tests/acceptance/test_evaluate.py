"""`risk-sac evaluate` as a user starts it, also crashed, interrupted and resumed."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from risk_sac import cli
from risk_sac.execution.jobs import ATTEMPTS

RISK_SAC = [sys.executable, "-m", "risk_sac"]
# Small networks and a short warm-up, so that the few episodes learn; two contacts in twelve episodes or so.
SPEC = """
methods: [random, sac]
families: [low, mixed]
seeds: [0, 1]
budget: {episodes: 9}
learner:
  agent: {hidden_sizes: [32, 32], batch_size: 32, warmup_steps: 100}
  warm_start: {episodes: 1}
  scenes: {initial_scenes: 2, candidates: 32}
  checkpoint_every: 2
"""
FLAGS = ["--spec", "spec.yaml", "--scenario", "low", "--episodes", "6", "--jobs", "2", "--verify", "1", "--out", "out"]
RUNS = 4


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The working folder of a comparison that was never interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "spec.yaml").write_text(SPEC)
    done = subprocess.run([*RISK_SAC, "evaluate", *FLAGS], capture_output=True, text=True, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert f"Report of {RUNS} of {RUNS} runs" in done.stdout
    return folder


def table(folder: Path) -> dict[str, Any]:
    """`table.json` without what differs from one execution to the next."""
    stored: dict[str, Any] = json.loads((folder / "out" / "table.json").read_text())
    for row in stored["runs"]:
        del row["wall_s"], row["cpu_s"]
    for cell in stored["cells"]:
        del cell["cpu_s_per_distinct_failure"]
    return stored


def test_report_holds_cells_tests_runs_and_figures(whole):
    stored = table(whole)
    assert stored["complete"] is True
    assert stored["command"] == "risk-sac evaluate " + " ".join(FLAGS)
    assert [(cell["method"], cell["episodes"]) for cell in stored["cells"]] == [("random", 12), ("sac", 12)]
    assert all(cell["seeds"] == [0, 1] for cell in stored["cells"])
    assert len(stored["tests"]) == 6
    assert len({row["digest"] for row in stored["runs"]}) == RUNS
    assert "libsumo" in stored["versions"]
    assert stored["platform"]["cpu"]
    names = {path.name for path in (whole / "out" / "figures").iterdir()}
    assert {"ecr_low.png", "ecr_low.svg", "bars_ofd.png", "alpha_low.svg"} <= names
    assert len((whole / "out" / "table.csv").read_text().splitlines()) == 3


def test_command_on_the_page_gives_the_digest_of_the_row(whole):
    page = (whole / "out" / "table.md").read_text()
    match = re.search(r"^risk-sac (run --spec .*)$", page, re.MULTILINE)
    assert match
    assert "--method random --seed 0" in match[1]
    subprocess.run([*RISK_SAC, *match[1].split()], check=True, capture_output=True, cwd=whole)
    (row,) = [row for row in table(whole)["runs"] if (row["method"], row["seed"]) == ("random", 0)]
    assert json.loads((whole / "repeated" / "results.json").read_text())["digest"] == row["digest"]


def test_finished_runs_are_not_run_again_and_the_report_is_the_same(whole, monkeypatch):
    out = whole / "out"
    runs = {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*")}
    report = {path: path.read_bytes() for path in out.glob("[tf]*/**/*") if path.is_file()}
    report |= {path: path.read_bytes() for path in out.glob("table.*")}
    assert len(report) > 10
    monkeypatch.chdir(whole)
    assert cli.main(["evaluate", *FLAGS]) == 0
    assert {path: path.stat().st_mtime_ns for path in (out / "runs").rglob("*")} == runs
    assert {path: path.read_bytes() for path in report} == report


def test_folder_of_another_comparison_is_refused_and_kept(whole, monkeypatch, capsys):
    monkeypatch.chdir(whole)
    before = (whole / "out" / "spec.yaml").read_bytes()
    assert cli.main(["evaluate", *FLAGS, "--seeds", "3", "--episodes", "7"]) == 2
    complaint = capsys.readouterr().err
    got = f"got {whole / 'out'}, which holds a comparison with another seeds, budget"
    assert complaint.startswith(f"--out: {got}; wanted an empty")
    assert (whole / "out" / "spec.yaml").read_bytes() == before


def test_an_interrupted_comparison_goes_on_and_equals_one_that_never_was(whole, tmp_path):
    shutil.copytree(whole, tmp_path, dirs_exist_ok=True)
    runs = tmp_path / "out" / "runs"
    for folder in runs.glob("*-sac-*"):  # the others are found finished
        shutil.rmtree(folder)
    process = subprocess.Popen(
        [*RISK_SAC, "evaluate", *FLAGS], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
    )
    wait_for(process, lambda: any(path.stat().st_size for path in runs.glob("*-sac-*/episodes.jsonl")))
    os.kill(process.pid, signal.SIGINT)
    _, complaint = process.communicate()
    assert process.returncode == 130, complaint
    assert "The same command again goes on" in complaint
    partial = table(tmp_path)
    assert 0 < len(partial["runs"]) < RUNS
    assert len(partial["runs"]) + len(partial["missing"]) == RUNS
    assert any(re.match(r"stopped after \d of 6 episodes", run["reason"]) for run in partial["missing"])
    assert "## Missing" in (tmp_path / "out" / "table.md").read_text()

    resumed = subprocess.run([*RISK_SAC, "evaluate", *FLAGS], capture_output=True, text=True, cwd=tmp_path)
    assert resumed.returncode == 0, resumed.stderr
    assert table(tmp_path) == table(whole)


def wait_for(process: subprocess.Popen[str], condition: Callable[[], bool]) -> None:
    while not condition():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leaves figures out of reports, which take most of their time."""
    monkeypatch.setattr("risk_sac.report.files.figure_names", lambda comparison: ())


@pytest.fixture
def crash(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, without_figures: None) -> Callable[[int], None]:
    """Lets the first `times` processes of a comparison die as libsumo does."""

    def arrange(times: int) -> None:
        python = tmp_path / "python"
        count = f"echo crash >> {tmp_path}/crashes; [ $(wc -l < {tmp_path}/crashes) -gt {times} ] || kill -SEGV $$"
        python.write_text(f'#!/bin/sh\n{count}\nexec {sys.executable} "$@"\n')
        python.chmod(0o755)
        monkeypatch.setattr(sys, "executable", str(python))

    return arrange


ONE = ["--scenario", "low", "--methods", "random", "--seeds", "1", "--first-seed", "4", "--episodes", "1"]
ONE += ["--verify", "0", "--out"]


def test_a_crashed_run_is_tried_again(crash, tmp_path):
    crash(1)
    assert cli.main(["evaluate", *ONE, str(tmp_path / "out")]) == 0
    assert [(row["method"], row["seed"]) for row in table(tmp_path)["runs"]] == [("random", 4)]


def test_a_run_that_crashes_every_time_has_failed(crash, tmp_path, capsys):
    crash(ATTEMPTS)
    assert cli.main(["evaluate", *ONE, str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err.startswith(
        f"low-random-4: worker was killed by SIGSEGV; {ATTEMPTS} workers in a row finished no episode"
    )
    assert "Segmentation" not in table(tmp_path)["missing"][0]["reason"]
    assert (tmp_path / "out" / "table.md").exists()


def test_what_fails_is_named_and_the_others_go_on(tmp_path, monkeypatch, capsys, without_figures):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spec.yaml").write_text(SPEC)
    runs = tmp_path / "out" / "runs"
    (runs / "low-no-adversary-0").mkdir(parents=True)
    (runs / "low-no-adversary-0" / "checkpoint").write_bytes(b"of another program")
    (runs / "low-no-adversary-1").write_text("in the way")
    methods = ["--methods", "random", "no-adversary", "--seeds", "2", "--episodes", "2"]
    assert cli.main(["evaluate", *FLAGS, *methods]) == 1
    complaint = capsys.readouterr().err
    assert re.search(r"^low-no-adversary-0: .*holds a checkpoint but no results", complaint)
    assert re.search(r"^low-no-adversary-1: .*File exists", complaint, re.MULTILINE)
    stored = table(tmp_path)
    assert [(row["method"], row["seed"]) for row in stored["runs"]] == [("random", 0), ("random", 1)]
    assert [run["seed"] for run in stored["missing"]] == [0, 1]
    assert all(test["p"] is None for test in stored["tests"])
