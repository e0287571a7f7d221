import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from risk_sac.execution.helper import ANSWER, QUESTION, run_helper

LONG_S = 60
CHILD = "import os, subprocess, sys, time; child = subprocess.Popen(['sleep', '60'])\n"
TELL_CHILD = "open(sys.argv[1], 'w').write(str(child.pid))\n"


@pytest.fixture
def run(tmp_path):
    def run(code, *arguments, wall_s=LONG_S, **options):
        program = tmp_path / "program.py"
        program.write_text(code)
        return run_helper(str(program), arguments, wall_s=wall_s, **options)

    return run


def wait_until_gone(pid):
    deadline = time.monotonic() + LONG_S
    with contextlib.suppress(psutil.NoSuchProcess):
        while psutil.Process(pid).status() != psutil.STATUS_ZOMBIE:
            assert time.monotonic() < deadline
            time.sleep(0.02)


def test_what_a_helper_prints_does_not_disturb_its_answer(run):
    code = "import sys; print('noise'); open(sys.argv[2], 'wb').write(open(sys.argv[1], 'rb').read() + b'!')"
    result = run(code, QUESTION, ANSWER, question=b"\x00asked")
    assert (result.status, result.answer, result.log) == (0, b"\x00asked!", "noise")


def test_a_helper_that_takes_too_long_is_killed_with_all_that_it_started(run):
    result = run(CHILD + TELL_CHILD + "time.sleep(60)", ANSWER, wall_s=3)
    assert (result.status, result.timed_out) == (-9, True)
    wait_until_gone(int(result.answer))


def test_what_a_helper_leaves_behind_is_killed(run):
    wait_until_gone(int(run(CHILD + TELL_CHILD, ANSWER).answer))


def test_a_helper_that_is_not_wanted_any_more_is_killed(run, tmp_path):
    code = "import time; open('begun', 'w').close(); time.sleep(60)"
    result = run(code, cwd=tmp_path, stopping=(tmp_path / "begun").exists)
    assert (result.status, result.timed_out) == (-9, False)


@pytest.mark.parametrize("number", [9, 15, 11, 19])
def test_a_helper_that_a_signal_ends_or_stops_is_started_again(run, tmp_path, monkeypatch, number):
    monkeypatch.setattr("risk_sac.execution.helper.STOPPED_S", 0.3)
    code = f"""
import os, sys
tries = len(os.listdir()) + 1
open(str(tries), 'w').close()
open(sys.argv[1], 'w').write('half' if tries < 3 else 'whole')
os.kill(os.getpid(), {number}) if tries < 3 else None
"""
    (tmp_path / "tries").mkdir()
    result = run(code, ANSWER, cwd=tmp_path / "tries")
    assert (result.status, result.answer) == (0, b"whole")


def test_a_helper_that_signals_end_again_and_again_is_given_up(run):
    result = run("import os; print('x'); os.kill(os.getpid(), 9)")
    assert (result.status, result.reason) == (-9, "its process was ended by SIGKILL, 3 times in a row")


def test_a_helper_is_nicer_and_has_the_memory_that_it_is_given(run):
    result = run("import os; print(os.nice(0), flush=True); bytearray(1 << 30)", niceness=3, memory_bytes=1 << 29)
    assert result.log.startswith(f"{os.nice(0) + 3}\n")
    assert result.log.endswith("MemoryError")


def test_a_helper_and_its_children_leave_with_a_starter_that_is_killed(tmp_path):
    program, told = tmp_path / "program.py", tmp_path / "told"
    tell = "open('new', 'w').write(f'{os.getpid()} {child.pid}'); os.rename('new', 'told'); time.sleep(60)"
    program.write_text(CHILD + tell)
    code = f"from risk_sac.execution.helper import run_helper; run_helper({str(program)!r}, [], wall_s=60)"
    starter = subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path)
    deadline = time.monotonic() + LONG_S
    while not told.exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)
    starter.kill()
    starter.wait()
    for pid in told.read_text().split():
        wait_until_gone(int(pid))


def test_an_isolated_helper_imports_nothing_from_its_working_directory(tmp_path):
    (tmp_path / "json.py").write_text("print('mine')")
    result = run_helper("json.tool", ["--help"], wall_s=LONG_S, isolated=True, cwd=tmp_path)
    assert "mine" not in result.log


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
