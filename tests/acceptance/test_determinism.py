"""Same spec and seed give the same results, also after a stop."""

import os
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest

from risk_sac.config import (
    AgentConfig,
    Budget,
    CampaignSpec,
    Iid,
    LearnerConfig,
    ReplayConfig,
    Requirement,
    RunSpec,
    SceneOptimizerConfig,
    WarmStartConfig,
)
from risk_sac.records import stored
from risk_sac.run_folder.checkpoint import previous
from risk_sac.run_folder.results import FAILURES
from risk_sac.search.loop import execute_run
from risk_sac.search.run import CHECKPOINT, RunOutcome
from risk_sac.search.scene_optimizer.archive import INITIAL
from tests.listener import Listener

EPISODES, EVALUATION = 6, 1
# Small enough for seconds, and still learning, modelling and replaying by priority before the run is over.
LEARNER = LearnerConfig(
    agent=AgentConfig(hidden_sizes=(32, 32), batch_size=32, warmup_steps=150),
    replay=ReplayConfig(capacity=1000),
    warm_start=WarmStartConfig(episodes=2),
    scenes=SceneOptimizerConfig(initial_scenes=2, refit_every=1, candidates=32, exploration=0.0),
    checkpoint_every=1,
)


def spec(seed: int = 0, method: str = "risk-sac") -> RunSpec:
    budget = Budget(episodes=EPISODES, evaluation_episodes=EVALUATION)
    return RunSpec(family="mixed", method=method, seed=seed, budget=budget, learner=LEARNER)


def run(folder: Path, *, seed: int = 0, limit: int = 10**9, method: str = "risk-sac") -> tuple[RunOutcome, Listener]:
    listener = Listener(limit)
    return execute_run(spec(seed, method), folder, listener), listener


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> tuple[RunOutcome, Listener]:
    return run(tmp_path_factory.mktemp("uninterrupted"))


@pytest.fixture(scope="module")
def stopped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that was stopped after four episodes."""
    folder = tmp_path_factory.mktemp("stopped")
    run(folder, limit=4)
    return folder


def test_the_run_has_learnt_something_to_be_deterministic_about(uninterrupted):
    summary, listener = uninterrupted
    assert summary.finished
    assert [r.phase for r in listener.records] == ["search"] * EPISODES + ["evaluation"] * EVALUATION
    assert listener.records[-1].environment_steps > 2 * LEARNER.agent.warmup_steps
    assert len({r.temperature for r in listener.records}) > 1
    assert len({r.dual_variable for r in listener.records}) > 1


ELSEWHERE = """
import sys
from pathlib import Path
from risk_sac.config import RunSpec
from risk_sac.search.loop import execute_run
from tests.listener import Listener

