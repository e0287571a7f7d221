"""Speed of rounds with more processes, beside what this machine can do.

With an ego that waits 20 ms a step the processes hardly need processors: 16 of them are to be 14 times as fast as one.
That takes two idle cores, since a step of the simulation takes one about 2 ms.
"""

import os
import subprocess
import sys
import time
import tomllib
from contextlib import ExitStack
from pathlib import Path

import pytest

from risk_sac.config import Budget, EgoConfig, RunSpec
from risk_sac.host.machine import ROLLOUTS, cores
from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.search.loop import execute_run
from tests.ego_processes import served
from tests.listener import Listener

BATCH, EPISODES, WARM = 8, 160, 32  # the first episodes start the processes and compile
SLOW_PROCESSES = 16
BARE_STEPS = 30_000
BARE = f"""
import sys, time
from contextlib import closing
import libsumo
from risk_sac.env.env import make_default
with closing(make_default("low")) as env:
    env.reset(seed=0)
    print("ready", flush=True)
    sys.stdin.readline()
    for _ in range({BARE_STEPS}):
        libsumo.simulationStep()
"""


class Watch(Listener):
    """Times the episodes after the first ones."""

    def __init__(self, warm: int) -> None:
        super().__init__()
        self._warm = warm
        self.began_s = 0.0

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        super().episode(record, metrics, series)
        if record.index == self._warm - 1:
            self.began_s = time.perf_counter()


def steps_per_s(folder: Path, processes: int, budget: Budget, ego: EgoConfig, warm: int) -> float:
    """Environment steps per second of an archive search after `warm` episodes."""
    os.environ[ROLLOUTS] = str(processes)
    watch = Watch(warm)
    execute_run(RunSpec(family="low", method="archive", seed=3, ego=ego, budget=budget), folder, watch)
    return sum(record.steps for record in watch.records[warm:]) / (time.perf_counter() - watch.began_s)


def bare_steps_per_s(processes: int) -> float:
    """Steps per second of `processes` simulations that do nothing else."""
    with ExitStack() as stack:
        started = [
            stack.enter_context(
                subprocess.Popen([sys.executable, "-c", BARE], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            )
            for _ in range(processes)
        ]
        for one in started:
            assert one.stdout is not None
            one.stdout.readline()
        began_s = time.perf_counter()
        for one in started:
            assert one.stdin is not None
            one.stdin.close()
        assert [one.wait() for one in started] == [0] * processes
        return processes * BARE_STEPS / (time.perf_counter() - began_s)


@pytest.mark.bench
def test_processes_of_a_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ROLLOUTS, "1")
    counts = [number for number in (1, 2, 4, 8, 16, 32, 64) if number <= cores()]
    budget = Budget(episodes=EPISODES, batch=BATCH)
    ours = {number: steps_per_s(tmp_path / str(number), number, budget, EgoConfig(), WARM) for number in counts}
    bare = {number: bare_steps_per_s(number) for number in counts}
    for number in counts:
        print(
            f"\n{number} processes: {ours[number]:.0f} steps/s, {ours[number] / ours[1]:.2f} times one process; "
            f"bare libsumo {bare[number] / bare[1]:.2f} times"
        )
    assert all(ours[number] > 0.0 for number in counts)


@pytest.mark.bench
def test_processes_of_a_run_with_a_slow_ego(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(ROLLOUTS, "1")
    monkeypatch.setenv("RISK_SAC_EGOS", str(tmp_path / "egos.toml"))
    with served("tests.ego_processes:Slow", tmp_path, deadline_s=60) as table:  # one server plays all sessions
        address = tomllib.loads(table)["address"]
        (tmp_path / "egos.toml").write_text("[slow]\n" + table.replace(address, ",".join([address] * SLOW_PROCESSES)))
        rates = {}
        for number, episodes, warm in ((1, 8, 2), (SLOW_PROCESSES, 96, 40)):
            budget = Budget(episodes=episodes, batch=SLOW_PROCESSES)
            rates[number] = steps_per_s(tmp_path / str(number), number, budget, EgoConfig(driver="slow"), warm)
    one, many = rates.values()
    print(f"\n20 ms a step: {one:.1f} steps/s by 1 process, {many:.1f} by {SLOW_PROCESSES}, {many / one:.1f} times")
    assert many > one
