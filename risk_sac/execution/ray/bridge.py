"""`python -m risk_sac.execution.ray.bridge FD`: process between server and Ray cluster.

Ray ends the process that uses it when its cluster has been lost for a minute. So the server does not use it: it talks
to this process, and starts another one when this one has ended. The end of the connection `FD` ends this process, and
with it go its actors on all nodes.
"""

import asyncio
import contextlib
import ipaddress
import logging
import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from risk_sac import __version__
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Cause, ClusterNode, ClusterState, Exited
from risk_sac.execution.messages import without_folders
from risk_sac.execution.ray import ADDRESS, RaySettings, read_settings, variable
from risk_sac.execution.ray.attendant import BEATS, Attendant, resources
from risk_sac.execution.ray.node import Files, Order, check, read, versions, write
from risk_sac.host.terminal import log_to_stderr

logger = logging.getLogger("risk_sac.execution.ray.bridge")

TOKEN_MODE = "RAY_AUTH_MODE"  # environment variable that Ray reads
HEAD_S = 10.0
PROBE_S = 60.0


def connect(settings: RaySettings) -> None:
    """Makes this process a client of the cluster.

    Raises:
      ConfigError: nothing answers; it is no head; it has another version or token; it is open to other machines without
        a token; or a node lacks what its runs need.
    """
    if settings.ray_address != "auto":
        _check_head(settings.ray_address)
    try:
        ray.init(
            address=settings.ray_address,
            log_to_driver=False,
            logging_level=logging.ERROR,
            configure_logging=False,
        )
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        got = f"{settings.ray_address!r}: {' '.join(str(error).split())}"
        expected = f"the head of a cluster of Ray {ray.__version__}, with its token where {TOKEN_MODE} is set"
        raise ConfigError(ADDRESS, got, expected) from error
    check_token(ray.get_runtime_context().gcs_address.rpartition(":")[0])
    _check_nodes(settings)


def nodes(settings: RaySettings) -> list[ClusterNode]:
    """The machines of the cluster, with their room for runs."""
    listed = []
    for node in ray.nodes():
        resources = node.get("Resources", {}) if node["Alive"] else {}
        slots = int(resources.get("CPU", 0) / settings.ray_cpus_per_run + 1e-9)
        if settings.ray_memory_bytes_per_run:
            slots = min(slots, int(resources.get("memory", 0) / settings.ray_memory_bytes_per_run))
        listed.append(
            ClusterNode(id=node["NodeID"], address=node["NodeManagerAddress"], alive=node["Alive"], slots=slots)
        )
    return listed


def check_token(host: str) -> None:
    """Refuses a cluster that other machines reach, unless it wants a token.

    Raises:
      ConfigError: it has an address of a network, and Ray's tokens are off.
    """
    if os.environ.get(TOKEN_MODE) == "token":
        return
    with contextlib.suppress(OSError, ValueError):
        found = {ipaddress.ip_address(entry[4][0]) for entry in socket.getaddrinfo(host.strip("[]"), None)}
        if all(address.is_loopback for address in found):
            return
    raise ConfigError(
        TOKEN_MODE,
        f"{os.environ.get(TOKEN_MODE, '')!r} with {ADDRESS} on {host}, which other machines may reach",
        f"{TOKEN_MODE}=token on all nodes, with a token in RAY_AUTH_TOKEN or RAY_AUTH_TOKEN_PATH",
    )


def _check_head(address: str) -> None:
    """Asks whether anything answers, before Ray itself tries for minutes."""
    host, _, port = address.rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=HEAD_S).close()
    except (OSError, OverflowError, ValueError) as error:
        got = f"{address!r}, where nothing answers ({error})"
        raise ConfigError(ADDRESS, got, "`auto` or HOST:PORT of the head of a Ray cluster") from error
    check_token(host)


def _check_nodes(settings: RaySettings) -> None:
    """Checks versions and scratch folder of every node that has room."""
    able = [node for node in nodes(settings) if node.slots]
    if not able:
        got = f"{settings.ray_cpus_per_run:g} processors and {settings.ray_memory_bytes_per_run} bytes for a run"
        raise ConfigError(variable("ray_cpus_per_run"), f"{got}; no node of the cluster has as much")
    task = ray.remote(check)
    asked = []
    for node in able:
        there = NodeAffinitySchedulingStrategy(node.id, soft=False)
        options = task.options(num_cpus=0, max_retries=0, scheduling_strategy=there)
        asked.append(options.remote(settings.ray_scratch_dir, versions()))
    for reference in asked:
        try:
            ray.get(reference, timeout=PROBE_S)
        except RayTaskError as error:
            if isinstance(error.cause, ConfigError):
                raise error.cause from None
            got = f"a cluster that cannot run what is here ({str(error.cause).partition(chr(10))[0]})"
            raise ConfigError(ADDRESS, got, f"risk-sac {__version__} with all its packages on each node") from error
        except RayError as error:  # it is gone, or does not answer in time
            logger.warning("a node was lost: %s", type(error).__name__)


HURRY_S = 2.0  # on top of the grace of a run that is to stop, until its actor is killed
NODES_S = 2.0
LOOKS = 15  # within a lease


