import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.server import LONG_S

# Holds the folder in its argument until its stdin ends.
HOLDER = """
import sys
from pathlib import Path
from risk_sac.execution import worker
worker.PATIENCE_S = 0.3
with worker.take_over(Path(sys.argv[1])):
    print("holds", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def start(tmp_path, monkeypatch):
    (tmp_path / "holder.py").write_text(HOLDER)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), str(Path(__file__).parents[3])]))
    processes = []

    def start(folder):
        folder.mkdir(exist_ok=True)
        command = [sys.executable, "-m", "holder", str(folder)]
        processes.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE))
        return processes[-1]

    yield start
    for process in processes:
        process.kill()
        process.communicate()


def test_a_worker_waits_for_the_one_before_it_to_leave(start, tmp_path):
    first = start(tmp_path / "run")
    assert first.stdout.readline() == b"holds\n"
    second = start(tmp_path / "run")
    first.terminate()
    assert second.stdout.readline() == b"holds\n"
    assert first.wait(LONG_S) == -signal.SIGTERM


def test_a_worker_that_was_stopped_when_its_server_died_is_killed_and_no_other(start, tmp_path):
    stopped, other = start(tmp_path / "run"), start(tmp_path / "other")
    for process in (stopped, other):
        assert process.stdout.readline() == b"holds\n"
        process.send_signal(signal.SIGSTOP)
    assert start(tmp_path / "run").stdout.readline() == b"holds\n"
    assert stopped.wait(LONG_S) == -signal.SIGKILL
    assert other.poll() is None
