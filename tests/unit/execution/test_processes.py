import psutil
import pytest

from risk_sac.config import RunSpec
from risk_sac.execution.executor import Program
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.processes import ATTEMPTS, LOG, Job, Queue

SPEC = RunSpec(family="low", method="random", seed=0)
BEGIN = """
import os, signal, sys, time
def tell(name, text):
    with open(os.path.join(sys.argv[1], name), 'a') as file:
        file.write(text + '\\n')
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


def execute(code, job, progress=lambda jobs: None, stopping=lambda: False):
    program = Program(arguments=lambda spec, folder: ["-c", BEGIN + code, str(folder)], log=LOG, hear=None)
    Queue([job], LocalExecutor(program), progress).execute(1, stopping)


def has_begun(job):
    return (job.folder / "pid").exists() and (job.folder / "pid").read_text().endswith("\n")


def test_no_process_outlives_an_interrupt(job):
    def progress(jobs):
        if has_begun(job):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        execute(STOPS.replace("os._exit(0)", "0") + WAITS, job, progress)
    assert not psutil.pid_exists(int((job.folder / "pid").read_text()))


def test_a_run_that_is_told_to_stop_may_take_its_time(job):
    execute(STOPS + WAITS, job, stopping=lambda: has_begun(job))
    assert (job.folder / "told").read_text() == "to stop\n"  # once
    assert (job.folder / "left").exists()
    assert (job.state, job.reason) == ("stopped", "stopped after 0 of 300 episodes")


@pytest.mark.parametrize(
    ("code", "attempts", "reason"),
    [
        ("tell('tries', ''); sys.exit('no')", ATTEMPTS, "ended with status 1 after 0 of 300 episodes: no (see "),
        (
            "tell('tries', ''); print('bad spec'); sys.exit(2)",
            1,
            "ended with status 2 after 0 of 300 episodes: bad spec",
        ),
        (
            "tell('tries', ''); os.kill(os.getpid(), 40)",
            ATTEMPTS,
            "killed by signal 40 after 0 of 300 episodes: it said",
        ),
        ("tell('tries', '')", ATTEMPTS, "ended with status 0 after 0 of 300 episodes: it said nothing"),
    ],
)
def test_a_run_is_tried_as_often_as_there_is_hope(job, code, attempts, reason):
    execute(code, job)
    assert (job.state, job.attempts) == ("failed", attempts)
    assert job.reason.startswith(reason)
    assert len((job.folder / "tries").read_text().splitlines()) == attempts


def test_a_run_whose_folder_is_in_the_way_fails(job):
    job.folder.write_text("")
    execute("", job)
    assert job.state == "failed"
    assert "File exists" in job.reason
