"""Writes a run to its folder; `risk_sac.run_folder.results` describes the files."""

import logging
from array import array
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from risk_sac.config import RunSpec, method_of
from risk_sac.env.problem import adjustments
from risk_sac.errors import ConfigError
from risk_sac.rates.record import METHOD, write_rates
from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.run_folder import checkpoint
from risk_sac.run_folder.durable import set_aside
from risk_sac.run_folder.results import (
    EPISODES,
    RESULTS,
    RecordedFailure,
    RunResults,
    read_results,
    read_verified,
    records_from_lines,
    with_headline,
    write_results,
)
from risk_sac.search.loop import Observer
from risk_sac.search.run import CHECKPOINT, RunOutcome

logger = logging.getLogger(__name__)

REWRITTEN = 0.1  # share of new episodes from which results.json is written again


class Recorder:
    """Observer that writes a run's results to its folder, then passes on.

    The run itself writes its episodes.

    Attributes:
      results: the content of results.json, without its failures.
    """

    def __init__(self, spec: RunSpec, folder: Path, observer: Observer) -> None:
        """Takes up the run in `folder`, or claims the folder for it.

        Raises:
          ConfigError: the folder holds another run.
          OSError: it cannot be written.
        """
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._observer = observer
        self.should_stop = observer.should_stop
        self.results = _results_so_far(spec, folder)
        self._failed = array("I")  # indices of the episodes with a failure

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Counts an episode, and now and then writes the results so far."""
        if record.worst_violation is not None:
            self._failed.append(record.index)
        told = self.results.metrics.episodes if self.results.metrics else 0
        # The file has all failures; written at fixed intervals, it would cost an episode the more, the longer a run is.
        every = max(self.results.spec.learner.checkpoint_every, round(REWRITTEN * told))
        due = (record.index + 1) % self.results.spec.learner.checkpoint_every == 0 and metrics.episodes >= told + every
        if due and not record.evaluating:
            self._write(replace(self.results, metrics=metrics), self._failures())
        self._observer.episode(record, metrics, series)

    def finish(self, summary: RunOutcome) -> RunResults:
        """Writes the run's results; the last checkpoint has stored its episodes."""
        results = replace(
            self.results,
            finished=summary.finished,
            metrics=summary.metrics,
            evaluation=summary.evaluation,
            digest=summary.digest,
            versions=summary.versions,
            device=summary.device,
            processes=summary.processes,
            wall_s=self.results.wall_s + summary.wall_s,
            cpu_s=self.results.cpu_s + summary.cpu_s,
            episode_cpu_s=summary.episode_cpu_s,
            failures=tuple(self._failures()),
        )
        verified = read_verified(self._folder, summary.digest)  # by an earlier invocation
        results = with_headline(results, verified) if verified else results
        self._write(results, results.failures)
        if summary.finished and method_of(results.spec.method).scenes == "boundary":
            from risk_sac.report.parameter_plots import write_boundary  # here, because other runs need neither
            from risk_sac.search.boundary_map import read_boundary

            write_boundary(self._folder, read_boundary(self._folder, {}))
        if summary.finished and results.spec.method == METHOD:
            write_rates(self._folder, results.spec, records_from_lines((self._folder / EPISODES).read_bytes()))
        return results

    def _failures(self) -> Iterator[RecordedFailure]:
        """Reads the failures from the episodes, since in memory they would grow."""
        if not self._failed:
            return
        failed = frozenset(self._failed)
        with (self._folder / EPISODES).open("rb") as lines:
            for index, line in enumerate(lines):
                if index in failed:
                    yield RecordedFailure.of(self.results.spec.id, EpisodeRecord.model_validate_json(line))

    def _write(self, results: RunResults, failures: Iterable[RecordedFailure]) -> None:
        write_results(self._folder, results, failures)
        self.results = replace(results, failures=())


def _results_so_far(spec: RunSpec, folder: Path) -> RunResults:
    """Reads earlier results, or claims the folder for `spec`."""
    if (folder / RESULTS).exists():
        results = _read(spec, folder)
        if results.spec_digest != spec.digest:
            differing = [name for name in RunSpec.model_fields if getattr(results.spec, name) != getattr(spec, name)]
            raise ConfigError(
                "out",
                f"{folder}, which holds a run with another {', '.join(differing)}",
                "an empty folder, or the same settings to go on with that run",
            )
        return replace(results, finished=False, digest=None)
    if checkpoint.exists(folder / CHECKPOINT):
        raise ConfigError("out", f"{folder}, which holds a checkpoint but no {RESULTS}", "an empty folder")
    return _claim(spec, folder)


def _claim(spec: RunSpec, folder: Path) -> RunResults:
    results = RunResults(spec=spec, spec_digest=spec.digest, adjustments=adjustments(spec), finished=False)
    write_results(folder, results)
    return results


def _read(spec: RunSpec, folder: Path) -> RunResults:
    """Reads results.json; starts empty if it is damaged.

    The run then rewrites it.

    Raises:
      ConfigError: no run was ever in this folder, so the file is not ours to replace.
      CheckpointError: another run was.
    """
    try:
        return read_results(folder)
    except ConfigError as error:
        if not (folder / EPISODES).exists():
            raise
        checkpoint.load_newest(folder / CHECKPOINT, spec.digest)
        aside = set_aside(folder / RESULTS)
        logger.warning("%s. It is kept as %s and written again; the time spent so far is lost", error, aside.name)
        return _claim(spec, folder)
