"""Executes one run without a server, in a folder.

The run is started or resumed, written to the folder as it goes, and stopped by Ctrl-C.
"""

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from risk_sac.config import RunSpec
from risk_sac.execution.recorder import Recorder
from risk_sac.loop import execute_run
from risk_sac.prior.earlier import pinned_prior
from risk_sac.problem import Problem
from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.run_folder.durable import held
from risk_sac.run_folder.results import Results

STOPPING = (signal.SIGINT, signal.SIGTERM)
Progress = Callable[[int, RunMetrics | None], None]
"""Told of the episodes done so far and of the metrics of the current phase."""


def run(spec: RunSpec, folder: Path, progress: Progress) -> Results:
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

    progress: Progress
    should_stop: Callable[[], bool]

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Counts an episode."""
        self.progress(record.index + 1, metrics)


@contextmanager
def stop_signal(numbers: Sequence[signal.Signals] = STOPPING) -> Iterator[Callable[[], bool]]:
    """Turns the first of the signals into an answer; a second one acts as always."""
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
