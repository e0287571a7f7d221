"""`python -m service.worker FOLDER`: execute one run in a process of its own.

The run is one line of JSON on stdin, events are lines of JSON on stdout, everything else a library
prints goes to stderr. SIGTERM stops the run at the next episode boundary. The end of stdin means
that the server has died: nobody would store what comes now, so the worker leaves at once, and the
next server resumes from the last checkpoint.
"""

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import IO

from risk_sac.config import RunSpec
from risk_sac.errors import RiskSacError
from risk_sac.types import EpisodeRecord, RunMetrics
from service.events import EpisodeDone, Event, Failed, Finished, Started, encode
from service.locks import wait_for_lock

logger = logging.getLogger(__name__)


class Reporter:
    """The observer of a run that tells the manager."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream = stream
        self._stopping = False
        self._since = time.monotonic()

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: str | None) -> None:
        """Report an episode."""
        now = time.monotonic()
        self.send(EpisodeDone(record=record, metrics=metrics, series=series, wall_s=now - self._since))
        self._since = now

    def should_stop(self) -> bool:
        """Whether the manager asked to stop."""
        return self._stopping

    def stop(self, signal_number: int, frame: FrameType | None) -> None:
        """Handle SIGTERM."""
        self._stopping = True

    def send(self, event: Event) -> None:
        """Write one event at once."""
        self._stream.write(encode(event))
        self._stream.flush()


def main() -> int:
    """Execute the run; returns the exit status."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    folder = Path(sys.argv[1])
    reporter = Reporter(_take_stdout())
    signal.signal(signal.SIGTERM, reporter.stop)
    spec = RunSpec.model_validate_json(sys.stdin.buffer.readline())
    threading.Thread(target=_leave_with_server, daemon=True).start()
    reporter.send(Started(pid=os.getpid()))
    try:
        with wait_for_lock(folder):  # a worker of a server that was killed may still be leaving
            reporter.send(_execute(spec, folder, reporter))
    except OSError as error:
        logger.exception("the disk refused")
        reporter.send(Failed(reason=_refused(error), storage=True))
        return 1
    except RiskSacError as error:
        logger.exception("the run cannot go on")
        reporter.send(Failed(reason=str(error)))
        return 1
    return 0


def _execute(spec: RunSpec, folder: Path, reporter: Reporter) -> Finished:
    from risk_sac.recorder import Recorder  # here, so that a signal during the slow import is not lost
    from risk_sac.train import train

    with Recorder(spec, folder, reporter) as recorder:
        summary = train(spec, folder, recorder)
        recorder.finish(summary)
    versions: Mapping[str, str] = summary.versions
    return Finished(
        finished=summary.finished,
        metrics=summary.metrics,
        evaluation=summary.evaluation,
        digest=summary.digest,
        versions=versions,
        wall_s=summary.wall_s,
    )


def _take_stdout() -> IO[bytes]:
    """Keep stdout for events alone: whatever else is printed, by C++ too, goes to stderr."""
    events = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    return events


def _leave_with_server() -> None:
    while os.read(0, 4096):
        pass
    os._exit(0)


def _refused(error: OSError) -> str:
    where = f" ({error.filename!r})" if error.filename else ""
    return f"storage failed: {error.strerror or error}{where}"


if __name__ == "__main__":
    sys.exit(main())
