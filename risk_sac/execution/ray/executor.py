"""Executes runs on a Ray cluster, through a bridge process.

The server knows Ray only through the bridge.
"""

import contextlib
import logging
import os
import queue
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from risk_sac.config import RunSpec
from risk_sac.egos import registry
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Cause, ClusterState, Exited, Messages, WorkerProgram, taken
from risk_sac.execution.messages import Event
from risk_sac.execution.ray import ADDRESS, read_settings
from risk_sac.execution.ray.node import EGOS, PLACES, Order
from risk_sac.run_folder.durable import scratch_name
from risk_sac.scenario import library
from risk_sac.scenario.reading import shipped_names
from risk_sac.search.prior.earlier import SHIPPED_OR_NONE, file_of

logger = logging.getLogger(__name__)

WAIT_S = 5.0  # between two attempts to reach a cluster that was lost
CLOSE_S = 10.0


class RayExecutor:
    """Executor of attempts on a Ray cluster.

    A thread listens to the bridge. When the cluster is lost, so are the attempts on it, and those that are submitted
    before there is a cluster again.

    Attributes:
      cluster: as it was a few seconds ago; without nodes while it is lost.
    """

    def __init__(self, program: WorkerProgram) -> None:
        """Reaches the cluster.

        Raises:
          ConfigError: Ray is not installed, the cluster cannot be reached, or it cannot do what it will have to;
            the field is the variable to look at.
        """
        if find_spec("ray") is None:
            raise ConfigError(
                "RISK_SAC_EXECUTOR", "'ray', which is not installed", "`local`, or `pip install risk-sac[ray]`"
            )
        self.cluster = ClusterState()
        self._program = program
        self._settings = read_settings()
        self._messages: Messages = queue.SimpleQueue()
        self._orders: dict[int, Order] = {}  # those that have not ended, by run
        self._lock = threading.RLock()
        self._closed = threading.Event()
        self._bridge = _Bridge()
        threading.Thread(target=self._work, name="ray", daemon=True).start()

    @property
    def slots(self) -> float:
        """See `Executor.slots`."""
        return self.cluster.slots

    def submit(self, number: int, spec: RunSpec, folder: Path, slots: int) -> None:
        """See `Executor.submit`."""
        folder.mkdir(parents=True, exist_ok=True)
        order = self._order(number, spec, folder.resolve(), slots)
        with self._lock:
            self._orders[number] = order
            if not self._bridge.say("submit", order):
                self._lose(order)

    def _order(self, number: int, spec: RunSpec, folder: Path, slots: int) -> Order:
        """Returns an attempt's order, with registered egos and the run's scenario."""
        beside: dict[str, Path] = {}
        if registered := os.environ.get(registry.FILE):
            beside[EGOS] = Path(registered).resolve()
        if spec.family not in shipped_names():
            kept = (library.library() / spec.family).resolve()
            beside |= {f"{PLACES}/{spec.family}/{file.name}": file for file in kept.iterdir()}
        if spec.prior not in SHIPPED_OR_NONE:
            beside[f"{PLACES}/{file_of(spec.prior)}"] = (library.library() / file_of(spec.prior)).resolve()
        return Order(
            number=number,
            spec=spec,
            slots=slots,
            program=self._program,
            folder=folder,
            scratch=self._settings.ray_scratch_dir / scratch_name(),
            beside=beside,
            settings=self._settings,
        )

    def events(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        """See `Executor.events`."""
        return taken(self._messages, timeout_s)

    def wake(self) -> None:
        """See `Executor.wake`."""
        self._messages.put(None)

    def cancel(self, number: int, grace_s: float) -> None:
        """See `Executor.cancel`."""
        with self._lock:
            if order := self._orders.get(number):
                order.told_to_stop = True
                self._bridge.say("cancel", order.id, grace_s)

    def silent_s(self, number: int) -> float | None:
        """See `Executor.silent_s`."""
        return next((node.silences[number] for node in self.cluster.nodes if number in node.silences), None)

    def close(self) -> None:
        """Leaves the cluster; actors that are still there end."""
        self._closed.set()
        self._bridge.close()

    def _work(self) -> None:
        """Listens to one bridge after the other."""
        while True:
            for kind, *content in self._bridge.messages():
                self._hear(kind, *content)
            with self._lock:
                self.cluster = ClusterState()
                self._lose(*self._orders.values())
            while True:
                logger.error("the cluster is lost; runs go on from their checkpoints once there is one again")
                if self._closed.wait(WAIT_S):
                    return
                with contextlib.suppress(ConfigError):
                    self._bridge = _Bridge()
                    break

    def _lose(self, *orders: Order) -> None:
        for order in orders:
            self._pass_on(order, Exited("the cluster was lost", Cause.LOST))

    def _hear(self, kind: str, *content: Any) -> None:
        with self._lock:
            if kind == "cluster":
                before, (self.cluster,) = self.cluster.slots, content
                if before != self.cluster.slots:
                    self._messages.put(None)
                return
            number, id_, messages = content
            order = self._orders.get(number)
            if order and order.id == id_:  # else it is the past that speaks
                self._pass_on(order, *messages)

    def _pass_on(self, order: Order, *messages: Event | Exited) -> None:
        for message in messages:
            if isinstance(message, Exited):
                del self._orders[order.number]
                message = replace(message, cause=Cause.ENDED) if order.told_to_stop else message
            self._messages.put((order.number, message))


class _Bridge:
    """The process that knows Ray."""

    def __init__(self) -> None:
        """Starts it and waits until it has checked the cluster.

        Raises:
          ConfigError: something is wrong with the cluster, or with what the settings say of it.
        """
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "risk_sac.execution.ray.bridge", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
                start_new_session=True,  # Ctrl-C is for our starter
            )
        self._connection = Connection(ours.detach())
        kind, *content = next(self.messages(), ("refused",))
        if kind == "refused":
            self.close()
            raise content[0] if content else ConfigError(ADDRESS, "Ray ended while it was reaching the cluster")

    def say(self, kind: str, *content: Any) -> bool:
        """Tells it something; returns False if it has ended."""
        with contextlib.suppress(OSError):
            self._connection.send((kind, *content))
            return True
        return False

    def messages(self) -> Iterator[tuple[Any, ...]]:
        """Yields its messages until it ends."""
        with contextlib.suppress(EOFError, OSError):
            while True:
                yield self._connection.recv()

    def close(self) -> None:
        """Ends it, and with it `messages`."""
        self.say("close")
        try:
            self._process.wait(CLOSE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
