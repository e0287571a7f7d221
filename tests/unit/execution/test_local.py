"""What is so of processes of this machine, beyond what every executor must pass."""

import time

import psutil
import pytest

from risk_sac.config.campaign import Requirement
from risk_sac.execution.executor import Cause, Exited, Program
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.messages import Heard
from tests.contract.executor_contract import ALIVE, SPEC, Runs, outcome


@pytest.fixture
def runs(tmp_path, request):
    started = Runs(LocalExecutor, tmp_path, **getattr(request, "param", {}))
    yield started
    started.close()


def patience(**settings):
    return pytest.mark.parametrize("runs", [settings], indirect=True)


@pytest.mark.parametrize(
    ("code", "exited"),
    [
        ("os.kill(os.getpid(), signal.SIGSEGV)", Exited("worker was killed by SIGSEGV", Cause.CRASHED, -11)),
        ("os.kill(os.getpid(), 40)", Exited("worker was killed by signal 40", Cause.CRASHED, -40)),
        ("os.kill(os.getpid(), signal.SIGKILL)", Exited("worker was killed by SIGKILL", Cause.KILLED, -9)),
        ("os.kill(os.getpid(), signal.SIGTERM)", Exited("worker was killed by SIGTERM", Cause.KILLED, -15)),
        ("sys.exit(4)", Exited("worker exited with status 4: it left no message", Cause.CRASHED, 4)),
        ("sys.exit('first\\nlast')", Exited("worker exited with status 1: first | last", Cause.CRASHED, 1)),
        ("pass", Exited("worker left without a word", Cause.CRASHED, 0)),
        ("os.write(words, b'{}\\n')", Exited("worker wrote b'{}\\n' where an event was wanted", Cause.CRASHED, 0)),
        ("os.write(words, b'{}')", Exited("worker left without a word", Cause.CRASHED, 0)),
        ("print('noise')", Exited("worker left without a word", Cause.CRASHED, 0)),
    ],
)
def test_the_last_message_says_why_the_worker_is_gone(runs, code, exited):
    runs.submit(code)
    ((_, found),) = runs.messages()
    # A worker that said what it may not is killed, if it has not left by then.
    status = -9 if exited.reason.startswith("worker wrote") and found.status == -9 else exited.status
    assert found == Exited(exited.reason, exited.cause, status)


@patience(linger_s=0.5)
def test_a_worker_that_cannot_be_heard_any_more_is_killed(runs):
    runs.submit("os.close(words); time.sleep(60)")
    assert [message for _, message in runs.messages()] == [Exited("worker was killed by SIGKILL", Cause.KILLED, -9)]


@patience(lease_s=1.2)
def test_a_worker_that_holds_its_interpreter_up_with_work_keeps_its_lease(runs):
    busy = "sum(range(2 * 10**8))\n"  # one call into C, so that no other thread gets a turn, and longer than the lease
    runs.submit(ALIVE + busy + "say('last')")
    assert outcome(runs.messages()) == (["last"], Cause.ENDED)


@patience(lease_s=1.0)
def test_what_a_lost_worker_started_goes_with_it(runs):
    runs.submit("import subprocess; say(str(subprocess.Popen(['sleep', '60']).pid)); time.sleep(60)")
    _, child = runs.first()
    assert [message.cause for _, message in runs.messages()] == [Cause.STOPPED]
    deadline = time.monotonic() + 10
    while psutil.pid_exists(int(child)) and psutil.Process(int(child)).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def large_run():
    """A run that no pipe holds."""
    requirement = Requirement.model_construct(name="r", formula="x" * 300_000, scale=1.0)
    return SPEC.model_copy(update={"requirements": (requirement,)})


def execute(code, folder, **program):
    executor = LocalExecutor(Program(arguments=("-c", code), log="log", **program))
    executor.submit(1, large_run(), folder)
    return executor


def test_a_worker_that_reads_late_gets_all_of_its_run(tmp_path):
    code = (
        "import os, sys, time; time.sleep(1);"
        "os.write(int(os.environ['RISK_SAC_WORDS']), b'%d\\n' % len(sys.stdin.readline()))"
    )
    executor = execute(code, tmp_path, hear=lambda line: Heard(int(line), last=True))
    assert read(executor) == [len(large_run().model_dump_json()) + 1, Exited(None, Cause.ENDED, 0)]


def test_a_worker_that_is_stopped_before_it_reads_its_run_is_lost(tmp_path):
    executor = execute("import os; os.kill(os.getpid(), 19)", tmp_path, hear=Heard, lease_s=1.0)
    assert read(executor) == [Exited("worker gave no sign of life for 1 s", Cause.STOPPED, -9)]


def read(executor):
    told, deadline = [], time.monotonic() + 30
    while not told or not isinstance(told[-1], Exited):
        assert time.monotonic() < deadline
        told += [message for _, message in executor.events(1)]
    return told
