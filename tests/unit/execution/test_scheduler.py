"""Scheduler with the jobs of `evaluate` and real processes of this machine."""

import math

import psutil
import pytest

from risk_sac.config import Budget, EgoConfig, RunSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import FOLDER, WorkerProgram
from risk_sac.execution.jobs import LOG, Job, JobStore, execute
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.scheduler import Scheduler, SlotUse
from risk_sac.host.machine import ROLLOUTS

SPEC = RunSpec(family="low", method="random", seed=0)
ROUNDS = SPEC.model_copy(update={"budget": Budget(episodes=100, batch=8)})
BEGIN = """
import os, signal, sys, time
def tell(name, text):
    with open(os.path.join(sys.argv[1], name), 'a') as file:
        file.write(text + '\\n')
tell('tries', '')
"""
STOPS = """
def stop(number, frame):
    tell('told', 'to stop'); time.sleep(0.5); tell('left', ''); os._exit(0)
signal.signal(signal.SIGTERM, stop)
"""
WAITS = "tell('pid', str(os.getpid())); time.sleep(60)"


@pytest.fixture
def job(tmp_path):
    return Job(spec=SPEC, folder=tmp_path / "run")


def run(code, job, progress=lambda jobs: None, stopping=lambda: False):
    program = WorkerProgram(arguments=("-c", BEGIN + code, FOLDER), log=LOG)
    execute([job], LocalExecutor(program), 1, progress, stopping)


def has_begun(job):
    return (job.folder / "pid").exists() and (job.folder / "pid").read_text().endswith("\n")


def test_no_process_outlives_an_interrupt(job):
    def progress(jobs):
        if has_begun(job):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(STOPS.replace("os._exit(0)", "0") + WAITS, job, progress)
    assert not psutil.pid_exists(int((job.folder / "pid").read_text()))


def test_a_run_that_is_told_to_stop_may_take_its_time(job):
    run(STOPS + WAITS, job, stopping=lambda: has_begun(job))
    assert (job.folder / "told").read_text() == "to stop\n"  # once
    assert (job.folder / "left").exists()
    assert (job.state, job.reason) == ("stopped", "stopped after 0 of 300 episodes")


@pytest.mark.parametrize(
    ("spec", "free", "taken", "waiting", "most", "slots"),
    [
        (SPEC, 4, {}, [""], math.inf, 1),  # one episode at a time
        (ROUNDS, 16, {}, [""], math.inf, 8),  # all that it can use
        (ROUNDS, 3, {"": 5}, [""], math.inf, 3),  # all that is free
        (ROUNDS, 8, {}, ["", "other"], math.inf, 4),  # its project's share
        (ROUNDS, 5, {"other": 3}, [""], math.inf, 4),
        (ROUNDS, 2, {"": 6, "other": 2}, [""], math.inf, 1),  # beyond the share, since no other run waits
        (ROUNDS, 1, {"other": 7}, ["", "third"], math.inf, 1),
        (ROUNDS, 8, {}, [""], 2, 2),  # all that one run may take
        (ROUNDS.model_copy(update={"ego": EgoConfig(driver="gone")}), 8, {}, [""], math.inf, 1),
    ],
)
def test_a_run_takes_the_slots_that_are_free_within_its_share(spec, free, taken, waiting, most, slots):
    assert SlotUse(free=free, taken=taken, most=most).granted(spec, "", waiting) == slots


class Listing:
    """An executor that only lists what is submitted."""

    slots, cluster = math.inf, None

    def __init__(self):
        self.submitted = []

    def submit(self, number, spec, folder, slots):
        self.submitted.append((number, slots))


@pytest.mark.parametrize(
    ("limit", "submitted"), [("", [(0, 1), (1, 8), (2, 1)]), ("3", [(0, 1), (1, 3), (2, 3), (3, 3)])]
)
def test_runs_share_the_slots(tmp_path, monkeypatch, limit, submitted):
    monkeypatch.setenv(ROLLOUTS, limit)
    executor = Listing()
    jobs = [Job(spec=spec, folder=tmp_path / str(n)) for n, spec in enumerate((SPEC, ROUNDS, ROUNDS, ROUNDS))]
    Scheduler(executor, JobStore(jobs), 1).fill(10)
    assert executor.submitted == submitted


def test_a_limit_that_is_none_is_refused_before_anything_starts(monkeypatch):
    monkeypatch.setenv(ROLLOUTS, "many")
    with pytest.raises(ConfigError, match="RISK_SAC_ROLLOUTS: got 'many'; wanted an integer, 1 or more"):
        Scheduler(Listing(), JobStore([]), 1)
