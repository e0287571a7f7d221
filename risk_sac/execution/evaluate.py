"""Executes and verifies runs and evaluates campaigns, without a server.

A run is started or resumed, written to its folder as it goes, and stopped by Ctrl-C.
"""

import json
import logging
import math
import signal
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from risk_sac.config import CampaignSpec, RunSpec
from risk_sac.config.spec_file import campaign_yaml, read_campaign
from risk_sac.env.problem import Problem, checked_campaign
from risk_sac.errors import ConfigError
from risk_sac.execution import executor_named
from risk_sac.execution.helper import ANSWER, run_helper
from risk_sac.execution.jobs import Job, JobProgress, execute, worker_program
from risk_sac.execution.recorder import Recorder
from risk_sac.failures.bundle import code_digest, versions
from risk_sac.host.machine import cores
from risk_sac.records import EpisodeRecord, Repetition, RunMetrics, SeriesFile
from risk_sac.report import Comparison, FinishedRun, compare, read_run, write_report
from risk_sac.report.files import RUNS, SPEC
from risk_sac.run_folder.durable import held, replace_file
from risk_sac.run_folder.results import (
    TIMES,
    RunResults,
    Verified,
    first_of_variants,
    read_results,
    read_verified,
    with_headline,
    write_results,
    write_verified,
)
from risk_sac.search.loop import execute_run
from risk_sac.search.prior.earlier import pinned_prior

STOPPING = (signal.SIGINT, signal.SIGTERM)
RunProgress = Callable[[int, RunMetrics | None], None]
"""Told of the episodes done so far and of the metrics of the current phase."""


def run(spec: RunSpec, folder: Path, progress: RunProgress) -> RunResults:
    """Executes a run, or resumes the one in `folder`.

    SIGINT and SIGTERM end it after the episode.

    Raises:
      ConfigError: the spec poses no problem that can be run, or the folder is in use or holds another run.
      CheckpointError: the folder's checkpoint is of another run.
      OSError: the folder cannot be written.
    """
    folder = folder.absolute()  # an ego may change the working directory
    ego, prior = Problem.from_spec(spec).ego, pinned_prior(spec.prior, [spec.family])  # before the folder is claimed
    spec = spec.model_copy(update={"ego": ego, "prior": prior})
    with held(folder), stop_signal() as stopping:
        recorder = Recorder(spec, folder, Watcher(progress, stopping))
        return recorder.finish(execute_run(spec, folder, recorder))


@dataclass(frozen=True, slots=True)
class Watcher:
    """The observer that tells the user."""

    progress: RunProgress
    should_stop: Callable[[], bool]

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Counts an episode."""
        self.progress(record.index + 1, metrics)


@contextmanager
def stop_signal(numbers: Sequence[signal.Signals] = STOPPING) -> Iterator[Callable[[], bool]]:
    """Yields whether a signal came, as a function; a second acts normally."""
    stopping = False

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal stopping
        stopping = True
        signal.signal(number, earlier[signal.Signals(number)])

    earlier = {number: signal.getsignal(number) for number in numbers}
    for number in earlier:
        signal.signal(number, stop)
    try:
        yield lambda: stopping
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)


logger = logging.getLogger(__name__)


def verify(
    folders: Sequence[Path], times: int = TIMES, jobs: int = 1, stopping: Callable[[], bool] = lambda: False
) -> Mapping[Path, Verified]:
    """Replays the first failures of each variant, and notes which repeat.

    Each is replayed in `times` processes.

    Each run's results.json then has its headline failures.

    What was verified as often before, by the same code, is not replayed again. Of a run whose series cannot be read
    nothing is noted, and of none whose replay was interrupted; the log says so.

    `jobs` replay at a time, until `stopping`. Returns what is noted, by folder.

    Raises:
      ConfigError: a folder holds no run, or `times` is not positive.
      OSError: a folder cannot be written.
    """
    if times < 1:
        raise ConfigError("times", f"{times}", "at least 1")
    code, up_to_date, runs = code_digest(), dict[Path, Verified](), dict[Path, RunResults]()
    missing: dict[Path, Verified] = {}  # with nothing replayed yet
    for folder in folders:
        results = runs[folder] = read_results(folder)
        if results.digest is None:
            continue
        known = read_verified(folder, results.digest)
        enough = known is not None and all(repetition.times >= times for repetition in known.episodes.values())
        if known is not None and enough and known.code == code and known.versions == versions():
            up_to_date[folder] = known
        else:
            episodes = {episode.index: Repetition(times=0, same=0) for episode in first_of_variants(results)}
            missing[folder] = Verified(digest=results.digest, code=code, versions=versions(), episodes=episodes)
    failed = [folder for folder, verified in missing.items() if verified.episodes]
    told = _replayed(failed, times, max(jobs, 1), stopping) if failed else {}
    for folder in failed:
        if len(told[folder]) >= times:  # more, if a process was killed after it had told of this run
            same = {
                index: Repetition(times=times, same=sum(index in each for each in told[folder][:times]))
                for index in missing[folder].episodes
            }
            missing[folder] = replace(missing[folder], episodes=same)
        else:
            del missing[folder]
    for folder, verified in missing.items():
        write_verified(folder, verified)
    for folder, verified in (up_to_date | missing).items():
        results = with_headline(runs[folder], verified)
        if results != runs[folder]:
            write_results(folder, results)
    return up_to_date | missing


def _replayed(
    folders: Sequence[Path], times: int, jobs: int, stopping: Callable[[], bool]
) -> Mapping[Path, Sequence[Collection[int]]]:
    """Replays failures; returns, by run, those that each finished process reproduced."""
    arguments = [ANSWER, str(times), str(jobs), *map(str, folders)]
    result = run_helper("risk_sac.failures.play", arguments, wall_s=math.inf, stopping=stopping)
    if result.status != 0:
        logger.warning("replaying failures ended with status %d: %s", result.status, result.log)
    lines = [json.loads(line) for line in result.answer.splitlines(keepends=True) if line.endswith(b"\n")]
    for line in lines:
        if "error" in line:
            logger.warning("the failures of %s cannot be replayed: %s", line["folder"], line["error"])
    return {
        folder: [line["same"] for line in lines if line["folder"] == str(folder) and "same" in line]
        for folder in folders
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Outcome of a campaign."""

    comparison: Comparison
    failed: tuple[Job, ...]
    stopped: bool  # by a signal


