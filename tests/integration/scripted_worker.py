"""Worker with the real protocol that behaves as its run's seed says.

Runs as `python -m scripted_worker FOLDER NICENESS` in place of `risk_sac.execution.worker`.
"""

import errno
import os
import signal
import sys
import threading
import time
from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.execution.executor import WORDS
from risk_sac.execution.messages import EpisodeDone, Event, Failed, Finished, Heartbeat, encode
from risk_sac.records import EpisodeRecord, RunMetrics
from tests.builders import episode_record, run_metrics

WELL_BEHAVED, DIES, HANGS, BABBLES, DISK_FULL, EXITS, SEGFAULTS, FREEZES, WAITS = 0, 9, 15, 7, 28, 3, 11, 19, 41
RAISES = 43
ONCE = 100  # added to one of them: the run's second worker behaves well
EPISODE_S = 0.05
WAITS_AT = (10, 41)  # episodes that one that waits begins only once the test has put a file into its folder
BEAT_S = 1.0


def main() -> None:
    folder = Path(sys.argv[1])
    stopping = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stopping.set())
    spec = RunSpec.model_validate_json(sys.stdin.buffer.readline())
    threading.Thread(target=leave_with_server, daemon=True).start()
    threading.Thread(target=beat, daemon=True).start()
    checkpoint = folder / "checkpoint"
    done = int(checkpoint.read_text()) if checkpoint.exists() else 0
    for index in range(done):  # as the real worker: the last of them may never have been heard
        send(EpisodeDone(record=record(index), metrics=metrics(index + 1), series=None, wall_s=0.0))
    for index in range(done, spec.budget.episodes):
        if stopping.is_set() and spec.seed != HANGS:
            break
        if spec.seed == WAITS and index in WAITS_AT:
            wait_for(folder / f"go-{index}", stopping)
        if index == 2:
            misbehave(fault(spec.seed, folder))
        time.sleep(EPISODE_S)
        send(EpisodeDone(record=record(index), metrics=metrics(index + 1), series=None, wall_s=EPISODE_S))
        done = index + 1
        if done % 3 == 0:
            keep(checkpoint, done)
    finished = done == spec.budget.episodes
    send(Finished(finished=finished, metrics=metrics(done), evaluation=None, digest="d", versions={}, wall_s=1.0))


def keep(checkpoint: Path, done: int) -> None:
    """Writes atomically, as the real worker: it may be killed any time."""
    new = checkpoint.with_suffix(".new")
    new.write_text(str(done))
    new.replace(checkpoint)


def wait_for(file: Path, stopping: threading.Event) -> None:
    while not file.exists() and not stopping.wait(0.02):
        pass


def leave_with_server() -> None:
    while os.read(0, 4096):
        pass
    os._exit(0)


def beat() -> None:
    while True:
        send(Heartbeat())
        time.sleep(BEAT_S)


def fault(seed: int, folder: Path) -> int:
    """What this worker does in its third episode."""
    if seed < ONCE:
        return seed
    first = not (folder / "misbehaved").exists()
    (folder / "misbehaved").touch()
    return seed - ONCE if first else WELL_BEHAVED


def misbehave(seed: int) -> None:
    if seed == DIES:
        os.kill(os.getpid(), signal.SIGKILL)
    if seed == SEGFAULTS:
        os.kill(os.getpid(), signal.SIGSEGV)
    if seed == FREEZES:
        os.kill(os.getpid(), signal.SIGSTOP)
    if seed == BABBLES:
        os.write(int(os.environ[WORDS]), b"Loading net-file from 'low.net.xml' ... done (3ms).\n")
        time.sleep(60)
    if seed == DISK_FULL and not (Path(sys.argv[1]).parent / "room").exists():
        send(Failed(reason=f"storage failed: {os.strerror(errno.ENOSPC)}", storage=True))
        sys.exit(1)
    if seed == RAISES:
        Path(sys.argv[1], "nothing").read_text()
    if seed == EXITS:
        sys.exit("Traceback: the policy is NaN")


def send(word: Event | Heartbeat) -> None:
    os.write(int(os.environ[WORDS]), encode(word))  # at once, so that two threads cannot mix their lines


def record(index: int) -> EpisodeRecord:
    return episode_record(index, scene={}, min_ttc_s=float("inf"))


def metrics(episodes: int) -> RunMetrics:
    return run_metrics(episodes)


if __name__ == "__main__":
    main()
