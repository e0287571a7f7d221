"""`python -m risk_sac.execution.ray.bridge`: stands between server and cluster, and may die in the server's place.

Ray ends the process that uses it when its cluster is lost for a minute. So the server does not use it: it talks to
this process by lines of JSON, and starts another one when this one has ended. The end of standard input ends it, and
with it go its tasks on all nodes.
"""

import contextlib
import json
import logging
import math
import os
import sys
import threading
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import IO, Any

import ray
from ray.exceptions import (
    OutOfMemoryError,
    RayError,
    RayTaskError,
    TaskCancelledError,
    WorkerCrashedError,
)
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from risk_sac.errors import ConfigError, RiskSacError
from risk_sac.execution.executor import Cause, Exited
from risk_sac.execution.lease import Lease, Signs
from risk_sac.execution.postmortem import without_folders
from risk_sac.execution.ray import checks
from risk_sac.execution.ray.attendant import attend, sweep, versions, wish
from risk_sac.execution.ray.join import joined
from risk_sac.execution.ray.settings import RaySettings, read_settings
from risk_sac.execution.ray.storage import FENCE, MANIFEST, Place, adopt, root_of, sow
from risk_sac.execution.ray.words import Order, Report, exited_json, line, order_of

logger = logging.getLogger("risk_sac.execution.ray.bridge")

LOOK_S = 1.0
HELD_UP_S = 2.0  # longer between two looks, and it was this process that was held up
NODES_S = 2.0
HURRY_S = 2.0  # on top of the grace of a run that is to stop, until its task is killed


class Bridge:
    """Carries orders to the cluster and reports back; a thread follows each attempt."""

    def __init__(self, settings: RaySettings, words: IO[bytes]) -> None:
        self._settings = settings
        self._words = words
        self._telling = threading.Lock()
        self._lock = threading.Lock()
        self._latest: dict[int, _Followed] = {}
        self._expected = versions()
        self.heard_of_head = time.monotonic()

    def tell(self, kind: str, **content: Any) -> None:
        """Says something to the server."""
        message = line(kind, **content)
        with self._telling:
            self._words.write(message)
            self._words.flush()

    def submit(self, order: Order) -> None:
        """Begins an attempt; an older one at the same run is given up."""
        followed = _Followed(self, order, self._settings, self._expected)
        with self._lock:
            overtaken = self._latest.get(order.number)
            self._latest[order.number] = followed
        threading.Thread(target=followed.follow, args=(overtaken,), daemon=True).start()

    def cancel(self, number: int, token: str, grace_s: float) -> None:
        """Tells an attempt to stop."""
        with self._lock:
            followed = self._latest.get(number)
        if followed is not None and followed.order.token == token:
            followed.stop(grace_s)

    def over(self, followed: "_Followed", exited: Exited) -> None:
        """Tells of an attempt's end, unless another one has begun."""
        with self._lock:
            if self._latest.get(followed.order.number) is not followed:
                return
            del self._latest[followed.order.number]
        order = followed.order
        self.tell("exited", number=order.number, token=order.token, exited=exited_json(exited))

    def watch(self) -> None:
        """Tells of the cluster every few seconds."""
        while True:
            found = ray.nodes()
            self.heard_of_head = time.monotonic()
            with self._lock:
                at_work = list(self._latest.values())
            nodes = []
            for node in checks.nodes(found, self._settings):
                silences = [each.silent_s for each in at_work if each.node == node.id]
                nodes.append(asdict(replace(node, runs=len(silences), silent_s=min(silences, default=0.0))))
            self.tell("nodes", nodes=nodes)
            time.sleep(NODES_S)


