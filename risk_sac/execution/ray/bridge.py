"""`python -m risk_sac.execution.ray.bridge FD`: the process that knows Ray, between the server and the cluster.

Ray ends the process that uses it when its cluster has been lost for a minute. So the server does not use it: it talks
to this process, and starts another one when this one has ended. The end of the connection `FD` ends this process, and
with it go its actors on all nodes.
"""

import contextlib
import logging
import math
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Cause, Cluster, Exited
from risk_sac.execution.postmortem import without_folders
from risk_sac.execution.ray.cluster import connected, nodes
from risk_sac.execution.ray.node import Attendant, Files, Order, read, versions, write
from risk_sac.execution.ray.settings import RaySettings, read_settings

logger = logging.getLogger("risk_sac.execution.ray.bridge")

LOOK_S = 1.0
HELD_UP_S = 2.0  # longer between two looks, and it was this process that was held up
HURRY_S = 2.0  # on top of the grace of a run that is to stop, until its actor is killed
NODES_S = 2.0
BEATS = 5  # reports within a lease


class _Over(Exception):
    """Nothing more is wanted of an attempt."""


class Attempt:
    """An attempt at a run; a thread follows it, others may stop it or give it up.

    Attributes:
      node: Ray's name of the node that executes it; None until its worker has begun.
    """

    def __init__(self, order: Order, settings: RaySettings, say: Callable[..., None]) -> None:
        self.order = order
        self.node: str | None = None
        self._settings = settings
        self._say = say
        self._lock = threading.Lock()
        self._killed = self._told_to_stop = False
        self._stop_by = math.inf
        self._heard_at = time.monotonic()
        self._actor: Any = None

    @property
    def silent_s(self) -> float:
        """Since its last report, s."""
        return time.monotonic() - self._heard_at

    def stop(self, grace_s: float) -> None:
        """Tells its worker to stop; after the shortest grace time it is killed.

        Once this returns after no grace time, it writes no file any more.
        """
        self._told_to_stop = True
        self._stop_by = min(self._stop_by, time.monotonic() + grace_s)
        if self.node is None or grace_s <= 0:
            self._kill()
        else:
            self._actor.cancel.remote(grace_s)

    def follow(self) -> None:
        """Passes on what it says from the beginning to the end, and what became of it."""
        try:
            exited = self._followed()
        except _Over as over:
            exited = Exited(str(over), Cause.STOPPED)
        except RayTaskError as error:
            exited = Exited(_blamed(error.cause or error), Cause.CRASHED)
        except RayError as error:
            exited = Exited(f"its actor or its node was lost ({type(error).__name__})", Cause.KILLED)
        except OSError as error:
            exited = Exited(_blamed(error), Cause.CRASHED)
        self._kill()
        self._say("said", self.order.id, [replace(exited, cause=Cause.ENDED) if self._told_to_stop else exited])

    def _followed(self) -> Exited:
        order, settings = self.order, self._settings
        memory = {"memory": settings.ray_memory_bytes_per_run} if settings.ray_memory_bytes_per_run else {}
        actor = ray.remote(Attendant).options(
            num_cpus=settings.ray_cpus_per_run, max_concurrency=2, scheduling_strategy="SPREAD", **memory
        )
        with self._lock:
            if self._killed:
                raise _Over("stopped before it began")
            self._actor = actor.remote()
        beside: Files = {name: path.read_bytes() for name, path in order.beside.items()}
        self.node = self._answer(self._actor.begin.remote(order, read(order.folder), beside, versions()))
        while True:
            messages, files = self._answer(self._actor.poll.remote(settings.ray_lease_s / BEATS))
            with self._lock:
                if self._killed:
                    raise _Over("killed")
                write(order.folder, files)  # before the words that tell of them
            exited: Exited | None = messages.pop() if messages and isinstance(messages[-1], Exited) else None
            if messages:
                self._say("said", order.id, messages)
            if exited is not None:
                return exited

    def _answer(self, reference: Any) -> Any:
        """Waits for a call of the actor; without a limit until the worker has begun, since it may wait for room."""
        silent_s, looked_at = 0.0, time.monotonic()
        while not ray.wait([reference], timeout=LOOK_S)[0]:
            now = time.monotonic()
            silent_s += min(now - looked_at, HELD_UP_S)
            looked_at = now
            if now >= self._stop_by + HURRY_S:
                raise _Over("killed after its grace time")
            if self.node is not None and silent_s >= self._settings.ray_lease_s:
                raise _Over(f"nothing was heard of its node for {self._settings.ray_lease_s:g} s")
        self._heard_at = time.monotonic()
        return ray.get(reference)

    def _kill(self) -> None:
        with self._lock:
            self._killed = True
        if self._actor is not None:
            with contextlib.suppress(RayError):  # there may be no head any more
                ray.kill(self._actor)


class Bridge:
    """Carries orders to the cluster and words back; a thread follows each attempt."""

    def __init__(self, settings: RaySettings, server: Connection) -> None:
        self._settings = settings
        self._server = server
        self._saying = threading.Lock()
        self._heard_of_head = time.monotonic()
        self._attempts: dict[str, Attempt] = {}

    def say(self, kind: str, *content: Any) -> None:
        """Says something to the server; the end of the connection ends this process elsewhere."""
        with self._saying:
            self._server.send((kind, *content))

    def carry(self) -> None:
        """Acts on what the server says, until it has gone or the head is silent: a cluster dies with its head."""
        self.say("ready")
        threading.Thread(target=self._watch, daemon=True).start()
        while time.monotonic() - self._heard_of_head <= self._settings.ray_lease_s:
            if not self._server.poll(LOOK_S):
                continue
            match self._server.recv():
                case "submit", Order() as order:
                    begun = self._attempts[order.id] = Attempt(order, self._settings, self.say)
                    threading.Thread(target=self._follow, args=(begun,), daemon=True).start()
                case "cancel", id_, grace_s:
                    if attempt := self._attempts.get(id_):
                        attempt.stop(grace_s)
                case _:
                    return
        logger.error("nothing was heard of the cluster's head for %g s", self._settings.ray_lease_s)

    def _follow(self, attempt: Attempt) -> None:
        attempt.follow()
        del self._attempts[attempt.order.id]

    def _watch(self) -> None:
        """Tells of the cluster every few seconds."""
        while True:
            found = nodes(self._settings)
            self._heard_of_head = time.monotonic()
            at_work = list(self._attempts.values())
            listed = []
            for node in found:
                silences = [each.silent_s for each in at_work if each.node == node.id]
                listed.append(replace(node, runs=len(silences), silent_s=min(silences, default=0.0)))
            self.say("cluster", Cluster(tuple(listed)))
            time.sleep(NODES_S)


def main(descriptor: int) -> None:
    """Connects, checks the cluster, and carries orders until the server has gone."""
    logging.basicConfig(level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    os.dup2(2, 1)  # what Ray prints is not the output of a command
    server = Connection(descriptor)
    try:
        settings = read_settings()
        with connected(settings), contextlib.suppress(EOFError, OSError):  # the server has gone
            Bridge(settings, server).carry()
    except ConfigError as error:
        server.send(("refused", error))
        return
    os._exit(0)


def _blamed(error: BaseException) -> str:
    why = without_folders(str(error))
    return why if isinstance(error, ConfigError) else f"{type(error).__name__}: {why}"


if __name__ == "__main__":
    main(int(sys.argv[1]))
