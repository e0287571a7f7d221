"""One run without a server: started or resumed in a folder, written down as it goes, stopped by Ctrl-C."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import BinaryIO

from pydantic import TypeAdapter

from risk_sac import checkpoint
from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.problem import Problem
from risk_sac.records import records_from_json
from risk_sac.results import EPISODES, RESULTS, Contact, Results, read_results, write_results
from risk_sac.train import CHECKPOINT, train
from risk_sac.types import EpisodeRecord, RunMetrics

Progress = Callable[[int, RunMetrics | None], None]
"""Told of the episodes done so far and of the metrics of the current phase."""

_LINE = TypeAdapter(EpisodeRecord)


def run(spec: RunSpec, folder: Path, progress: Progress) -> Results:
    """Executes a run, or goes on with the one in `folder`; SIGINT and SIGTERM end it after the episode.

    Raises:
      ConfigError: the spec poses no problem that can be run, or the folder holds a run of another one.
      CheckpointError: the folder's checkpoint is damaged.
      OSError: the folder cannot be written.
    """
    Problem.from_spec(spec)  # before the folder is claimed
    folder.mkdir(parents=True, exist_ok=True)
    before = _results_so_far(spec, folder)
    with _stop_signal() as stopping, (folder / EPISODES).open("ab") as file:
        recorder = Recorder(before, folder, file, stopping, progress)
        summary = train(spec, folder, recorder)
    results = replace(
        before,
        finished=summary.finished,
        metrics=summary.metrics,
        evaluation=summary.evaluation,
        digest=summary.digest,
        versions=summary.versions,
        wall_s=before.wall_s + summary.wall_s,
        contacts=tuple(recorder.contacts),
    )
    write_results(folder, results)
    return results


class Recorder:
    """The observer that writes a run down."""

    def __init__(
        self, before: Results, folder: Path, file: BinaryIO, stopping: Callable[[], bool], progress: Progress
    ) -> None:
        self._before = before
        self._folder = folder
        self._file = file
        self._progress = progress
        self.should_stop = stopping
        records = _restart_episodes(before.spec, folder, file)
        self.contacts = [Contact.of(record) for record in records if record.collision is not None]
        self._progress(len(records), before.metrics)

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: str | None) -> None:
        """Writes an episode down."""
        self._file.write(_LINE.dump_json(record) + b"\n")
        self._file.flush()
        if series is not None:
            self.contacts.append(Contact.of(record))
        done = record.index + 1
        self._progress(done, metrics)
        if done % self._before.spec.learner.checkpoint_every == 0 and record.phase == "train":
            write_results(self._folder, replace(self._before, metrics=metrics, contacts=tuple(self.contacts)))


def _results_so_far(spec: RunSpec, folder: Path) -> Results:
    """What earlier invocations left, or an empty start that claims the folder for `spec`."""
    if (folder / RESULTS).exists():
        results = read_results(folder)
        if results.spec_digest != spec.digest:
            differing = [name for name in RunSpec.model_fields if getattr(results.spec, name) != getattr(spec, name)]
            raise ConfigError(
                f"{folder} holds a run with another {', '.join(differing)}; wanted an empty folder, or the same "
                "settings to go on with that run",
                field="out",
            )
        return replace(results, finished=False)
    if (folder / CHECKPOINT).exists():
        raise ConfigError(f"{folder} holds a checkpoint but no {RESULTS}; wanted an empty folder", field="out")
    results = Results(spec=spec, spec_digest=spec.digest, finished=False)
    write_results(folder, results)
    return results


def _restart_episodes(spec: RunSpec, folder: Path, file: BinaryIO) -> list[EpisodeRecord]:
    """Cuts the file of episodes back to those of the checkpoint, which are returned; the run repeats the rest."""
    records: list[EpisodeRecord] = []
    if (folder / CHECKPOINT).exists():
        records = records_from_json(checkpoint.load(folder / CHECKPOINT, spec.digest)["records"])
    file.truncate(0)
    file.write(b"".join(_LINE.dump_json(record) + b"\n" for record in records))
    file.flush()
    return records


@contextmanager
def _stop_signal() -> Iterator[Callable[[], bool]]:
    """Turns the first SIGINT or SIGTERM into an answer; a second one acts as always."""
    stopping = False

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal stopping
        stopping = True
        signal.signal(number, earlier[signal.Signals(number)])

    earlier = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in earlier:
        signal.signal(number, stop)
    try:
        yield lambda: stopping
    finally:
        for number, handler in earlier.items():
            signal.signal(number, handler)
