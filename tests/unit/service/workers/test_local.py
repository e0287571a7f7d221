import os
import signal
import time

import psutil
import pytest

from risk_sac.config import RunSpec
from service.settings import ServiceSettings
from service.workers.executor import Cause, Exited
from service.workers.local import LocalExecutor
from service.workers.messages import Failed, Finished, Started

SPEC = RunSpec(family="low", method="random", seed=0)
READ = """
import json, os, signal, sys, time
def say(**word):
    os.write(1, json.dumps(word).encode() + b'\\n')  # in one piece, whatever another thread says
sys.stdin.readline()
"""
BEAT = """
import threading
def beat():
    while True:
        say(type='heartbeat'); time.sleep(0.1)
threading.Thread(target=beat, daemon=True).start()
"""
STARTED = "say(type='started', pid=os.getpid())\n"
FAILED = "say(type='failed', reason='no')\n"


class Workers:
    """An executor whose worker is a piece of Python."""

    def __init__(self, folder, monkeypatch):
        self.folder = folder
        monkeypatch.setenv("PYTHONPATH", str(folder))

    def start(self, code, **settings):
        (self.folder / "piece.py").write_text(READ + code)
        self.executor = LocalExecutor(ServiceSettings(worker_module="piece", **{"grace_s": 0.5} | settings))
        self.executor.submit(1, SPEC, self.folder / "run")

    def messages(self, timeout_s=30):
        """Everything that the worker says, to its end."""
        messages = []
        deadline = time.monotonic() + timeout_s
        while not messages or not isinstance(messages[-1], Exited):
            assert time.monotonic() < deadline
            messages += [message for _, message in self.executor.events(0.05)]
        self.executor.cancel(1, 1)  # of a run that has ended: ignored
        return messages

    def execute(self, code, **settings):
        self.start(code, **settings)
        return self.messages()

    def started(self):
        """Process of a worker whose first word was that it has started."""
        (started,) = self.executor.events(20)
        assert isinstance(started[1], Started)
        return started[1].pid


@pytest.fixture
def workers(tmp_path, monkeypatch):
    return Workers(tmp_path, monkeypatch)


@pytest.mark.parametrize(
    ("code", "exited"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", Exited("worker was killed by SIGSEGV", Cause.CRASHED)),
        ("os.kill(os.getpid(), 40)", Exited("worker was killed by signal 40", Cause.CRASHED)),
        ("os.kill(os.getpid(), signal.SIGKILL)", Exited("worker was killed by SIGKILL", Cause.KILLED)),
        ("os.kill(os.getpid(), signal.SIGTERM)", Exited("worker was killed by SIGTERM", Cause.KILLED)),
        ("sys.exit(4)", Exited("worker exited with status 4: it left no message", Cause.CRASHED)),
        ("sys.exit('first\\nlast')", Exited("worker exited with status 1: first | last", Cause.CRASHED)),
        ("pass", Exited("worker left without a word", Cause.CRASHED)),
        ("print('{}')", Exited("worker wrote b'{}\\n' where an event was wanted", Cause.CRASHED)),
    ],
)
def test_the_last_message_says_why_the_worker_is_gone(workers, code, exited):
    assert workers.execute(code) == [exited]


def test_a_worker_that_lingers_after_its_last_word_is_killed(workers):
    assert workers.execute(FAILED + "time.sleep(60)") == [
        Failed(reason="no"),
        Exited("worker was killed by SIGKILL", Cause.ENDED),
    ]


def test_a_worker_that_stops_although_nobody_asked_was_killed_by_somebody_else(workers, metrics):
    stopped = Finished(finished=False, metrics=metrics, evaluation=None, digest="", versions={}, wall_s=1.0)
    code = f"print({stopped.model_dump_json()!r})"
    assert workers.execute(code) == [stopped, Exited("worker was told to stop by somebody else", Cause.KILLED)]
    finished = stopped.model_copy(update={"finished": True})
    assert workers.execute(f"print({finished.model_dump_json()!r})") == [finished, Exited(None, Cause.ENDED)]


