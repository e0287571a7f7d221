"""A campaign without a server: each run in a process of its own, then the comparison of methods.

DIR/spec.yaml                            the campaign
DIR/runs/<family>-<method>-<seed>/       a run's folder, see `risk_sac.run_folder.results`, and what its process printed
DIR/table.{json,md,csv}, DIR/figures/    see `risk_sac.report`
"""

import signal
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from risk_sac.config import CampaignSpec
from risk_sac.config.spec_file import campaign_yaml, read_campaign
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import executor_named
from risk_sac.execution.jobs import Job, Progress, execute, worker_program
from risk_sac.execution.runs import STOPPING, stop_signal
from risk_sac.execution.verify import verify
from risk_sac.machine import cores
from risk_sac.prior.earlier import pinned_prior
from risk_sac.problem import checked_campaign
from risk_sac.report import Comparison, FinishedRun, compare, read_run, write_report
from risk_sac.run_folder.durable import held, replace_file
from risk_sac.run_folder.verified import TIMES

SPEC, RUNS = "spec.yaml", "runs"


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
    progress: Progress,
    executor: str = "local",
    times: int = TIMES,
) -> Evaluation:
    """Executes what is not finished yet and writes the report of what is.

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
    """Holds the folder for this campaign; should this process be killed, its workers leave at once."""
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
