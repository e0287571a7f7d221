"""What is executed on a node: a task per attempt, which starts the worker, listens to it, and looks after its files.

The worker is a process of its own, as with the executor of one machine, which is used here: it knows what is to be
said of one that falls silent, lingers, or dies. The worker works in a folder of its node; what it leaves there goes
to the storage, and what it says goes to the server once the files that it speaks of are there.
"""

import logging
import math
import pkgutil
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

from risk_sac.config import RunSpec
from risk_sac.errors import RiskSacError
from risk_sac.execution.executor import Cause, Exited, Heard, Program
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.ray import storage
from risk_sac.execution.ray.caretaker import GONE_S, Caretaker
from risk_sac.execution.ray.scratch import BESIDE, note_worker, scratch, wished
from risk_sac.execution.ray.storage import FENCE, SEED, Place, Publisher, adopt
from risk_sac.execution.ray.versions import Versions, differing, versions
from risk_sac.execution.ray.words import Order, Report

logger = logging.getLogger(__name__)

GATHER_S = 0.25  # what a worker says within it is told at once
BEATS = 5  # signs of life within a lease
WRITTEN_S = 2.0  # between two publications of files that only grow
SHARE = 0.05  # of the time that such publications may take
STORAGE_PATIENCE_S = 60.0  # for a storage that refuses
Result = TypeVar("Result")


class OvertakenError(RiskSacError):
    """Nobody wants this attempt any more."""


def attend(order: Order, root: str, lease_s: float, expected: Versions) -> Iterator[Report]:
    """Executes an attempt; the last report has its end.

    Args:
      order: what to execute.
      root: URL of the attempt's folder in the storage.
      lease_s: how often to give a sign of life, several times within.
      expected: versions on the server's machine.
    """
    import ray  # here: the rest of this module is of use without it

    yield Report(node=ray.get_runtime_context().get_node_id())
    other = differing(versions(), expected)
    if other:
        yield Report(exited=Exited(f"a node has joined whose {other}", Cause.CRASHED))
        return
    attempt: _Attempt | None = None
    try:
        with scratch(Path(order.scratch)) as folder:
            attempt = yield from _meanwhile(lambda: _Attempt(order, folder, Place(root)), lease_s / BEATS)
            try:
                yield from attempt.reports(lease_s)
            finally:
                attempt.kill()
    finally:
        if attempt is not None:  # and its folder is gone, too; until then this process may be killed
            attempt.over()


def _meanwhile(work: Callable[[], Result], beat_s: float) -> Generator[Report, None, Result]:
    """Gives signs of life while something is done that may wait for a storage."""
    with ThreadPoolExecutor(1) as pool:
        doing = pool.submit(work)
        while not doing.done():
            wait([doing], timeout=beat_s)
            if not doing.done():
                yield Report()
        return doing.result()


class _Attempt:
    """A worker, its words and its files."""

    def __init__(self, order: Order, folder: Path, place: Place) -> None:
        self._folder, self._place = folder, place
        adopt(place, SEED, folder, {})
        adopt(place, storage.BESIDE, folder.parent / BESIDE, {})
        self._publisher = Publisher(folder, place)
        self._publisher_due = 0.0
        self._refused_since: float | None = None
        self._wished: float | None = None
        assert order.hear is not None
        hear = _raw(pkgutil.resolve_name(order.hear))
        program: Program[bytes] = Program(
            arguments=lambda spec, folder: order.arguments,
            log=order.log,
            hear=hear,
            lease_s=math.inf if order.lease_s is None else order.lease_s,
            stall_s=math.inf if order.stall_s is None else order.stall_s,
            linger_s=math.inf if order.linger_s is None else order.linger_s,
            environment=order.environment,
        )
        self._local = LocalExecutor(program)
        self._local.submit(1, 1, RunSpec.model_validate_json(order.spec), folder)
        self._pid = self._local.pid(1)
        self._log = folder / order.log
        if self._pid is not None:
            note_worker(folder.parent, self._pid)
            _caretaker().begin(self._pid, folder.parent)

    def kill(self) -> None:
        """Ends the worker, if it is still there."""
        self._local.cancel(1, 0)
        if self._pid is not None:
            deadline = time.monotonic() + GONE_S
            while self._local.pid(1) is not None and time.monotonic() < deadline:
                self._local.events(0.05)

    def over(self) -> None:
        """Nothing of it is left that its caretaker would have to see to."""
        if self._pid is not None:
            _caretaker().over(self._pid)

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
        grace_s = wished(self._folder.parent)
        if grace_s is not None and grace_s != self._wished:
            self._wished = grace_s
            self._local.cancel(1, grace_s)

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


@cache
def _caretaker() -> Caretaker:
    """One for all attempts that Ray lets this process attend, one after the other."""
    return Caretaker()
