"""What is executed on a node: a task per attempt, which starts the worker, listens to it, and looks after its files.

The worker is a process of its own, as with the executor of one machine, which is used here: it knows what is to be
said of one that falls silent, lingers, or dies. The worker works in a folder of its node; what it leaves there goes
to the storage, and what it says goes to the server once the files that it speaks of are there.
"""

import contextlib
import fcntl
import json
import logging
import math
import os
import pkgutil
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

from risk_sac.config import RunSpec
from risk_sac.errors import RiskSacError
from risk_sac.execution.executor import Cause, Exited, Heard, Program
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.ray import caretaker
from risk_sac.execution.ray.storage import FENCE, SEED, Place, Publisher, adopt
from risk_sac.execution.ray.words import Order, Report

logger = logging.getLogger(__name__)

PACKAGES = ("risk-sac", "ray", "libsumo", "torch", "botorch", "gpytorch", "rtamt", "numpy")
GATHER_S = 0.25  # what a worker says within it is told at once
BEATS = 5  # signs of life within a lease
WRITTEN_S = 2.0  # between two publications of files that only grow
SHARE = 0.05  # of the time that such publications may take
STORAGE_PATIENCE_S = 60.0  # for a storage that refuses
Result = TypeVar("Result")
STOP, ALIVE = "stop", "alive"


class OvertakenError(RiskSacError):
    """Nobody wants this attempt any more."""


def versions() -> dict[str, str]:
    """Of what a run's results depend on, on this node."""
    found = {"python": ".".join(map(str, sys.version_info[:3]))}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "missing"
    return found


def attend(order: Order, root: str, lease_s: float, expected: dict[str, str]) -> Iterator[Report]:
    """Executes an attempt; the last report has its end.

    Args:
      order: what to execute.
      root: URL of the attempt's folder in the storage.
      lease_s: how often to give a sign of life, several times within.
      expected: versions of packages on the server's machine.
    """
    import ray  # here: the rest of this module is of use without it

    yield Report(node=ray.get_runtime_context().get_node_id())
    found = versions()
    if found != expected:
        yield Report(exited=Exited(f"a node has joined whose {differing(found, expected)}", Cause.CRASHED))
        return
    with scratch(Path(order.scratch)) as folder:
        attempt = yield from _meanwhile(lambda: _Attempt(order, folder, Place(root)), lease_s / BEATS)
        try:
            yield from attempt.reports(lease_s)
        finally:
            attempt.kill()


def _meanwhile(work: Callable[[], Result], beat_s: float) -> Generator[Report, None, Result]:
    """Gives signs of life while something is done that may wait for a storage."""
    with ThreadPoolExecutor(1) as pool:
        doing = pool.submit(work)
        while not doing.done():
            wait([doing], timeout=beat_s)
            if not doing.done():
                yield Report()
        return doing.result()


def differing(found: dict[str, str], expected: dict[str, str]) -> str:
    """Which packages have another version than on the server."""
    other = [f"{name} is {found[name]}; wanted {expected[name]}" for name in expected if found[name] != expected[name]]
    return ", ".join(other) + ", as on the server's machine"


@contextlib.contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A folder for a worker, inside one of the attempt's own; gone afterwards, even if this process is killed."""
    own = folder.parent
    own.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    if own.parent.stat().st_uid != os.getuid():
        raise PermissionError(f"{own.parent} belongs to somebody else; RISK_SAC_RAY_SCRATCH_DIR names another folder")
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


def wish(scratch_of: str, grace_s: float) -> None:
    """Tells the attempt that works there to stop; executed on its node."""
    own = Path(scratch_of).parent
    with contextlib.suppress(FileNotFoundError):  # it has ended
        temporary = own / f"{STOP}.tmp"
        temporary.write_text(json.dumps(grace_s))
        temporary.replace(own / STOP)


