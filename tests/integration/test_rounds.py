"""Episodes proposed in rounds and played by processes of their own."""

import os
import signal
import subprocess
import sys
import threading
import time
import tomllib
from contextlib import ExitStack, closing, suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import psutil
import pytest
from pydantic import ValidationError

from risk_sac import cli
from risk_sac.config import METHODS, Budget, CampaignSpec, EgoConfig, LearnerConfig, RunMethod, RunSpec, method_of
from risk_sac.config.campaign import BoundaryConfig
from risk_sac.config.learner import AgentConfig, WarmStartConfig
from risk_sac.config.methods import IID_METHODS
from risk_sac.env.problem import checked_campaign
from risk_sac.errors import ConfigError
from risk_sac.host import machine
from risk_sac.host.machine import ROLLOUTS, rollout_processes
from risk_sac.records import DrivenBy, EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.run_folder.crash_guard import CURRENT
from risk_sac.run_folder.results import FAILURES
from risk_sac.search.loop import execute_run, propose
from risk_sac.search.rollouts import ELSEWHERE, Rollouts, Terms
from risk_sac.search.run import RunState
from tests.ego_processes import served
from tests.listener import Listener

BATCH = 4
OVER = ("lead_gap_m", "lead_speed_mps")  # of a boundary
ALL: tuple[RunMethod, ...] = (*METHODS, *IID_METHODS)
# A learner that acts by its policy, and learns, within a few episodes.
QUICK = LearnerConfig(
    agent=AgentConfig(warmup_steps=200, batch_size=32), warm_start=WarmStartConfig(episodes=4), checkpoint_every=3
)


def spec(method: RunMethod, episodes: int, batch: int = BATCH, **budget: int) -> RunSpec:
    return RunSpec(
        family="low",
        method=method,
        seed=5,
        budget=Budget(episodes=episodes, batch=batch, **budget),
        learner=QUICK,
        boundary=BoundaryConfig(over=OVER) if method == "boundary" else None,
    )


class Killer(Listener):
    """Kills a rollout process after each of some episodes."""

    def __init__(self, after: tuple[int, ...]) -> None:
        super().__init__()
        self.after, self.killed = after, 0

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        super().episode(record, metrics, series)
        if record.index in self.after:
            processes = [one for one in psutil.Process().children() if "risk_sac.search.rollouts" in one.cmdline()]
            processes[record.index % len(processes)].send_signal(signal.SIGKILL)
            self.killed += 1


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch):
    return lambda number: monkeypatch.setenv(ROLLOUTS, str(number))


def test_the_number_of_processes_changes_nothing(tmp_path: Path, processes) -> None:
    digests = set()
    for number in (1, 3):
        processes(number)
        digests.add(execute_run(spec("risk-sac", 14), tmp_path / str(number), Listener()).digest)
    assert len(digests) == 1


@pytest.mark.torture
@pytest.mark.parametrize("method", ALL)
def test_neither_processes_nor_kills_change_a_method(tmp_path: Path, processes, method: RunMethod) -> None:
    needed = method_of(method).needs
    if needed:
        pytest.importorskip(needed)
    evaluated = 0 if method in IID_METHODS else 3  # their scenes are no search, whose policy is frozen at the end
    wanted, digests = spec(method, 26, batch=8, evaluation_episodes=evaluated), set()
    for number in (1, 2, 3, 5):
        processes(number)
        killer = Killer(after=(5, 14) if number in (2, 5) and method_of(method).in_rounds else ())
        outcome = execute_run(wanted, tmp_path / str(number), killer)
        assert outcome.finished
        assert killer.killed == len(killer.after)
        digests.add(outcome.digest)
    for limit in (3, 9, 10**9):
        outcome = execute_run(wanted, tmp_path / "stopped", Listener(limit=limit))
    assert digests == {outcome.digest}


def test_a_process_plays_on_while_nothing_waits_for_it(tmp_path: Path) -> None:
    wanted = spec("archive", 3, batch=3)
    with (
        closing(RunState(wanted, tmp_path)) as run,
        closing(Rollouts(Terms.of(wanted), tmp_path / "rollouts", 1)) as rollouts,
    ):
        for _ in range(3):
            run.proposed.append(propose(run))
            rollouts.submit(run.proposed[-1])
        noted, index = tmp_path / "rollouts" / "0" / CURRENT, ""
        while index != "2":
            time.sleep(0.05)
            index = noted.read_text()[:12].strip() if noted.exists() else ""
        assert rollouts.wait_for(0, 0.0) is not None


