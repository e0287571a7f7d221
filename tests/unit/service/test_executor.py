import sys
import time

import pytest

from risk_sac.config import RunSpec
from service.events import Failed
from service.executor import Exited, LocalExecutor

SPEC = RunSpec(family="low", method="random", seed=0)
READ = "import os, signal, sys; sys.stdin.readline(); "


@pytest.fixture
def execute(tmp_path, monkeypatch):
    """Runs a line of Python as the worker; returns all its messages."""

    def run(code, cancel=False):
        (tmp_path / "one_liner.py").write_text(READ + code)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        executor = LocalExecutor("one_liner", grace_s=0.5)
        executor.submit(1, SPEC, tmp_path / "run")
        if cancel:
            executor.cancel(1)
            executor.cancel(1)
        messages = []
        deadline = time.monotonic() + 20
        while not messages or not isinstance(messages[-1], Exited):
            assert time.monotonic() < deadline
            messages += [message for _, message in executor.events(0.1)]
        executor.cancel(1)  # of a run that has ended: ignored
        return messages

    return run


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", "worker was killed by SIGSEGV"),
        ("os.kill(os.getpid(), 40)", "worker was killed by signal 40"),
        ("sys.exit(4)", "worker exited with status 4: it left no message"),
        ("sys.exit('first\\nlast')", "worker exited with status 1: first | last"),
        ("pass", None),
        ("print('{}')", "worker wrote b'{}\\n' where an event was wanted"),
    ],
)
def test_the_last_message_says_why_the_worker_is_gone(execute, code, reason):
    assert execute(code) == [Exited(reason)]


def test_a_worker_that_lingers_after_its_last_word_is_killed(execute):
    code = """print('{"type":"failed","reason":"no"}', flush=True); import time; time.sleep(60)"""
    assert execute(code) == [Failed(reason="no"), Exited("worker was killed by SIGKILL")]


def test_a_cancelled_worker_that_does_not_care_is_killed(execute):
    code = "import time; signal.signal(15, signal.SIG_IGN); time.sleep(60)"
    (exited,) = execute(code, cancel=True)
    assert exited.reason in ("worker was killed by SIGKILL", "worker was killed by SIGTERM")


def test_a_worker_computes_with_one_thread_in_its_own_folder(execute, tmp_path):
    code = f"open({str(tmp_path / 'seen')!r}, 'w').write(os.environ['OMP_NUM_THREADS'] + ' ' + sys.argv[1])"
    execute(code)
    assert (tmp_path / "seen").read_text() == f"1 {tmp_path / 'run'}"
    assert (tmp_path / "run" / "worker.log").exists()


def test_a_folder_that_cannot_be_made_is_an_os_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError):
        LocalExecutor(sys.executable, grace_s=1).submit(1, SPEC, tmp_path / "file" / "run")
