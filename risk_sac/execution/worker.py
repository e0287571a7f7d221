"""`python -m risk_sac.execution.worker FOLDER NICENESS MEMORY_BYTES REPLAYS`: executes one run.

A finished run's distinct failures are then replayed `REPLAYS` times, in fresh processes. 0 bytes set no limit.

The run is one line of JSON on stdin; events are lines of JSON in the pipe that `WORDS` names. SIGTERM stops the run at
the next episode boundary, with a checkpoint; before the first episode it ends the process at once. The end of stdin
means that the scheduler has died: the worker leaves at once, and the run resumes from its last checkpoint.
"""

import io
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import IO, TYPE_CHECKING

import psutil

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.execution.executor import WORDS
from risk_sac.execution.messages import (
    EpisodeDone,
    Event,
    Failed,
    Finished,
    Heartbeat,
    Started,
    encode,
    without_folders,
)
from risk_sac.host.machine import limit_memory, out_of_memory
from risk_sac.host.process_state import collect_seldom
from risk_sac.host.terminal import log_to_stderr
from risk_sac.records import REPEATS, EpisodeRecord, RunMetrics, SeriesFile
from risk_sac.run_folder.durable import LOCK, lock, remove_temporaries

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

logger = logging.getLogger(__name__)

BEAT_S = 1.0
PATIENCE_S = 5.0  # time for an orphaned worker to leave before it is killed; a suspended one cannot leave
GIVE_UP_S = 60.0  # a process that holds the folder for longer is no such worker
POLL_S = 0.05


class Reporter:
    """The observer of a run that tells the scheduler."""

    def __init__(self, stream: io.FileIO) -> None:
        self._stream = stream
        self._sending = threading.Lock()
        self._asked = 0
        self.stopping = False
        self._since = time.monotonic()

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        """Report an episode."""
        name, sha256 = (None, None) if series is None else (series.name, series.sha256)
        now = time.monotonic()
        wall_s = now - self._since
        self.send(EpisodeDone(record=record, metrics=metrics, series=name, series_sha256=sha256, wall_s=wall_s))
        self._since = now

    def should_stop(self) -> bool:
        """Whether the scheduler asked to stop.

        The run asks before each episode. From the second time on there is an episode worth a checkpoint, so SIGTERM
        waits for the next question; until then it acts as always, in the middle of an import or a compilation too.
        """
        self._asked += 1
        if self._asked == 2:
            self.keep_going()
        return self.stopping

    def keep_going(self) -> None:
        """Makes SIGTERM a wish to stop; for the main thread to call."""
        signal.signal(signal.SIGTERM, self._stop)

    def _stop(self, signal_number: int, frame: FrameType | None) -> None:
        self.stopping = True

    def send(self, word: Event | Heartbeat) -> None:
        """Write one line at once."""
        line = memoryview(encode(word))
        try:
            with self._sending:
                while line:
                    line = line[self._stream.write(line) :]
        except BrokenPipeError:
            os._exit(0)  # the scheduler has died

    @contextmanager
    def beating(self) -> Iterator[None]:
        """Sends heartbeats meanwhile."""
        over = threading.Event()

        def beat() -> None:
            while not over.wait(BEAT_S):
                self.send(Heartbeat())

        thread = threading.Thread(target=beat, name="heartbeat", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


class LossyLog(io.FileIO):
    """Log that a full disk leaves incomplete, without ending the run."""

    def write(self, data: "ReadableBuffer", /) -> int:
        """Bytes written, or given up."""
        try:
            return super().write(data)
        except OSError:
            return memoryview(data).nbytes


def main() -> int:
    """Execute the run; returns the exit status."""
    collect_seldom()
    folder, (niceness, memory_bytes, replays) = Path(sys.argv[1]), map(int, sys.argv[2:5])
    os.nice(niceness)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # so a KeyboardInterrupt is always the ego's own
    reporter = Reporter(io.FileIO(int(os.environ.pop(WORDS)), "wb"))
    _lose_what_a_full_disk_refuses()
    log_to_stderr()
    spec = RunSpec.model_validate_json(sys.stdin.buffer.readline())
    threading.Thread(target=_leave_with_scheduler, daemon=True).start()
    reporter.send(Started(pid=os.getpid()))
    with reporter.beating():
        last = _run(spec, folder, reporter, memory_bytes, replays)
    reporter.send(last)
    return 1 if isinstance(last, Failed) else 0


def _run(spec: RunSpec, folder: Path, reporter: Reporter, memory_bytes: int, replays: int) -> Finished | Failed:
    try:
        with take_over(folder):
            return _execute(spec, folder, reporter, memory_bytes, replays)
    except Exception as error:
        if out_of_memory(error):  # as it would be for the next worker
            logger.exception("the run needs more memory than there is")
            return Failed(reason=_too_much(memory_bytes))
        if isinstance(error, OSError):
            logger.exception("the disk refused")
            return Failed(reason=_refused(error), storage=True)
        if isinstance(error, RiskSacError):
            logger.exception("the run cannot go on")
            return Failed(reason=without_folders(str(error), folder))
        raise


def _execute(spec: RunSpec, folder: Path, reporter: Reporter, memory_bytes: int, replays: int) -> Finished:
    from risk_sac.execution.evaluate import verify
    from risk_sac.execution.recorder import Recorder  # here, so that the slow import happens with a heartbeat
    from risk_sac.report.runs import read_run
    from risk_sac.run_folder.results import Verified, with_headline
    from risk_sac.search.loop import execute_run

    if memory_bytes:
        limit_memory(memory_bytes)  # from here on: where it ends while libsumo is loaded, the process crashes
    recorder = Recorder(spec, folder, reporter)
    summary = execute_run(spec, folder, recorder)
    results = recorder.finish(summary)
    verified, finished = dict[Path, Verified](), summary.finished
    if finished and replays:
        reporter.keep_going()
        verified |= verify([folder], replays, stopping=lambda: reporter.stopping)
        finished = not reporter.stopping or folder in verified  # else the next worker finds all played, and replays it
    if folder in verified:
        results = with_headline(results, verified[folder])
    last = Finished(
        finished=finished,
        metrics=results.metrics or summary.metrics,
        evaluation=results.evaluation,
        digest=summary.digest,
        versions=summary.versions,
        wall_s=summary.wall_s,
        repetitions=verified[folder].episodes if folder in verified else {},
    )
    if folder not in verified or not verified[folder].flaky:
        return last
    judged = read_run(folder)
    flaky = {each.index: each.refused_by(REPEATS) for each in judged.records if each.refused_by(REPEATS)}
    return last.model_copy(
        update={
            "metrics": judged.metrics["iid" if spec.iid else "search"],
            "evaluation": judged.metrics.get("evaluation"),
            "flaky": flaky,
        }
    )


def _lose_what_a_full_disk_refuses() -> None:
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(
            io.BufferedWriter(LossyLog(number, "wb", closefd=False)), errors="replace", line_buffering=True
        )
        for number in (1, 2)
    )