print(execute_run(RunSpec.model_validate_json(sys.argv[1]), Path(sys.argv[2]), Listener()).digest)
"""


def test_another_process_goes_on_with_a_stopped_run_as_if_it_never_stopped(uninterrupted, stopped, tmp_path):
    shutil.copytree(stopped, tmp_path, dirs_exist_ok=True)
    done = subprocess.run(
        [sys.executable, "-c", ELSEWHERE, spec().model_dump_json(), str(tmp_path)],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONHASHSEED": "1234"},
    )
    assert done.stdout.split()[-1] == uninterrupted[0].digest


@pytest.mark.parametrize("stop_after", [*(pytest.param(stop, marks=pytest.mark.torture) for stop in (1, EPISODES)), 4])
def test_a_stopped_and_resumed_run_equals_one_never_interrupted(uninterrupted, tmp_path, stop_after):
    expected, whole = uninterrupted
    stopped, before = run(tmp_path, limit=stop_after)
    assert not stopped.finished
    assert len(before.records) == stop_after
    resumed, after = run(tmp_path)
    assert resumed.finished
    # The checkpoint's episodes are told again, since a former listener may have missed the last of them.
    assert list(map(stored, after.records)) == list(map(stored, whole.records))
    assert after.series == whole.series
    assert list(map(stored, before.records)) == list(map(stored, whole.records[:stop_after]))
    assert resumed.digest == expected.digest
    assert resumed.metrics == expected.metrics
    assert resumed.evaluation == expected.evaluation


def test_a_resumed_i_i_d_phase_draws_on_and_no_search_meets_its_scenes(tmp_path):
    drawn = CampaignSpec(families=("mixed",), iid=Iid(episodes=4), learner=LEARNER).drawn()[1]
    whole, first, rest, searched = Listener(), Listener(2), Listener(10**9), Listener(10**9)
    expected = execute_run(drawn, tmp_path / "whole", whole)
    execute_run(drawn, tmp_path / "parts", first)
    resumed = execute_run(drawn, tmp_path / "parts", rest)
    assert [record.phase for record in whole.records] == ["iid"] * 4
    assert list(map(stored, rest.records)) == list(map(stored, whole.records))
    assert resumed.digest == expected.digest
    execute_run(spec(method="random"), tmp_path / "searched", searched)  # of the same seed
    assert not {record.seed for record in searched.records} & {record.seed for record in whole.records}
    scenes = [record.scene["friction"] for record in (*searched.records, *whole.records)]
    assert len(set(scenes)) == len(scenes)


def test_a_resumed_archive_search_breeds_on_as_if_never_interrupted(tmp_path):
    bred = spec(method="archive").model_copy(update={"budget": Budget(episodes=INITIAL + 6)})
    whole, first, rest = Listener(), Listener(INITIAL + 3), Listener()
    expected = execute_run(bred, tmp_path / "whole", whole)
    execute_run(bred, tmp_path / "parts", first)
    resumed = execute_run(bred, tmp_path / "parts", rest)
    assert len(first.records) == INITIAL + 3
    assert list(map(stored, rest.records)) == list(map(stored, whole.records))
    assert resumed.digest == expected.digest


@pytest.mark.parametrize("limit", [*(pytest.param(limit, marks=pytest.mark.torture) for limit in (1, 3)), 7])
@pytest.mark.parametrize("prior", ["none", "shipped"])
def test_a_resumed_search_by_two_takes_turns_as_if_never_interrupted(tmp_path, prior, limit):
    at_once = LEARNER.model_copy(update={"warm_start": WarmStartConfig(episodes=0)})  # both act from the beginning on
    changes = {"budget": Budget(episodes=9), "learner": at_once, "prior": prior}
    shared = spec(seed=2, method="risk-sac-diverse").model_copy(update=changes)
    whole, first, rest = Listener(), Listener(limit), Listener()
    expected = execute_run(shared, tmp_path / "whole", whole)
    execute_run(shared, tmp_path / "parts", first)
    resumed = execute_run(shared, tmp_path / "parts", rest)
    learned = [one.temperature != two.temperature for one, two in pairwise(whole.records)]
    if prior == "none":  # with a prior the policy hardly gets a turn in nine episodes
        assert {True, False} == set(learned[3:])  # past the warm-up, and it learns only where it acts
    assert len(first.records) == limit
    assert list(map(stored, rest.records)) == list(map(stored, whole.records))
    assert resumed.digest == expected.digest


@pytest.mark.parametrize("damaged", ["newest", "both"])
def test_a_run_with_damaged_checkpoints_equals_one_never_interrupted(uninterrupted, stopped, tmp_path, damaged):
    expected, whole = uninterrupted
    shutil.copytree(stopped, tmp_path, dirs_exist_ok=True)
    files = [tmp_path / CHECKPOINT, previous(tmp_path / CHECKPOINT)]
    for file in files[:1] if damaged == "newest" else files:
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.write_bytes(content)
    for file in (tmp_path / FAILURES).glob("*.npz"):
        file.unlink()  # what is played again is also recorded again
    resumed, after = run(tmp_path)
    assert resumed.digest == expected.digest
    assert list(map(stored, after.records)) == list(map(stored, whole.records))
    assert after.series == whole.series


def test_a_damaged_series_is_reported_as_it_was_written(tmp_path, caplog):
    slow = Requirement(name="slow", formula="ego_speed_mps <= 1")  # which the ego violates in each episode
    failing, told, again = (
        spec(method="random").model_copy(update={"requirements": (slow,)}),
        Listener(10**9),
        Listener(10**9),
    )
    execute_run(failing, tmp_path, told)
    lost, changed, *_ = [file for file in told.series if file is not None]
    (tmp_path / FAILURES / lost.name).unlink()
    (tmp_path / FAILURES / changed.name).write_bytes(b"PK")
    execute_run(failing, tmp_path, again)
    assert again.series == told.series
    assert {lost.name, changed.name} == {Path(record.args[0]).name for record in caplog.records if record.args}


def test_a_finished_run_tells_of_its_episodes_and_repeats_none(tmp_path):
    first, told = run(tmp_path, method="random")
    written = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npz")}
    again, listener = run(tmp_path, method="random")
    assert listener.records == told.records
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.npz")} == written
    assert again.digest == first.digest