def test_a_cancelled_worker_that_does_not_care_is_killed_after_the_shortest_grace(workers):
    workers.start(BEAT + "signal.signal(15, signal.SIG_IGN)\n" + STARTED + "time.sleep(60)")
    workers.started()
    workers.executor.cancel(1, 50)
    workers.executor.cancel(1, 0.5)
    workers.executor.cancel(1, 60)
    asked_at = time.monotonic()
    assert workers.messages() == [Exited("worker was killed by SIGKILL", Cause.ENDED)]
    assert time.monotonic() - asked_at > 0.4


def test_a_stopped_worker_is_lost_within_5_s_although_it_cannot_end(workers):
    workers.start(BEAT + STARTED + "time.sleep(60)")
    pid = workers.started()
    os.kill(pid, signal.SIGSTOP)
    stopped_at = time.monotonic()
    assert workers.messages() == [Exited("worker gave no sign of life for 4 s", Cause.STOPPED)]
    assert time.monotonic() - stopped_at < 5
    assert not psutil.pid_exists(pid)


def test_a_stopped_worker_can_be_cancelled(workers):
    workers.start(BEAT + STARTED + "time.sleep(60)")
    os.kill(workers.started(), signal.SIGSTOP)
    workers.executor.cancel(1, 0.5)
    assert [message.cause for message in workers.messages()] == [Cause.ENDED]


def test_a_worker_that_holds_its_interpreter_up_with_work_keeps_its_lease(workers):
    busy = "sum(range(5 * 10**7))\n"  # one call into C, so that no other thread gets a turn
    assert workers.execute(BEAT + STARTED + busy + FAILED, lease_s=0.6)[1:] == [
        Failed(reason="no"),
        Exited(None, Cause.ENDED),
    ]


def test_a_worker_that_finishes_no_episode_is_lost(workers):
    code = BEAT + "time.sleep(60)"
    assert workers.execute(code, stall_s=1.0) == [Exited("worker finished no episode for 1 s", Cause.STOPPED)]


def test_what_a_lost_worker_started_goes_with_it(workers):
    code = "import subprocess; print(subprocess.Popen(['sleep', '60']).pid, file=sys.stderr, flush=True)\n"
    workers.execute(code + "time.sleep(60)", lease_s=1.0)
    child = int((workers.folder / "run" / "worker.log").read_text())
    deadline = time.monotonic() + 10
    while psutil.pid_exists(child) and psutil.Process(child).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_lost_worker_takes_no_other_along(workers):
    until_told = "while not os.path.exists(sys.argv[1] + '/end'): time.sleep(0.02)\n"
    workers.start(BEAT + STARTED + until_told + FAILED)
    lost = workers.started()
    workers.executor.submit(2, SPEC, workers.folder / "other")
    workers.started()
    os.kill(lost, signal.SIGKILL)
    assert workers.executor.events(20) == [(1, Exited("worker was killed by SIGKILL", Cause.KILLED))]
    (workers.folder / "other" / "end").touch()
    messages = []
    while len(messages) < 2:
        messages += workers.executor.events(20)
    assert messages == [(2, Failed(reason="no")), (2, Exited(None, Cause.ENDED))]


def test_a_worker_computes_with_one_thread_in_its_own_folder_and_hears_how_nice_to_be(workers):
    seen = workers.folder / "seen"
    code = f"open({str(seen)!r}, 'w').write(' '.join([os.environ['OMP_NUM_THREADS'], *sys.argv[1:]]))"
    workers.execute(code, worker_niceness=7)
    assert seen.read_text() == f"1 {workers.folder / 'run'} 7"
    assert (workers.folder / "run" / "worker.log").exists()


def test_a_folder_that_cannot_be_made_is_an_os_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NotADirectoryError):
        LocalExecutor(ServiceSettings()).submit(1, SPEC, tmp_path / "file" / "run")