def take_over(folder: Path) -> IO[bytes]:
    """Locks a run's folder for this worker; closing the returned file unlocks.

    A worker that still holds it has lost its scheduler, since one scheduler at a time starts workers here. It is given
    some time, then it is killed.

    Raises:
      ConfigError: `risk-sac run` is at work in the folder.
      OSError: the folder cannot be written.
    """
    began = time.monotonic()
    while True:
        try:
            held = lock(folder / LOCK)
            remove_temporaries(folder, time.time())
            return held
        except BlockingIOError as error:
            waited_s = time.monotonic() - began
            if waited_s >= GIVE_UP_S:
                raise ConfigError("out", f"{folder}, in which another process is at work") from error
            if waited_s >= PATIENCE_S:
                _kill_others()
            time.sleep(POLL_S)


def _kill_others() -> None:
    """Kills processes that were started with the same module and folder."""
    own = psutil.Process()
    started_as = slice(1, 4)  # -m MODULE FOLDER
    for other in psutil.process_iter(["cmdline"]):
        if other != own and (other.info["cmdline"] or [])[started_as] == sys.orig_argv[started_as]:
            logger.warning("process %d is a worker of this run and has lost its scheduler; it is killed", other.pid)
            other.kill()


def _leave_with_scheduler() -> None:
    while os.read(0, 4096):
        pass
    os._exit(0)


def _refused(error: OSError) -> str:
    where = f" ({Path(error.filename).name!r})" if error.filename else ""
    return f"storage failed: {error.strerror or error}{where}"


def _too_much(memory_bytes: int) -> str:
    return (
        f"the run needs more than the {memory_bytes / 2**30:.3g} GiB of memory that a worker may take; wanted smaller "
        "networks, batches or replay, or a larger RISK_SAC_WORKER_MEMORY_BYTES"
    )


if __name__ == "__main__":
    status = main()
    logging.shutdown()
    os._exit(status)  # all is written; taking the libraries down in order would take seconds more