def test_killed_processes_change_nothing(tmp_path: Path, processes) -> None:
    processes(1)
    undisturbed = execute_run(spec("archive", 16), tmp_path / "whole", Listener())
    processes(2)
    killer = Killer(after=(1, 8))  # one process each: an episode that dies twice at the same step is left out
    killed = execute_run(spec("archive", 16), tmp_path / "killed", killer)
    assert killer.killed == 2
    assert killed.digest == undisturbed.digest
    assert [record.index for record in killer.records] == list(range(16))
    series = [sorted(file.name for file in (tmp_path / name / FAILURES).glob("*")) for name in ("whole", "killed")]
    assert series[0] == series[1]


def test_a_stopped_run_goes_on_as_if_it_had_not(tmp_path: Path, processes) -> None:
    processes(2)
    wanted = spec("risk-sac-diverse", 14)
    whole = execute_run(wanted, tmp_path / "whole", Listener())
    assert not execute_run(wanted, tmp_path / "stopped", Listener(limit=7)).finished
    assert execute_run(wanted, tmp_path / "stopped", Listener()).digest == whole.digest


def play_elsewhere(connection: Connection, folder: Path, told: list[str]) -> None:
    """Plays what the connection proposes, but loses the second proposal and process."""
    terms = connection.recv()
    with closing(Rollouts(terms, folder, 1, first=1)) as rollouts, suppress(EOFError):
        connection.send(True)
        while True:
            proposal = connection.recv()
            told.append("lost" if len(told) == 1 else "played")
            if told[-1] == "lost":
                connection.send(False)
                connection.send(True)
                continue
            rollouts.submit(proposal)
            connection.send(rollouts.wait_for(proposal.index, 60.0))