class Attempt:
    """An attempt at a run, followed from its beginning to its end.

    Attributes:
      node: Ray's name of the node that executes it; None until its worker has begun.
      task: ends with the attempt.
    """

    def __init__(self, order: Order, say: Callable[..., None]) -> None:
        self.node: str | None = None
        self._order = order
        self._say = say
        self._writing = threading.Lock()
        self._over = False
        self._heard_at = time.monotonic()
        actor = ray.remote(Attendant).options(
            max_concurrency=2, scheduling_strategy="SPREAD", **resources(order.settings)
        )
        self._actor: Any = actor.remote()
        self.task = asyncio.create_task(self._follow())

    @property
    def number(self) -> int:
        """Its run."""
        return self._order.number

    @property
    def silent_s(self) -> float:
        """Since its last report, s."""
        return time.monotonic() - self._heard_at

    def stop(self, grace_s: float) -> None:
        """Tells its worker to stop; kills the actor after the grace time."""
        if self.node is None:
            self.task.cancel()
        else:
            self._actor.cancel.remote(grace_s)
            asyncio.get_running_loop().call_later(grace_s + HURRY_S, self.task.cancel)

    async def _follow(self) -> None:
        try:
            exited = await self._followed()
        except asyncio.CancelledError:
            exited = Exited("killed after its grace time", Cause.STOPPED)
        except RayTaskError as error:
            exited = Exited(_blamed(error.cause or error), Cause.CRASHED)
        except RayError as error:
            exited = Exited(f"its actor or its node was lost ({type(error).__name__})", Cause.KILLED)
        except TimeoutError:
            exited = Exited(f"nothing was heard of its node for {self._order.settings.ray_lease_s:g} s", Cause.STOPPED)
        except OSError as error:
            exited = Exited(_blamed(error), Cause.CRASHED)
        with self._writing:
            self._over = True
        with suppress(RayError):  # there may be no head any more
            ray.kill(self._actor)
        self._say("said", self._order.number, self._order.id, [exited])

    async def _followed(self) -> Exited:
        """Passes on messages after the files written before them; returns the end."""
        order = self._order
        beside: Files = {name: path.read_bytes() for name, path in order.beside.items()}
        seed = await asyncio.to_thread(read, order.folder)
        self.node = await self._actor.begin.remote(order, seed, beside, versions())  # it may wait for room
        while True:
            messages, files = await self._report()
            await asyncio.to_thread(self._write, files)
            exited: Exited | None = messages.pop() if messages and isinstance(messages[-1], Exited) else None
            if messages:
                self._say("said", order.number, order.id, messages)
            if exited is not None:
                return exited

    async def _report(self) -> Any:
        """Waits for the next report for as long as the lease.

        The lease is divided into looks; a time for which this process stood still is one look.
        """
        lease_s = self._order.settings.ray_lease_s
        report = asyncio.wrap_future(self._actor.poll.remote(lease_s / BEATS).future())
        try:
            for _ in range(LOOKS):
                if (await asyncio.wait([report], timeout=lease_s / LOOKS))[0]:
                    self._heard_at = time.monotonic()
                    return report.result()
        finally:
            report.cancel()
        raise TimeoutError

    def _write(self, files: Files) -> None:
        with self._writing:
            if not self._over:
                write(self._order.folder, files)


class Bridge:
    """Carries orders to the cluster and words back."""

    def __init__(self, settings: RaySettings, server: Connection) -> None:
        self._settings = settings
        self._server = server
        self._over = asyncio.Event()
        self._attempts: dict[str, Attempt] = {}

    def say(self, kind: str, *content: Any) -> None:
        """Says something to the server."""
        self._server.send((kind, *content))

    async def carry(self) -> None:
        """Executes the server's orders until it leaves; reports the cluster every `NODES_S`.

        Raises:
          TimeoutError: the head is silent, with which a cluster dies.
        """
        asyncio.get_running_loop().add_reader(self._server.fileno(), self._hear)
        while not self._over.is_set():
            found = await asyncio.wait_for(asyncio.to_thread(nodes, self._settings), self._settings.ray_lease_s)
            listed = []
            for node in found:
                here = [each for each in self._attempts.values() if each.node == node.id]
                listed.append(replace(node, silences={each.number: each.silent_s for each in here}))
            self.say("cluster", ClusterState(tuple(listed)))
            with suppress(TimeoutError):
                await asyncio.wait_for(self._over.wait(), NODES_S)

    def _hear(self) -> None:
        try:
            message = self._server.recv()
        except (EOFError, OSError):
            message = ("close",)
        match message:
            case "submit", Order() as order:
                attempt = self._attempts[order.id] = Attempt(order, self.say)
                attempt.task.add_done_callback(lambda _: self._attempts.pop(order.id))
            case "cancel", id_, grace_s if id_ in self._attempts:
                self._attempts[id_].stop(grace_s)
            case "close", *_:
                self._over.set()


def main(descriptor: int) -> None:
    """Connects, checks the cluster, and carries orders until the server has gone."""
    log_to_stderr()
    os.dup2(2, 1)  # what Ray prints is not the output of a command
    server = Connection(descriptor)
    try:
        settings = read_settings()
        connect(settings)
    except ConfigError as error:
        server.send(("refused", error))
        return
    server.send(("ready",))
    try:
        asyncio.new_event_loop().run_until_complete(Bridge(settings, server).carry())
    except (TimeoutError, RayError) as error:
        logger.error("nothing was heard of the cluster's head for %g s %s", settings.ray_lease_s, error)
    finally:
        os._exit(0)


def _blamed(error: BaseException) -> str:
    why = without_folders(str(error))
    return why if isinstance(error, ConfigError) else f"{type(error).__name__}: {why}"


if __name__ == "__main__":
    main(int(sys.argv[1]))
