import gc
import os
from pathlib import Path

import pytest

from risk_sac.config import Budget, LearnerConfig, RunSpec
from risk_sac.errors import CheckpointError, ConfigError
from risk_sac.execution.evaluate import run
from risk_sac.execution.recorder import Recorder
from risk_sac.records import Repetition
from risk_sac.run_folder.results import (
    EPISODES,
    RESULTS,
    RecordedFailure,
    Verified,
    first_of_variants,
    read_results,
    write_verified,
)
from risk_sac.search.loop import execute_run
from risk_sac.search.run import CHECKPOINT
from tests.listener import Listener

SPEC = RunSpec(
    family="mixed", method="random", seed=34, budget=Budget(episodes=8), learner=LearnerConfig(checkpoint_every=2)
)


def execute(folder: Path, spec: RunSpec = SPEC):
    return run(spec, folder, lambda done, metrics: None)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Every file of a finished run, and its results."""
    folder = tmp_path_factory.mktemp("finished")
    results = execute(folder)
    assert results.failures
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}, results


@pytest.fixture
def folder(finished, tmp_path):
    for name, content in finished[0].items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def test_a_recorder_keeps_no_failure_in_memory(finished, tmp_path):
    before = number_of_failures()
    recorder = Recorder(SPEC, tmp_path, Listener())
    outcome = execute_run(SPEC, tmp_path, recorder)
    assert number_of_failures() == before
    assert recorder.finish(outcome).failures == finished[1].failures
    assert number_of_failures() == before


def number_of_failures() -> int:
    return sum(type(each) is RecordedFailure for each in gc.get_objects())


@pytest.mark.parametrize("damaged", [b"", b'{"spec": 1}', None])
def test_damaged_results_are_written_anew_from_the_checkpoint(folder, finished, caplog, damaged):
    content = (folder / RESULTS).read_bytes()
    content = content.replace(b'"failures": ', b'"failures": 1', 1) if damaged is None else damaged
    (folder / RESULTS).write_bytes(content)
    results = execute(folder)
    assert results.digest == finished[1].digest
    assert results.failures == finished[1].failures
    assert read_results(folder).metrics == finished[1].metrics
    assert (folder / "results.json.damaged").read_bytes() == content
    assert f"{folder / RESULTS} is damaged" in caplog.text


@pytest.mark.parametrize("damaged", [b"", b"{}\n" * 3, b"\xff"])
def test_a_damaged_file_of_episodes_is_written_anew(folder, finished, damaged):
    (folder / EPISODES).write_bytes(damaged)
    execute(folder)
    assert (folder / EPISODES).read_bytes() == finished[0][EPISODES]


def test_results_of_something_else_are_left_alone(tmp_path):
    (tmp_path / RESULTS).write_text('{"accuracy": 0.9}')
    with pytest.raises(ConfigError, match=r"is damaged: .* something else wrote it"):
        execute(tmp_path)
    assert (tmp_path / RESULTS).read_text() == '{"accuracy": 0.9}'


def test_a_folder_with_damaged_results_and_the_checkpoint_of_another_run_is_left_alone(folder):
    (folder / RESULTS).write_bytes(b"")
    with pytest.raises(CheckpointError, match="belongs to the run"):
        execute(folder, SPEC.model_copy(update={"seed": 4}))
    assert (folder / RESULTS).read_bytes() == b""
    assert (folder / CHECKPOINT).exists()


def test_the_same_command_again_keeps_the_headline_of_the_replay(folder, finished):
    assert execute(folder).metrics.headline is None
    results = finished[1]
    episodes = {episode.index: Repetition(times=2, same=2) for episode in first_of_variants(results)}
    write_verified(folder, Verified(digest=results.digest, code="", versions={}, episodes=episodes))
    execute(folder)
    found = read_results(folder).metrics
    assert found.headline == len(found.headline_kinds) == found.headline_candidates


def test_a_contact_whose_series_is_lost_stays_a_contact(folder, finished):
    assert not (folder / "failures").exists()
    assert execute(folder).failures == finished[1].failures


def test_a_run_stays_in_its_folder_though_foreign_code_changes_the_working_directory(tmp_path, monkeypatch):
    for name in ("here", "elsewhere"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "here")
    spec = SPEC.model_copy(update={"budget": Budget(episodes=3)})
    assert run(spec, Path("run"), lambda done, metrics: os.chdir(tmp_path / "elsewhere")).finished
    assert read_results(tmp_path / "here" / "run").finished
    assert list((tmp_path / "elsewhere").iterdir()) == []
