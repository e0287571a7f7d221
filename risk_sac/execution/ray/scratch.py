"""Folders of a node in which attempts work: gone with their attempt, whatever ended it.

SCRATCH_DIR/<run>-<attempt>-<token>/alive    locked while its task lives; the worker's number
SCRATCH_DIR/<run>-<attempt>-<token>/stop     the grace time, s, once the attempt is to stop
SCRATCH_DIR/<run>-<attempt>-<token>/<run>/   the run's folder, in which the worker works
SCRATCH_DIR/<run>-<attempt>-<token>/beside/  what the worker reads beside it
"""

import contextlib
import fcntl
import json
import os
from collections.abc import Iterator
from pathlib import Path

from risk_sac.errors import ConfigError
from risk_sac.execution.ray import caretaker
from risk_sac.execution.ray.settings import variable

ALIVE, STOP, BESIDE = "alive", "stop", "beside"


@contextlib.contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A folder for a worker, inside one of the attempt's own.

    Raises:
      ConfigError: the folder for all of them is somebody else's.
    """
    own = folder.parent
    own.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    if own.parent.stat().st_uid != os.getuid():
        raise ConfigError(
            variable("ray_scratch_dir"),
            f"{str(own.parent)!r}, which belongs to somebody else on this node",
            "a folder of its own",
        )
    sweep(own.parent)
    own.mkdir()
    with (own / ALIVE).open("w") as alive:
        fcntl.flock(alive, fcntl.LOCK_EX)
        folder.mkdir()
        try:
            yield folder
        finally:
            caretaker.remove(str(own))


def sweep(scratch_dir: Path) -> None:
    """Removes what attempts left whose task was killed together with its caretaker, and ends their workers."""
    for own in scratch_dir.glob("*") if scratch_dir.exists() else ():
        with contextlib.suppress(FileNotFoundError, BlockingIOError), (own / ALIVE).open("r+") as alive:
            fcntl.flock(alive, fcntl.LOCK_EX | fcntl.LOCK_NB)
            held = alive.read().strip()
            if held:
                _kill_worker(int(held), own)
            caretaker.remove(str(own))


def _kill_worker(pid: int, own: Path) -> None:
    """Kills a group of processes if its first one is still the worker of that attempt: numbers are used again."""
    with contextlib.suppress(OSError):
        if str(own).encode() in Path(f"/proc/{pid}/cmdline").read_bytes():
            caretaker.kill(pid)


def note_worker(own: Path, pid: int) -> None:
    """For `sweep`: who works there."""
    (own / ALIVE).write_text(str(pid))


def wish(own: Path, grace_s: float) -> None:
    """Tells the attempt that works there to stop; executed on its node."""
    with contextlib.suppress(FileNotFoundError):  # it has ended
        temporary = own / f"{STOP}.tmp"
        temporary.write_text(json.dumps(grace_s))
        temporary.replace(own / STOP)


def wished(own: Path) -> float | None:
    """The grace time after which the attempt that works there is to be gone, s; None if it may go on."""
    file = own / STOP
    return float(json.loads(file.read_text())) if file.exists() else None
