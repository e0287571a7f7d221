"""What every executor must pass; its test class derives from `ExecutorContract`.

Workers are pieces of Python that misbehave by themselves, so that it does not matter where they run; they share the
run's folder with the test.
"""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from risk_sac.config import RunSpec
from risk_sac.execution.executor import FOLDER, Cause, Executor, Exited, MakeExecutor, WorkerProgram
from risk_sac.execution.messages import Heard

SPEC = RunSpec(family="low", method="random", seed=7)
LONG_S = 240
SOON_S = 5  # a worker that is lost is told of by then
OVERLOADED = 4  # a busy machine may take so many times as long

# A worker elsewhere is given another folder to work in; here it meets the test in the run's own.
START = """
import os, pathlib, sys
folder = os.path.join(sys.argv[1], os.path.basename(sys.argv[2]))
exec(pathlib.Path(folder + '.py').read_text())
"""
WORKER = """
import json, os, signal, sys, threading, time
spec = sys.stdin.readline()
words = int(os.environ['RISK_SAC_WORDS'])
def say(word):
    os.write(words, json.dumps(word).encode() + b'\\n')  # in one piece, whatever another thread says
def live():
    while True:
        say('alive'); time.sleep(0.1)
def wait_for(name):
    while not os.path.exists(os.path.join(folder, name)):
        time.sleep(0.02)
def touch(name):
    open(os.path.join(folder, name), 'w').close()
"""
ALIVE = "threading.Thread(target=live, daemon=True).start()\n"
DEAF = "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
OBEDIENT = "signal.signal(signal.SIGTERM, lambda *_: (say('stopping'), say('last'), os._exit(0)))\n"
# A child in a session of its own outlives whatever is done to the worker, and talks in its stead.
HEIR = """
if os.fork() == 0:
    os.setsid()
    for _ in range(500):
        say('late'); touch('heir'); time.sleep(0.02)
    os._exit(0)
"""


def hear(line: bytes) -> Heard:
    word: Any = json.loads(line)
    if not isinstance(word, str):
        raise ValueError(f"got {word!r}; wanted a word")
    return Heard(None if word == "alive" else word, progress=word == "episode", last=word == "last")


class Runs:
    """Executor at work; a run's program is the code submitted for it."""

    def __init__(self, make: MakeExecutor, folder: Path, **patience: Any) -> None:
        self._folder = folder
        self._numbers: set[int] = set()
        arguments = "-c", START, str(folder), FOLDER
        program = WorkerProgram(arguments=arguments, log="log", hear=hear, **{"linger_s": LONG_S} | patience)
        self.executor: Executor = make(program)

    def folder(self, number: int, attempt: int = 1) -> Path:
        return self._folder / f"{number}-{attempt}"

    def submit(self, code: str, number: int = 1, attempt: int = 1, slots: int = 1) -> None:
        folder = self.folder(number, attempt)
        folder.with_name(f"{folder.name}.py").write_text(WORKER + code)
        self.executor.submit(number, SPEC, folder, slots)
        self._numbers.add(number)

    def messages(self, ends: int = 1) -> list[tuple[int, Any]]:
        """All that is told until so many runs have ended."""
        told: list[tuple[int, Any]] = []
        deadline = time.monotonic() + LONG_S
        while sum(isinstance(message, Exited) for _, message in told) < ends:
            assert time.monotonic() < deadline, told
            told += self.executor.events(1)
        return told

    def first(self) -> tuple[int, Any]:
        """The one message that is told next."""
        deadline = time.monotonic() + LONG_S
        while not (told := self.executor.events(1)):
            assert time.monotonic() < deadline
        assert len(told) == 1
        return told[0]

    def silence(self, seconds: float = 1.0) -> None:
        """Nothing more is told."""
        deadline = time.monotonic() + seconds
        while (left_s := deadline - time.monotonic()) > 0:
            assert self.executor.events(left_s) == []

    def wait_for(self, file: Path) -> None:
        deadline = time.monotonic() + LONG_S
        while not file.exists():
            assert time.monotonic() < deadline
            time.sleep(0.02)

    def close(self) -> None:
        """Ends what is still there."""
        for number in self._numbers:
            self.executor.cancel(number, 0)
        self.executor.close()


def outcome(told: list[tuple[int, Any]]) -> tuple[list[str], Cause]:
    """What one run said, and why its worker is gone."""
    *words, exited = [message for _, message in told]
    assert isinstance(exited, Exited)
    return words, exited.cause