class _Followed:
    """One attempt on its way."""

    def __init__(self, bridge: Bridge, order: Order, settings: RaySettings, expected: dict[str, str]) -> None:
        self.order = order
        self.node: str | None = None
        self._bridge, self._settings, self._expected = bridge, settings, expected
        self._reports: Any = None
        self._heard_at = time.monotonic()
        self._told_to_stop = False
        self._stop_by = math.inf
        self._given_up = threading.Event()
        self._files = threading.Lock()  # a run's folder is written by its latest attempt alone
        self._root = self._own = ""  # URLs in the storage, of the run and of this attempt

    @property
    def silent_s(self) -> float:
        """Since its last report, s."""
        return time.monotonic() - self._heard_at

    def give_up(self) -> None:
        """Nothing more is wanted of it; on return it writes no file any more."""
        self._given_up.set()
        with self._files:
            pass
        if self._reports is not None:
            ray.cancel(self._reports, force=True)

    def stop(self, grace_s: float) -> None:
        """Its worker is told to stop; once the shortest grace time is over it is killed."""
        first, self._told_to_stop = not self._told_to_stop, True
        stop_by = time.monotonic() + grace_s
        shorter = stop_by < self._stop_by
        self._stop_by = min(self._stop_by, stop_by)
        if self.node is None or grace_s <= 0:
            self._kill()
        elif first or shorter:
            _on_node(wish, self.node).remote(self.order.scratch, grace_s)

    def _kill(self) -> None:
        if self._reports is not None:
            ray.cancel(self._reports, force=True)

    def follow(self, overtaken: "_Followed | None") -> None:
        """From the beginning to the end."""
        if overtaken is not None:
            overtaken.give_up()
        try:
            exited = self._followed()
        except (OSError, RiskSacError) as error:
            self._kill()
            logger.warning("run %d: %s", self.order.number, error)
            exited = Exited(f"RISK_SAC_RAY_STORAGE: {without_folders(str(error))}", Cause.CRASHED)
        exited = self._settled(exited)
        if self._told_to_stop and exited.cause is not Cause.ENDED:
            exited = Exited(exited.reason, Cause.ENDED, exited.status)
        self._bridge.over(self, exited)

    def _followed(self) -> Exited:
        folder = Path(self.order.folder)
        self._known: dict[str, str] = {}
        self._root = root_of(self._settings.ray_storage, folder)
        self._own = f"{self._root}/{self.order.attempt:05d}-{self.order.token}"
        for name in Place(self._root).names():  # of a server that was killed
            left = Place(f"{self._root}/{name}")
            adopt(left, MANIFEST, folder, {})
            left.remove()
        place = Place(self._own)
        sow(place, folder)
        place.write(FENCE, b"")
        if self._given_up.is_set() or self._told_to_stop:
            return Exited("stopped before it began", Cause.ENDED)
        self._reports = checks.task(
            attend, self._settings, name=f"run-{self.order.number}-{self.order.attempt}"
        ).remote(self.order, self._own, self._settings.ray_lease_s, self._expected)
        try:
            return self._listened(folder, place)
        except StopIteration:
            return Exited("the task ended without a word", Cause.CRASHED)
        except WorkerCrashedError:
            return Exited("the task was killed on its node", Cause.KILLED)
        except OutOfMemoryError:
            return Exited("the task was killed by Ray for want of memory on its node", Cause.KILLED)
        except TaskCancelledError:
            return Exited("the task was cancelled", Cause.KILLED)
        except RayTaskError as error:
            raise OSError(f"{type(error.cause).__name__}: {error.cause}") from error
        except RayError as error:
            return Exited(f"its node was lost ({type(error).__name__})", Cause.KILLED)

    def _listened(self, folder: Path, place: Place) -> Exited:
        lease = Lease(self._settings.ray_lease_s, math.inf)
        reports, looked_at = 0, time.monotonic()
        while not self._given_up.is_set():
            ready, _ = ray.wait([self._reports], timeout=LOOK_S)
            now = time.monotonic()
            if ready:
                report: Report = ray.get(next(self._reports))
                reports, self._heard_at = reports + 1, now
                if self.node is None:
                    self._began(report)
                self._told(report, folder, place)
                if report.exited is not None:
                    return report.exited
            watched_s, looked_at = min(now - looked_at, HELD_UP_S), now
            if self.node is not None and lease.passed(watched_s, Signs(words=reports)) is not None:
                self._kill()
                return Exited(f"nothing was heard of its node for {self._settings.ray_lease_s:g} s", Cause.STOPPED)
            if now >= self._stop_by + HURRY_S:
                self._kill()
                return Exited("killed after its grace time", Cause.ENDED)
        raise OSError("overtaken")

    def _began(self, report: Report) -> None:
        self.node = report.node
        if self._stop_by < math.inf:
            _on_node(wish, self.node).remote(self.order.scratch, max(0.0, self._stop_by - time.monotonic()))

    def _told(self, report: Report, folder: Path, place: Place) -> None:
        """Hands on what was said, after the files that it speaks of are here."""
        with self._files:
            if self._given_up.is_set():
                return
            if report.published:
                adopt(place, MANIFEST, folder, self._known)
        if report.lines:
            lines = [each.decode(errors="surrogateescape") for each in report.lines]
            self._bridge.tell("said", number=self.order.number, token=self.order.token, lines=lines)

    def _settled(self, exited: Exited) -> Exited:
        """Takes over the last files of an attempt, and removes them from the storage."""
        with self._files:
            if self._given_up.is_set():
                return exited
            place = Place(self._own)
            try:
                place.remove(FENCE)
                adopt(place, MANIFEST, Path(self.order.folder), self._known)
                place.remove()
                if not Place(self._root).names():
                    Place(self._root).remove()
            except (OSError, RiskSacError) as error:
                logger.warning("run %d: the last files stay in the storage: %s", self.order.number, error)
        if self.node is not None and exited.cause is not Cause.ENDED:
            with contextlib.suppress(RayError):
                _on_node(sweep, self.node).remote(self._settings.ray_scratch_dir)
        return exited


def _on_node(function: Any, node: str) -> Any:
    strategy = NodeAffinitySchedulingStrategy(node, soft=False)
    return ray.remote(function).options(num_cpus=0, max_retries=0, scheduling_strategy=strategy)


def main() -> None:
    """Connects, checks the cluster, and carries orders until nobody gives any more."""
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    words = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what Ray prints of itself is no message
    settings = read_settings()
    bridge = Bridge(settings, words)
    try:
        with joined(settings):
            checks.connect(settings)
            checks.check(settings)
            bridge.tell("ready")
            _carry(bridge, settings.ray_lease_s)
    except ConfigError as error:
        bridge.tell("refused", message=str(error), field=error.field)
        return
    os._exit(0)


def _carry(bridge: Bridge, lease_s: float) -> None:
    """Until nobody gives orders any more, or the head is gone: a cluster dies with it."""
    over = threading.Event()
    threading.Thread(target=bridge.watch, daemon=True).start()
    threading.Thread(target=_listen, args=(bridge, over), daemon=True).start()
    while not over.wait(LOOK_S):
        if time.monotonic() - bridge.heard_of_head > lease_s:
            logger.error("nothing was heard of the cluster's head for %g s", lease_s)
            return


def _listen(bridge: Bridge, over: threading.Event) -> None:
    for text in sys.stdin:
        content = json.loads(text)
        if content.pop("kind") == "submit":
            bridge.submit(order_of(content))
        else:
            bridge.cancel(content["number"], content["token"], content["grace_s"])
    over.set()


if __name__ == "__main__":
    main()