def test_processes_elsewhere_change_nothing_nor_does_the_loss_of_one(
    tmp_path: Path, processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    processes(2)
    wanted, told = spec("risk-sac", 14), []
    here = execute_run(wanted, tmp_path / "here", Listener())
    own, other = Pipe()
    monkeypatch.setenv(ELSEWHERE, str(os.dup(other.fileno())))
    other.close()
    thread = threading.Thread(target=play_elsewhere, args=(own, tmp_path / "elsewhere", told))
    thread.start()
    listener = Listener()
    there = execute_run(wanted, tmp_path / "there", listener)
    thread.join()
    assert there.digest == here.digest
    assert [record.index for record in listener.records] == list(range(14))
    assert told.count("lost") == 1
    assert told.count("played") > 1


def test_a_batch_of_one_is_played_in_this_process(tmp_path: Path) -> None:
    execute_run(spec("archive", 2, batch=1), tmp_path, Listener())
    assert not (tmp_path / "rollouts").exists()


def test_a_rate_has_the_same_draws_with_any_batch(tmp_path: Path) -> None:
    """Five stages of two draws, and one of twelve."""
    digests = {
        execute_run(spec("rate", 22, batch=batch), tmp_path / str(batch), Listener()).digest for batch in (1, BATCH)
    }
    assert len(digests) == 1
    assert (tmp_path / str(BATCH) / "rollouts").exists()


def test_a_learner_learns_from_all_episodes_before_it_is_evaluated(tmp_path: Path, processes) -> None:
    processes(2)
    listener = Listener()
    execute_run(spec("sac", 14, evaluation_episodes=3), tmp_path, listener)
    search, evaluation = listener.records[:14], listener.records[14:]
    assert [record.driven_by for record in search[:4]] == [DrivenBy.RANDOM] * 4  # the guide's
    assert {record.driven_by for record in search[8:]} == {DrivenBy.POLICY}
    learnt = [record.temperature for record in search]
    assert len(set(learnt[8:])) == len(learnt[8:])
    assert [record.temperature for record in evaluation] == [learnt[-1]] * 3


def test_a_peer_that_learns_where_it_plays_plays_one_episode_after_the_other(tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3")
    one, several = Listener(), Listener()
    execute_run(spec("ast-ppo", 4, batch=1), tmp_path / "one", one)
    execute_run(spec("ast-ppo", 4, batch=4), tmp_path / "several", several)
    assert several.records == one.records


@pytest.mark.parametrize("batch", [33, 1024])
def test_rounds_too_large_for_the_machine_are_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, batch: int
) -> None:
    monkeypatch.delenv(ROLLOUTS, raising=False)
    monkeypatch.setattr(machine, "cores", lambda: 2)
    campaign = CampaignSpec(families=("low",), methods=("archive",), budget=Budget(batch=batch))
    with pytest.raises(ConfigError, match=f"budget.batch: got {batch}; wanted at most 32") as refused:
        checked_campaign(campaign)
    assert refused.value.field == "budget.batch"
    run = ["run", "--scenario", "low", "--method", "archive", "--batch", str(batch), "--out", str(tmp_path / "out")]
    assert cli.main(run) == 2
    assert capsys.readouterr().err.startswith(f"--batch: got {batch}; wanted at most 32")
    assert not (tmp_path / "out").exists()
    monkeypatch.setenv(ROLLOUTS, "64")  # of an ego that takes its time
    assert checked_campaign(campaign).budget.batch == batch


def test_a_round_of_no_episode_is_refused() -> None:
    with pytest.raises(ValidationError, match="batch"):
        Budget(batch=0)


@pytest.mark.parametrize("number", ["0", "-2", "two"])
def test_a_number_of_processes_that_is_none_is_refused(processes, number: str) -> None:
    processes(number)
    with pytest.raises(ConfigError) as refused:
        rollout_processes()
    assert refused.value.field == ROLLOUTS


def test_a_round_is_not_many_times_the_same(tmp_path: Path, processes) -> None:
    processes(2)
    listener = Listener()
    execute_run(spec("bo-only", 24, batch=8), tmp_path, listener)
    scenes = [tuple(np.round(list(record.scene.values()), 3)) for record in listener.records]
    assert len(set(scenes)) == len(scenes)


def test_both_phases_of_a_budget_are_played(tmp_path: Path, processes) -> None:
    processes(2)
    listener = Listener()
    outcome = execute_run(spec("random", 5, evaluation_episodes=3), tmp_path, listener)
    assert outcome.finished
    assert [record.phase for record in listener.records] == ["search"] * 5 + ["evaluation"] * 3


def test_a_crashing_episode_is_left_out(tmp_path: Path, processes, monkeypatch: pytest.MonkeyPatch) -> None:
    processes(2)
    monkeypatch.setenv(
        "PYTHONPATH", f"{Path(__file__).parent / 'crashing_rollouts'}:{os.environ.get('PYTHONPATH', '')}"
    )
    listener = Listener()
    outcome = execute_run(spec("archive", 6), tmp_path, listener)
    assert outcome.finished
    assert [record.reason == "sim_crash" for record in listener.records] == [index == 2 for index in range(6)]


class Mapped(Listener):
    """Reads after each episode which libraries the rollout processes have loaded."""

    maps = ""

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        super().episode(record, metrics, series)
        for process in psutil.Process().children():
            self.maps += Path(f"/proc/{process.pid}/maps").read_text()


def test_a_script_is_driven_without_torch(tmp_path: Path, processes) -> None:
    processes(1)
    listener = Mapped()
    execute_run(spec("archive", 6), tmp_path, listener)
    assert "libsumo" in listener.maps
    assert "torch" not in listener.maps


def test_a_process_that_needs_too_much_memory_says_what_it_may_take() -> None:
    own, other = Pipe()
    code = f"""
import sys
import risk_sac.search.rollouts as rollouts
from risk_sac.host.machine import limit_memory
limit_memory(1 << 30)
rollouts.serve = lambda *_: bytearray(1 << 31)
sys.argv = ["", "{other.fileno()}", "", "0"]
rollouts.main()
"""
    with own, other:
        assert subprocess.run([sys.executable, "-c", code], pass_fds=[other.fileno()], check=False).returncode == 0
        assert own.recv() == (
            "it needs more memory than the 1 GiB that each process of a run may take; "
            "wanted a larger RISK_SAC_WORKER_MEMORY_BYTES"
        )


def test_each_server_of_a_remote_ego_sees_the_episodes_of_one_process(
    tmp_path: Path, processes, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("grpc")
    processes(3)
    folders = [tmp_path / name for name in ("first", "second")]
    file, listener = tmp_path / "egos.toml", Listener()
    monkeypatch.setenv("RISK_SAC_EGOS", str(file))
    with ExitStack() as stack:
        tables = []
        for folder in folders:
            folder.mkdir()
            tables.append(stack.enter_context(served("tests.ego_processes:Noting", folder, deadline_s=60)))
        addresses = ",".join(tomllib.loads(table)["address"] for table in tables)
        file.write_text(f"[far]\n{tables[0]}".replace(tomllib.loads(tables[0])["address"], addresses))
        remote = spec("archive", 8, batch=8).model_copy(update={"ego": EgoConfig(driver="far")})
        outcome = execute_run(remote, tmp_path / "run", listener)
    played = [set(map(int, (folder / "ego.log").read_text().split()[1:])) for folder in folders]  # 0: the warming up
    assert all(played)
    assert not played[0] & played[1]
    assert len(played[0] | played[1]) == sum(record.outcome != "rejected" for record in listener.records)
    assert outcome.processes == 2
    assert "rounds of 8 episodes are played by 2 process(es): the ego 'far' allows no more instances" in caplog.text
