"""Searches detect a defect by a failure that the defect alone causes."""

import re
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from risk_sac.cli import main
from risk_sac.config import RunSpec
from risk_sac.config.spec_file import read_ego
from risk_sac.env.env import RiskSacEnv
from risk_sac.failures.play import detected, play, without_defects
from risk_sac.lab.benchmark.runs import Detection, first_detection
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, series_name
from risk_sac.world.types import Scene

SPEC = RunSpec(family="mixed", method="archive", seed=501, ego=read_ego("idm-aeb+kerb-waits"))
STEPS = 8000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("run")


@pytest.fixture(scope="module")
def found(folder: Path) -> Detection:
    return first_detection(SPEC, folder, STEPS)


def test_a_search_ends_at_the_first_detection(found: Detection, folder: Path) -> None:
    assert found.detected is not None
    assert found.reached is not None
    assert found.triggered is not None
    assert found.reached <= found.triggered <= found.detected == found.steps < STEPS
    assert found.episode is not None
    assert found.episode.collision is not None
    assert found.kind == found.episode.collision.kind
    assert first_detection(SPEC, folder, STEPS) == found  # nothing is played again
    (folder / "detection.json").unlink()
    assert first_detection(SPEC, folder, STEPS) == found  # from the checkpoint


def test_the_same_motions_do_not_make_the_ego_without_the_defect_fail(found: Detection, folder: Path) -> None:
    assert found.episode is not None
    series = read_series(folder / FAILURES / series_name(found.episode.index))
    assert detected(SPEC, found.episode, series) == found.episode.collision
    sound = without_defects(SPEC, found.episode, series)
    assert sound.found == ()
    frames, ids = len(series["time_s"]), [str(id_) for id_ in series["ids"]]
    driven = [ids.index(id_) for id_ in ("occluder", "pedestrian")]
    for name in ("x_m", "y_m", "heading_rad"):
        np.testing.assert_array_equal(sound.series[name][:frames, driven], series[name][:, driven])
    assert not np.array_equal(sound.series["x_m"][:frames, 0], series["x_m"][:, 0])


def test_recorded_motions_repeat_the_failure_of_the_same_ego(found: Detection, folder: Path) -> None:
    assert found.episode is not None
    series = read_series(folder / FAILURES / series_name(found.episode.index))
    with closing(RiskSacEnv.of(SPEC)) as env:
        idle = np.zeros((env.problem.family.horizon_steps, env.action_size))
        again = play(env, Scene("mixed", found.episode.scene), found.episode.seed, idle, motions=series)
    assert again.collision == found.episode.collision
    np.testing.assert_array_equal(again.series["x_m"], series["x_m"])
    assert again.defect_reached_s == found.episode.defect_reached_s


def test_a_search_that_detects_nothing_ends_with_its_budget(tmp_path: Path) -> None:
    spec = SPEC.model_copy(update={"family": "low", "method": "random", "ego": read_ego("default+sumo-distracted")})
    found = first_detection(spec, tmp_path, 300)
    assert (found.detected, found.reached, found.kind) == (None, None, "")
    assert 300 <= found.steps < 500


def test_a_larger_budget_goes_on_with_what_was_played(tmp_path: Path) -> None:
    spec = SPEC.model_copy(update={"method": "random"})
    short = first_detection(spec, tmp_path / "twice", 400)
    assert short.detected is None
    began = (tmp_path / "twice" / "checkpoint").stat().st_mtime_ns
    whole, twice = first_detection(spec, tmp_path / "once", 900), first_detection(spec, tmp_path / "twice", 900)
    assert twice == whole
    assert (tmp_path / "twice" / "checkpoint").stat().st_mtime_ns > began
    assert first_detection(spec, tmp_path / "twice", 400) == whole.within(400)
    assert whole.within(400).reached == short.reached


def test_the_benchmark_goes_on_where_it_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["benchmark", "--methods", "random", "--defects", "kerb-waits", "sumo-distracted", "--steps", "200"]
    command += ["--jobs", "1", "--out", str(tmp_path)]
    assert main([*command, "--seeds", "1"]) == 0
    answers = {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/detection.json")}
    assert len(answers) == 2
    assert main([*command, "--seeds", "1"]) == 0  # plays nothing
    assert {file: file.stat().st_mtime_ns for file in tmp_path.glob("*/detection.json")} == answers
    assert len((tmp_path / "detections.csv").read_text().splitlines()) == 3
    assert (tmp_path / "curves-all.svg").read_bytes().startswith(b"<?xml")
    assert "falsification rate" in (tmp_path / "benchmark.md").read_text()
    capsys.readouterr()
    assert main([*command, "--seeds", "2", "--tables-only"]) == 0  # the second seed is not played
    assert re.search(r"^ *random +\d of 2 ", capsys.readouterr().out, re.MULTILINE)
    assert main([*command, "--defects", "kerb-wait"]) == 2
    assert "--defects: got 'kerb-wait'" in capsys.readouterr().err