class ExecutorContract:
    """Derive from it and override `make`."""

    @pytest.fixture
    def make(self) -> MakeExecutor:
        raise NotImplementedError("what makes the executor")

    @pytest.fixture
    def runs(self, make: MakeExecutor, tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Runs]:
        started = Runs(make, tmp_path, **getattr(request, "param", {}))
        yield started
        started.close()

    def test_a_worker_gets_its_run_and_its_words_come_in_order(self, runs: Runs) -> None:
        runs.submit("say(spec); [say(str(n)) for n in range(500)]; say('episode'); say('last')")
        told = runs.messages()
        words, cause = outcome(told)
        assert {number for number, _ in told} == {1}
        assert RunSpec.model_validate_json(words[0]) == SPEC
        assert words[1:] == [*map(str, range(500)), "episode", "last"]
        assert cause is Cause.ENDED
        runs.silence()

    def test_a_worker_knows_how_many_processes_it_may_start(self, runs: Runs) -> None:
        runs.submit("say(os.environ['RISK_SAC_ROLLOUTS']); say('last')", slots=3)
        assert outcome(runs.messages()) == (["3", "last"], Cause.ENDED)

    def test_the_last_message_says_why_the_worker_is_gone(self, runs: Runs) -> None:
        ways: list[tuple[str, list[str], Cause]] = [
            ("pass", [], Cause.CRASHED),
            ("say('a'); os.kill(os.getpid(), signal.SIGSEGV)", ["a"], Cause.CRASHED),
            ("say('a'); os.kill(os.getpid(), signal.SIGKILL)", ["a"], Cause.KILLED),
            ("say('a'); os.write(words, b'Loading net\\n'); say('b'); time.sleep(60)", ["a"], Cause.CRASHED),
            ("say('a'); os.write(words, b'x' * (1 << 21)); time.sleep(60)", ["a"], Cause.CRASHED),
            ("say('last'); say('b'); sys.exit(3)", ["last"], Cause.ENDED),
            ("say('last'); os.kill(os.getpid(), signal.SIGSEGV)", ["last"], Cause.ENDED),
        ]
        for number, (code, _, _) in enumerate(ways):
            runs.submit(code, number)
        told = runs.messages(len(ways))
        runs.silence(0.3)
        for number, (code, said, cause) in enumerate(ways):
            assert outcome([each for each in told if each[0] == number]) == (said, cause), code

    def test_what_a_worker_printed_is_the_reason_why_it_crashed(self, runs: Runs) -> None:
        for attempt in (1, 2):  # an earlier attempt's log is not its own
            runs.submit(f"sys.exit('the policy of {attempt} is NaN')", attempt=attempt)
            ((_, exited),) = runs.messages()
            assert exited == Exited(f"worker exited with status 1: the policy of {attempt} is NaN", Cause.CRASHED, 1)

    @pytest.mark.parametrize("runs", [{"linger_s": 0.5}], indirect=True)
    @pytest.mark.parametrize("code", ["say('last'); time.sleep(600)", "say('last'); os.kill(os.getpid(), 19)"])
    def test_a_worker_that_lingers_after_its_last_word_is_made_to_leave(self, runs: Runs, code: str) -> None:
        runs.submit(DEAF + code)
        assert outcome(runs.messages()) == (["last"], Cause.ENDED)

    @pytest.mark.parametrize("runs", [{"lease_s": 2.0}], indirect=True)
    @pytest.mark.parametrize("code", ["time.sleep(600)", "os.kill(os.getpid(), signal.SIGSTOP)"])
    def test_a_silent_worker_is_lost(self, runs: Runs, code: str) -> None:
        runs.submit("say('a')\n" + code)
        assert runs.first() == (1, "a")
        silent_since = time.monotonic()
        ((_, exited),) = runs.messages()
        assert isinstance(exited, Exited)
        assert (exited.cause, exited.reason) == (Cause.STOPPED, "worker gave no sign of life for 2 s")
        assert time.monotonic() - silent_since < OVERLOADED * SOON_S

    @pytest.mark.parametrize("runs", [{"stall_s": 4.0}], indirect=True)
    def test_a_worker_that_gets_nothing_done_is_lost_and_one_that_does_is_not(self, runs: Runs) -> None:
        runs.submit(ALIVE + "time.sleep(600)", 1)
        runs.submit(
            ALIVE + "while not os.path.exists(folder + '/end'): say('episode'); time.sleep(0.1)\nsay('last')", 2
        )
        stalled = [message for number, message in runs.messages() if number == 1]
        assert [message.cause for message in stalled if isinstance(message, Exited)] == [Cause.STOPPED]
        (runs.folder(2) / "end").touch()
        words, cause = outcome(runs.messages())
        assert (words[-1], cause) == ("last", Cause.ENDED)

    def test_a_lost_worker_takes_no_other_along(self, runs: Runs) -> None:
        runs.submit("wait_for('die'); os.kill(os.getpid(), signal.SIGKILL)", 1)
        runs.submit("wait_for('end'); say('last')", 2)
        runs.wait_for(runs.folder(2))
        (runs.folder(1) / "die").touch()
        ((number, exited),) = runs.messages()
        assert (number, exited.cause) == (1, Cause.KILLED)
        (runs.folder(2) / "end").touch()
        told = runs.messages()
        assert {number for number, _ in told} == {2}
        assert outcome(told) == (["last"], Cause.ENDED)

    def test_nothing_is_told_after_a_worker_is_gone_although_its_children_go_on_talking(self, runs: Runs) -> None:
        runs.submit(HEIR + "wait_for('heir'); say('a'); os._exit(4)")
        words, cause = outcome(runs.messages())
        assert set(words) == {"late", "a"}
        assert cause is Cause.CRASHED
        runs.silence()

    def test_the_heir_of_an_older_attempt_is_not_heard_in_the_next_one(self, runs: Runs) -> None:
        runs.submit(HEIR + "wait_for('heir'); os._exit(4)", attempt=1)
        assert outcome(runs.messages())[1] is Cause.CRASHED
        runs.submit("time.sleep(0.5); say('new'); say('last')", attempt=2)
        assert outcome(runs.messages()) == (["new", "last"], Cause.ENDED)

    def test_a_cancelled_worker_may_finish_what_it_is_at(self, runs: Runs) -> None:
        runs.submit(OBEDIENT + "say('a'); time.sleep(600)")
        assert runs.first() == (1, "a")
        for _ in range(3):
            runs.executor.cancel(1, LONG_S)
        assert outcome(runs.messages()) == (["stopping", "last"], Cause.ENDED)
        runs.executor.cancel(1, 0)  # of a run that has ended
        runs.executor.cancel(2, 0)  # of a run that never was
        runs.silence(0.3)

    @pytest.mark.parametrize("code", ["time.sleep(600)", "os.kill(os.getpid(), signal.SIGSTOP)"])
    def test_a_cancelled_worker_that_does_not_care_goes_after_the_shortest_grace(self, runs: Runs, code: str) -> None:
        runs.submit(DEAF + "say('a')\n" + code)
        assert runs.first() == (1, "a")
        asked_at = time.monotonic()
        for grace_s in (50, 0.5, 60):
            runs.executor.cancel(1, grace_s)
        assert outcome(runs.messages()) == ([], Cause.ENDED)
        assert 0.4 < time.monotonic() - asked_at < OVERLOADED * SOON_S

    def test_a_worker_cancelled_before_it_can_know_ends_as_well(self, runs: Runs) -> None:
        runs.submit("time.sleep(600)")
        runs.executor.cancel(1, LONG_S)
        assert outcome(runs.messages()) == ([], Cause.ENDED)

    def test_the_next_attempt_is_not_cancelled_with_the_one_before(self, runs: Runs) -> None:
        runs.submit("time.sleep(600)", attempt=1)
        runs.executor.cancel(1, 1)
        runs.messages()
        runs.submit("time.sleep(1.5); say('last')", attempt=2)
        assert outcome(runs.messages()) == (["last"], Cause.ENDED)

    def test_a_wait_for_events_can_be_cut_short(self, runs: Runs) -> None:
        assert runs.executor.events(0.01) == []
        runs.executor.wake()
        assert runs.executor.events(600) == []

    def test_a_run_that_cannot_be_started_may_be_submitted_again(self, runs: Runs) -> None:
        runs.folder(1).parent.mkdir(exist_ok=True)
        runs.folder(1).write_text("in the way")
        with pytest.raises(OSError, match=r"."):
            runs.submit("say('last')")
        runs.silence(0.3)
        runs.folder(1).unlink()
        runs.submit("say('last')")
        assert outcome(runs.messages()) == (["last"], Cause.ENDED)

    def test_what_a_worker_prints_goes_to_its_log_alone(self, runs: Runs, tmp_path: Path) -> None:
        runs.submit("print('printed', flush=True); os.write(2, b'too\\n'); say('last')")
        assert outcome(runs.messages()) == (["last"], Cause.ENDED)
        assert (runs.folder(1) / "log").read_text() == "printed\ntoo\n"
