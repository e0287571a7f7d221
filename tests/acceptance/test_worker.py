"""A real worker stopped, killed or refused by the disk: same results."""

import resource
import signal
import time
from collections.abc import Callable
from operator import methodcaller
from pathlib import Path

import psutil
import pytest

from risk_sac.config import AgentConfig, Budget, LearnerConfig, RunSpec, SceneOptimizerConfig, WarmStartConfig
from risk_sac.execution.executor import Cause, Exited
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.messages import EpisodeDone, Event, Failed, Finished, Started
from risk_sac.records import Repetition
from risk_sac.run_folder.arrays import read_series
from risk_sac.run_folder.results import FAILURES, first_of_variants, read_results, series_name
from risk_sac.run_folder.series import pack_series, write_series
from service.runs.manager import worker_program
from service.settings import ServiceSettings

EPISODES = 12
SPEC = RunSpec(
    family="low",
    method="risk-sac",
    seed=3,
    budget=Budget(episodes=EPISODES, evaluation_episodes=2),
    learner=LearnerConfig(
        agent=AgentConfig(hidden_sizes=(16, 16), batch_size=16, warmup_steps=500),
        warm_start=WarmStartConfig(episodes=2),
        scenes=SceneOptimizerConfig(initial_scenes=8),  # some of the few scenes come from a model
        checkpoint_every=3,
    ),
)
LONG_S = 600
Do = Callable[[psutil.Process], None]


class Launcher:
    """Executes one worker after the other on the same run."""

    def __init__(self, folder: Path, spec: RunSpec = SPEC, settings: ServiceSettings | None = None) -> None:
        self.folder = folder
        self.spec = spec
        self.executor = LocalExecutor(worker_program(settings or ServiceSettings(replays=0)))

    def submit(self) -> None:
        self.executor.submit(1, self.spec, self.folder, 1)

    def work(self, until: int | None = None, then: Do | None = None) -> tuple[list[Event], Exited, float]:
        """Returns a worker's messages, its end, and the time since `then`.

        Args:
          until: episodes that it tells of before something is done to it.
          then: what is done.
        """
        said: list[Event] = []
        done_at = deadline = time.monotonic() + LONG_S
        self.submit()
        while time.monotonic() < deadline:
            for _, message in self.executor.events(0.01):
                if isinstance(message, Exited):
                    return said, message, time.monotonic() - done_at
                said.append(message)
                if isinstance(message, Started):
                    process = psutil.Process(message.pid)
                if then is not None and sum(isinstance(word, EpisodeDone) for word in said) == until:
                    then(process)
                    then, done_at = None, time.monotonic()
        raise AssertionError(f"the worker is still there after {LONG_S} s")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Digest of the run if nothing happens to it."""
    return digest(Launcher(tmp_path_factory.mktemp("undisturbed")))


@pytest.fixture
def launcher(tmp_path: Path) -> Launcher:
    return Launcher(tmp_path / "run")


def digest(launcher: Launcher) -> str:
    """Returns the run's digest if it is undisturbed from here on."""
    said, exited, _ = launcher.work()
    assert exited == Exited(None, Cause.ENDED, 0), exited
    assert isinstance(said[-1], Finished)
    assert said[-1].finished
    assert [word.record.index for word in said if isinstance(word, EpisodeDone)] == list(range(EPISODES + 2))
    return said[-1].digest


def test_a_worker_that_finds_all_played_replays_what_nobody_has_and_refuses_what_goes_another_way(tmp_path):
    spec = RunSpec(family="low", method="archive", seed=3, budget=Budget(episodes=20))
    said, _, _ = Launcher(tmp_path / "run", spec).work()
    before = said[-1]
    assert isinstance(before, Finished)
    assert not before.repetitions
    first, *others = [episode.index for episode in first_of_variants(read_results(tmp_path / "run"))]
    file = tmp_path / "run" / FAILURES / series_name(first)
    series = read_series(file)
    series["actions"][-5:] *= -1.0
    write_series(file, pack_series(series))
    said, exited, _ = Launcher(tmp_path / "run", spec, ServiceSettings(replays=1)).work()
    assert exited == Exited(None, Cause.ENDED, 0), exited
    after = said[-1]
    assert isinstance(after, Finished)
    assert after.finished
    assert after.repetitions == {first: Repetition(times=1, same=0)} | dict.fromkeys(
        others, Repetition(times=1, same=1)
    )
    assert first in after.flaky
    assert after.metrics.failures == before.metrics.failures - len(after.flaky)
    assert after.metrics.distinct_failures == before.metrics.distinct_failures - 1
    assert after.metrics.raw_collisions == before.metrics.raw_collisions


@pytest.mark.parametrize("moment_s", [1.5, *(pytest.param(s, marks=pytest.mark.torture) for s in (0.2, 4.0))])
def test_a_worker_with_nothing_to_keep_leaves_at_once(launcher, moment_s):
    launcher.submit()
    time.sleep(moment_s)  # into the start of Python, an import, or the first episode's compilation
    launcher.executor.cancel(1, 30)
    told_at = time.monotonic()
    while not any(isinstance(message, Exited) for _, message in launcher.executor.events(0.01)):
        assert time.monotonic() - told_at < 20


def test_a_worker_that_is_told_to_stop_killed_crashes_or_hangs_goes_on_to_the_same_results(launcher, undisturbed):
    said, exited, left_after_s = launcher.work(5, lambda _: launcher.executor.cancel(1, 30))
    assert exited == Exited(None, Cause.ENDED, 0)
    assert isinstance(said[-1], Finished)
    assert not said[-1].finished
    done = [word.record.index for word in said if isinstance(word, EpisodeDone)]
    assert done == list(range(len(done)))
    assert len(done) < EPISODES
    assert left_after_s < 20
    causes = {signal.SIGKILL: Cause.KILLED, signal.SIGSEGV: Cause.CRASHED, signal.SIGSTOP: Cause.STOPPED}
    for more, (number, cause) in enumerate(causes.items()):
        said, exited, gone_after_s = launcher.work(len(done) + 2 * more, methodcaller("send_signal", number))
        assert [word.record.index for word in said if isinstance(word, EpisodeDone)][: len(done)] == done
        assert exited.cause is cause
        assert gone_after_s < 5
    assert digest(launcher) == undisturbed


@pytest.mark.parametrize("size", [pytest.param(0, marks=pytest.mark.torture), 20_000])
def test_a_disk_that_is_full_is_told_and_leaves_a_run_that_goes_on(
    launcher: Launcher, undisturbed: str, size: int
) -> None:
    # To a process that may not let a file grow beyond this, every longer one is on a full disk; its log is too.
    full = (size, size)
    said, exited, _ = launcher.work(3, lambda process: resource.prlimit(process.pid, resource.RLIMIT_FSIZE, full))
    assert isinstance(said[-1], Failed)
    assert said[-1].storage
    assert said[-1].reason.startswith("storage failed: File too large")
    assert exited.cause is Cause.ENDED
    assert digest(launcher) == undisturbed