class _Attempt:
    """A worker, its words and its files."""

    def __init__(self, order: Order, folder: Path, place: Place) -> None:
        self._folder, self._place = folder, place
        adopt(place, SEED, folder, {})
        for name, text in order.inputs.items():
            Path(name).write_text(text, encoding="utf-8")
        self._publisher = Publisher(folder, place)
        self._publisher_due = 0.0
        self._refused_since: float | None = None
        self._wished: str | None = None
        hear = None if order.hear is None else _raw(pkgutil.resolve_name(order.hear))
        program: Program[bytes] = Program(
            arguments=lambda spec, folder: order.arguments,
            log=order.log,
            hear=hear,
            lease_s=math.inf if order.lease_s is None else order.lease_s,
            stall_s=math.inf if order.stall_s is None else order.stall_s,
            linger_s=math.inf if order.linger_s is None else order.linger_s,
        )
        self._local = LocalExecutor(program)
        self._local.submit(1, 1, RunSpec.model_validate_json(order.spec), folder)
        self._pid = self._local.pid(1)
        self._log = folder / order.log
        if self._pid is not None:
            (folder.parent / ALIVE).write_text(str(self._pid))
            _caretaker().begin(self._pid, folder.parent)

    def kill(self) -> None:
        """Ends the worker, if it is still there."""
        self._local.cancel(1, 0)
        if self._pid is not None:
            deadline = time.monotonic() + caretaker.GONE_S
            while self._local.pid(1) is not None and time.monotonic() < deadline:
                self._local.events(0.05)
            _caretaker().over(self._pid, self._folder.parent)

    def reports(self, lease_s: float) -> Iterator[Report]:
        """What is to be told, as it happens."""
        beat_s = lease_s / BEATS
        lines: list[bytes] = []
        exited: Exited | None = None
        told_at = time.monotonic()
        while True:
            if exited is None:
                for _, message in self._local.events(GATHER_S):
                    if isinstance(message, Exited):
                        exited = message
                    else:
                        lines.append(message)
                self._stop_if_wished()
            elif self._refused_since is not None:
                time.sleep(GATHER_S)
            final, heard = exited is not None, bool(lines)
            due = final or heard or time.monotonic() >= self._publisher_due
            published = due and (yield from _meanwhile(partial(self._publish, final=final, heard=heard), beat_s))
            ready = self._refused_since is None
            now = time.monotonic()
            if ready and exited is not None:
                yield Report(lines=tuple(lines), published=published, exited=exited)
                return
            if (ready and (lines or published)) or now - told_at >= beat_s:
                yield Report(lines=tuple(lines) if ready else (), published=published)
                lines = [] if ready else lines
                told_at = now

    def _stop_if_wished(self) -> None:
        file = self._folder.parent / STOP
        if file.exists():
            wished = file.read_text()
            if wished != self._wished:
                self._wished = wished
                self._local.cancel(1, json.loads(wished))

    def _publish(self, *, final: bool, heard: bool) -> bool:
        """Brings what has changed into the storage; a storage that refuses is tried again for a while."""
        now = time.monotonic()
        due = now >= self._publisher_due
        new, written = self._publisher.changed()
        names = new + (written if final or due else [])
        if not names:
            if due:
                self._publisher_due = now + WRITTEN_S
            return False
        try:
            if not self._place.has(FENCE):
                raise OvertakenError("another attempt at this run has begun")
            self._publisher.publish(names)
        except OSError as error:
            self._refused_since = self._refused_since or now
            if now - self._refused_since > STORAGE_PATIENCE_S:
                raise
            logger.warning("the storage refuses: %s", error)
            return False
        self._refused_since = None
        if due:
            took_s = time.monotonic() - now
            self._publisher_due = now + max(WRITTEN_S, took_s / SHARE)
        return True


def _raw(hear: Callable[[bytes], Heard[Any]]) -> Callable[[bytes], Heard[bytes]]:
    """Understands a line as the server will, and hands it on as it is."""

    def heard(line: bytes) -> Heard[bytes]:
        understood = hear(line)
        return Heard(None if understood.word is None else line, understood.progress, understood.last)

    return heard


class _Caretaker:
    """The process that ends this one's workers, should this one be killed."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-IS", caretaker.__file__],
            stdin=subprocess.PIPE,
            start_new_session=True,
            bufsize=0,
        )

    def begin(self, pid: int, folder: Path) -> None:
        self._say(f"+{pid} {folder}\n")

    def over(self, pid: int, folder: Path) -> None:
        self._say(f"-{pid} {folder}\n")

    def _say(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(text.encode())


_OF_THIS_PROCESS: list[_Caretaker] = []


def _caretaker() -> _Caretaker:
    """One for all attempts that Ray lets this process attend, one after the other."""
    if not _OF_THIS_PROCESS:
        _OF_THIS_PROCESS.append(_Caretaker())
    return _OF_THIS_PROCESS[0]
