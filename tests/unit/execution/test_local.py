"""Processes of this machine, beyond what every executor must pass."""

import contextlib
import json
import math
import time
from pathlib import Path

import psutil
import pytest
from pydantic import ValidationError

from risk_sac.config.campaign import Requirement
from risk_sac.execution.executor import Cause, Exited, WorkerProgram
from risk_sac.execution.local import Lease, LocalExecutor, Signs
from risk_sac.execution.messages import (
    Failed,
    Finished,
    Heard,
    Heartbeat,
    Started,
    WorkerLog,
    decode,
    encode,
    without_folders,
)
from risk_sac.records import Outcome
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
    with contextlib.suppress(psutil.NoSuchProcess):
        while psutil.Process(int(child)).status() != psutil.STATUS_ZOMBIE:
            assert time.monotonic() < deadline
            time.sleep(0.05)


def large_run():
    """A run that no pipe holds."""
    requirement = Requirement.model_construct(name="r", formula="x" * 300_000, scale=1.0)
    return SPEC.model_copy(update={"requirements": (requirement,)})


def execute(code, folder, **program):
    executor = LocalExecutor(WorkerProgram(arguments=("-c", code), log="log", **program))
    executor.submit(1, large_run(), folder, 1)
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


FOREVER = 1e9


def seconds_until_lost(lease, signs, watched_s=0.2):
    """Time until a worker with these signs is lost; the last repeats."""
    signs = list(signs)
    for count in range(1, 1000):
        if lease.passed(watched_s, signs.pop(0) if len(signs) > 1 else signs[0]):
            return round(count * watched_s, 6)
    return None


def test_a_worker_that_neither_speaks_nor_works_is_lost_after_its_lease():
    assert seconds_until_lost(Lease(4.0, FOREVER), [Signs()]) == 4.0


def test_words_and_processor_time_are_signs_of_life():
    speaks = [Signs(words=count) for count in range(1, 51)]
    works = [Signs(processor_s=0.01 * count) for count in range(1, 51)]
    for signs in (speaks, works):
        assert seconds_until_lost(Lease(4.0, FOREVER), signs) == 50 * 0.2 + 4.0


def test_a_worker_that_stays_busy_without_an_episode_is_lost_when_it_stalls():
    busy = [Signs(words=count, processor_s=float(count)) for count in range(1000)]
    assert seconds_until_lost(Lease(4.0, 60.0), busy) == 60.0


def test_time_that_nobody_watched_is_not_held_against_a_worker():
    lease = Lease(4.0, FOREVER)
    lease.passed(3.9, Signs())
    assert lease.passed(0.0, Signs()) is None


@pytest.mark.parametrize(
    ("said", "told"),
    [
        ('File "/opt/venv/lib/torch/nn.py", line 3, in f', 'File "nn.py", line 3, in f'),
        ("OSError: [Errno 28] No space left: '/srv/data/c1/run/a.json'", "OSError: [Errno 28] No space left: 'a.json'"),
        ("data/c1/run/results.json is damaged", "results.json is damaged"),
        ("folder 'data/c1/run' is in use", "folder 'run' is in use"),
        ("/data is full", "data is full"),
        ("4 m/s, 1 / 2 and https://a.example/b/c", "4 m/s, 1 / 2 and https://a.example/b/c"),
    ],
)
def test_a_text_keeps_the_names_of_files_and_no_folders(said, told):
    assert without_folders(said, Path("data/c1/run")) == told


def test_the_last_lines_of_a_log_are_told_without_folders(tmp_path):
    log = tmp_path / "worker.log"
    log.write_text(f'an older worker\'s\nTraceback:\n  File "{log}", line 1\nValueError: no\n')
    assert (
        WorkerLog(log, len("an older worker's\n")).tail() == 'Traceback: | File "worker.log", line 1 | ValueError: no'
    )


def test_every_event_survives_the_wire(episode, metrics):
    finished = Finished(finished=True, metrics=metrics, evaluation=None, digest="d", versions={"sumo": "1"}, wall_s=1.5)
    contact = episode(1, Outcome.FAILURE).model_copy(update={"series_sha256": "0" * 64})
    for event in (Started(pid=3), Heartbeat(), contact, episode(0), finished, Failed(reason="no", storage=True)):
        assert decode(encode(event)).model_dump_json() == event.model_dump_json()  # a NaN is unequal to itself


def test_numbers_that_are_not_finite_survive_as_strict_json(episode):
    line = encode(episode(0, Outcome.FAILURE))

    def refuse(constant):
        raise AssertionError(constant)

    json.loads(line, parse_constant=refuse)
    record = decode(line).record
    assert record.min_ttc_s == math.inf
    assert math.isnan(record.collision.early_min_ttc_s)
    assert record.collision.early_min_robustness == -math.inf


@pytest.mark.parametrize(
    "line", [b"", b"\n", b"Loading net\n", b"{}", b'{"type":"started"}', b'{"type":"other"}', b"\xff\n", b"null"]
)
def test_what_is_no_event_is_refused(line):
    with pytest.raises(ValidationError):
        decode(line)


@pytest.mark.parametrize("name", ["../a.npz", "/etc/passwd", "a/b.npz", "", ".hidden", "a\x00b"])
def test_a_series_is_a_plain_file_name(episode, name):
    line = json.loads(encode(episode(0)))
    with pytest.raises(ValidationError, match="series"):
        decode(json.dumps(line | {"series": name}).encode())


def test_a_text_about_no_folder_of_ours_loses_those_it_names():
    said = 'connection to server on socket "/run/postgresql/.s.PGSQL.5432" failed'
    assert without_folders(said) == 'connection to server on socket ".s.PGSQL.5432" failed'
