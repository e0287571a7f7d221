"""One attempt on its way, seen from the bridge: a task is ordered, heard, told to stop, and given up."""

import contextlib
import logging
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ray
from ray.exceptions import OutOfMemoryError, RayError, RayTaskError, TaskCancelledError, WorkerCrashedError

from risk_sac.errors import ConfigError, DamagedError, RiskSacError
from risk_sac.execution.executor import Cause, Exited
from risk_sac.execution.local import Lease, Signs
from risk_sac.execution.postmortem import without_folders
from risk_sac.execution.ray import tasks
from risk_sac.execution.ray.attendant import attend
from risk_sac.execution.ray.exchange import Exchange
from risk_sac.execution.ray.scratch import sweep, wish
from risk_sac.execution.ray.settings import RaySettings, variable
from risk_sac.execution.ray.versions import Versions
from risk_sac.execution.ray.words import Order, Report

logger = logging.getLogger(__name__)

LOOK_S = 1.0
HELD_UP_S = 2.0  # longer between two looks, and it was this process that was held up
HURRY_S = 2.0  # on top of the grace of a run that is to stop, until its task is killed

Said = Callable[[Order, list[str]], None]


class Followed:
    """An attempt; a thread follows it, others may stop it or give it up.

    Attributes:
      order: what was ordered.
      node: Ray's name of the node that executes it; None until it begins.
    """

    def __init__(self, order: Order, settings: RaySettings, expected: Versions, said: Said) -> None:
        self.order = order
        self.node: str | None = None
        self._settings, self._expected, self._said = settings, expected, said
        self._files = Exchange(settings.ray_storage, order)
        self._reports: Any = None
        self._heard_at = time.monotonic()
        self._told_to_stop = False
        self._stop_by = math.inf
        self._given_up = threading.Event()

    @property
    def silent_s(self) -> float:
        """Since its last report, s."""
        return time.monotonic() - self._heard_at

    def give_up(self) -> None:
        """Nothing more is wanted of it; on return it writes no file any more."""
        self._given_up.set()
        self._files.close()
        self._kill()

    def stop(self, grace_s: float) -> None:
        """Its worker is told to stop; once the shortest grace time is over it is killed."""
        first, self._told_to_stop = not self._told_to_stop, True
        stop_by = time.monotonic() + grace_s
        shorter = stop_by < self._stop_by
        self._stop_by = min(self._stop_by, stop_by)
        if self.node is None or grace_s <= 0:
            self._kill()
        elif first or shorter:
            self._wish(self.node, grace_s)

    def _wish(self, node: str, grace_s: float) -> None:
        tasks.on_node(wish, node).remote(Path(self.order.scratch).parent, grace_s)

    def _kill(self) -> None:
        if self._reports is not None:
            ray.cancel(self._reports, force=True)

    def follow(self) -> Exited:
        """From the beginning to the end, and what became of it."""
        try:
            exited = self._executed()
        except (OSError, RiskSacError) as error:
            self._kill()
            logger.warning("run %d: %s", self.order.number, error)
            exited = Exited(_blamed(error), Cause.CRASHED)
        self._files.end()
        if self.node is not None and exited.cause is not Cause.ENDED:
            with contextlib.suppress(RayError):
                tasks.on_node(sweep, self.node).remote(self._settings.ray_scratch_dir)
        if self._told_to_stop and exited.cause is not Cause.ENDED:
            exited = Exited(exited.reason, Cause.ENDED, exited.status)
        return exited

    def _executed(self) -> Exited:
        root = self._files.begin()
        if root is None or self._told_to_stop:
            return Exited("stopped before it began", Cause.ENDED)
        task = tasks.of_a_run(attend, self._settings, f"run-{self.order.number}-{self.order.attempt}")
        self._reports = task.remote(self.order, root, self._settings.ray_lease_s, self._expected)
        try:
            return self._listened()
        except StopIteration:
            return Exited("the task ended without a word", Cause.CRASHED)
        except WorkerCrashedError:
            return Exited("the task was killed on its node", Cause.KILLED)
        except OutOfMemoryError:
            return Exited("the task was killed by Ray for want of memory on its node", Cause.KILLED)
        except TaskCancelledError:
            return Exited("the task was cancelled", Cause.KILLED)
        except RayTaskError as error:
            return Exited(_blamed(error.cause or error), Cause.CRASHED)
        except RayError as error:
            return Exited(f"its node was lost ({type(error).__name__})", Cause.KILLED)

    def _listened(self) -> Exited:
        lease = Lease(self._settings.ray_lease_s, math.inf)
        reports, looked_at = 0, time.monotonic()
        while not self._given_up.is_set():
            ready, _ = ray.wait([self._reports], timeout=LOOK_S)
            now = time.monotonic()
            if ready:
                report: Report = ray.get(next(self._reports))
                reports, self._heard_at = reports + 1, now
                if self.node is None:
                    self._began(report.node)
                self._tell(report)
                if report.exited is not None:
                    return report.exited
            watched_s, looked_at = min(now - looked_at, HELD_UP_S), now
            if self.node is not None and lease.passed(watched_s, Signs(words=reports)) is not None:
                self._kill()
                return Exited(f"nothing was heard of its node for {self._settings.ray_lease_s:g} s", Cause.STOPPED)
            if now >= self._stop_by + HURRY_S:
                self._kill()
                return Exited("killed after its grace time", Cause.ENDED)
        return Exited("another attempt has begun", Cause.ENDED)

    def _began(self, node: str) -> None:
        self.node = node
        if self._stop_by < math.inf:
            self._wish(node, max(0.0, self._stop_by - time.monotonic()))

    def _tell(self, report: Report) -> None:
        """Hands on what was said, after the files that it speaks of are here."""
        if report.published and not self._files.take():
            return
        if report.lines:
            self._said(self.order, [each.decode(errors="surrogateescape") for each in report.lines])


def _blamed(error: BaseException) -> str:
    """What an attempt failed for, with the setting to look at where there is one."""
    why = without_folders(str(error))
    if isinstance(error, ConfigError):
        return why
    if isinstance(error, OSError | DamagedError):
        return f"{variable('ray_storage')}: {why}"
    return f"{type(error).__name__}: {why}"