def evaluate(
    spec: CampaignSpec,
    folder: Path,
    command: str,
    jobs: int,
    progress: JobProgress,
    executor: str = "local",
    times: int = TIMES,
) -> Evaluation:
    """Executes the unfinished runs and writes the report of finished ones.

    SIGINT, SIGTERM or SIGHUP stop it: the runs save a checkpoint, and the same call goes on with them.

    The folder may hold an earlier part of the same campaign. `command` is what the user typed, for the report. `jobs`
    processes work at a time, and replay each distinct failure `times` times.

    Raises:
      ConfigError: a family's settings pose no problem that can be run, there is no such executor, or the folder
        holds another campaign or is in use.
      OSError: the folder cannot be written.
    """
    if jobs < 1:
        raise ConfigError("jobs", f"{jobs}", "at least one process")
    if times < 0:
        raise ConfigError("verify", f"{times}", "0 or more")
    if spec.on_end is not None:
        got = f"{spec.on_end!r} for a campaign on the command line"
        raise ConfigError("on_end", got, remedy="leave it out, or post the campaign to a server")
    folder = folder.absolute()  # an ego may change the working directory
    spec = checked_campaign(spec)  # before the folder is claimed
    spec = spec.model_copy(update={"prior": pinned_prior(spec.prior, spec.families)})
    make_executor = executor_named(executor)
    hung_up = () if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else (signal.SIGHUP,)  # nohup stays nohup
    with _claimed(spec, folder), stop_signal((*STOPPING, *hung_up)) as stopping:
        queue = [Job(spec=run, folder=folder / RUNS / run.id) for run in spec.runs()]
        with closing(make_executor(worker_program())) as chosen:
            execute(queue, chosen, jobs, progress, stopping)
        if times and not stopping():
            finished = [job.folder for job in queue if job.state == "finished"]
            verify(finished, times, min(jobs, cores()), stopping)  # here, wherever they were executed
        comparison = _report(spec, folder, command, queue)
        return Evaluation(
            comparison=comparison,
            failed=tuple(job for job in queue if job.state == "failed"),
            stopped=any(job.state in ("waiting", "stopped") for job in queue),
        )


@contextmanager
def _claimed(spec: CampaignSpec, folder: Path) -> Iterator[None]:
    """Locks the folder for this campaign; workers leave if this process dies."""
    with held(folder):
        file = folder / SPEC
        if file.exists():
            _check_same(spec, read_campaign(file, {}, {}), folder)
        else:
            replace_file(file, campaign_yaml(spec).encode())
        yield


def _check_same(wanted: CampaignSpec, found: CampaignSpec, folder: Path) -> None:
    if found.digest != wanted.digest:
        names = [name for name in CampaignSpec.model_fields if getattr(found, name) != getattr(wanted, name)]
        raise ConfigError(
            "out",
            f"{folder}, which holds a comparison with another {', '.join(names)}",
            f"an empty folder, or the settings in {folder / SPEC} to go on with that one",
        )


def _report(spec: CampaignSpec, folder: Path, command: str, jobs: Sequence[Job]) -> Comparison:
    runs: list[FinishedRun] = []
    for job in jobs:
        if job.state != "finished":
            continue
        try:
            runs.append(read_run(job.folder))
        except ConfigError as error:
            job.state, job.reason = "failed", str(error)
    reasons = {job.spec.digest: job.reason for job in jobs if job.state != "finished"}
    comparison = compare(spec, runs, command, spec_file=str(folder / SPEC), reasons=reasons)
    write_report(comparison, folder)
    return comparison
