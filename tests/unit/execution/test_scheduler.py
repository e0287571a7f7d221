"""The scheduler with the jobs of `evaluate` and real processes of this machine."""

import psutil
import pytest

from risk_sac.config import RunSpec
from risk_sac.execution.executor import FOLDER, WorkerProgram
from risk_sac.execution.jobs import LOG, Job, execute
from risk_sac.execution.local import LocalExecutor

SPEC = RunSpec(family="low", method="random", seed=0)
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
