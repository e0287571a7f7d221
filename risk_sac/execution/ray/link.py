"""The server's end of the bridge: started, listened to, and started again when the cluster has been lost."""

import json
import logging
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, Protocol

from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Cluster
from risk_sac.execution.ray.settings import variable
from risk_sac.execution.ray.words import cluster_of, line

logger = logging.getLogger(__name__)

FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 15.0  # between two attempts to reach a cluster that was lost
CLOSE_S = 10.0


class Listener(Protocol):
    """Who uses a link; called by its thread."""

    def hear(self, message: dict[str, Any]) -> None:
        """Something was said of an attempt."""

    def lose(self) -> None:
        """The cluster is gone, and all that was at work on it."""

    def go_on(self) -> None:
        """There is a cluster again, or it has changed."""


class Link:
    """One bridge after the other, and a thread that listens.

    Attributes:
      cluster: as it was a few seconds ago; without nodes while it is lost.
      losses: how often it was lost.
    """

    def __init__(self, within: Path | None = None) -> None:
        """Reaches the cluster.

        Args:
          within: folder that holds those of all runs; None leaves untried whether the nodes see it.

        Raises:
          ConfigError: it cannot be reached, or cannot do what it will have to; the field is the variable to look at.
        """
        self.cluster = Cluster()
        self.losses = 0
        self._listener: Listener | None = None
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._within = within
        first = Bridge(within)
        self._bridge: Bridge | None = first
        threading.Thread(target=self._listen, args=(first,), name="ray", daemon=True).start()

    def attach(self, listener: Listener) -> None:
        """From here on this one is told, and no other."""
        self._listener = listener

    def say(self, kind: str, **content: Any) -> bool:
        """Tells the bridge something; False if there is none at present."""
        with self._lock:
            if self._bridge is None:
                return False
            self._bridge.say(kind, **content)
            return True

    def close(self) -> None:
        """Leaves the cluster; tasks that are still there end."""
        self._closed.set()
        with self._lock:
            bridge, self._bridge = self._bridge, None
        if bridge is not None:
            bridge.close()

    def _listen(self, bridge: "Bridge") -> None:
        current: Bridge | None = bridge
        while current is not None:
            for message in current.messages():
                self._hear(message)
            current.close()
            if self._closed.is_set():
                return
            logger.error("the cluster is lost; runs go on from their checkpoints once there is one again")
            with self._lock:
                self._bridge, self.cluster = None, Cluster()
                self.losses += 1
            if self._listener is not None:
                self._listener.lose()
            current = self._reached_again()

    def _hear(self, message: dict[str, Any]) -> None:
        if message["kind"] == "nodes":
            before, self.cluster = self.cluster.slots, cluster_of(message["nodes"])
            if before != self.cluster.slots and self._listener is not None:
                self._listener.go_on()
        elif self._listener is not None:
            self._listener.hear(message)

    def _reached_again(self) -> "Bridge | None":
        """Another bridge, once there is a cluster; None if nobody wants one any more."""
        wait_s = FIRST_WAIT_S
        while not self._closed.wait(wait_s):
            try:
                bridge = Bridge(self._within)
            except ConfigError as error:
                logger.warning("the cluster cannot be reached: %s", error)
                wait_s = min(2 * wait_s, LONGEST_WAIT_S)
                continue
            with self._lock:
                self._bridge = None if self._closed.is_set() else bridge
            if self._closed.is_set():
                bridge.close()
                return None
            logger.info("there is a cluster again")
            if self._listener is not None:
                self._listener.go_on()
            return bridge
        return None


class Bridge:
    """The process that knows Ray."""

    def __init__(self, within: Path | None) -> None:
        """Starts it and waits until it has checked the cluster; `within` as `Link` has it.

        Raises:
          ConfigError: something is wrong with the cluster, or with what the settings say of it.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-m", "risk_sac.execution.ray.bridge", *([] if within is None else [str(within)])],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C is for whoever started us
        )
        self._saying = threading.Lock()
        first = self._next()
        if first is None or first["kind"] != "ready":
            self.close()
            if first is None:
                raise ConfigError(variable("ray_address"), "Ray ended while it was reaching the cluster")
            raise ConfigError(*first["error"])

    @property
    def _output(self) -> IO[bytes]:
        assert self._process.stdout is not None
        return self._process.stdout

    def _next(self) -> dict[str, Any] | None:
        try:
            text = self._output.readline()
        except ValueError:  # closed by another thread
            return None
        if not text.endswith(b"\n"):
            return None
        message: dict[str, Any] = json.loads(text)
        return message

    def messages(self) -> Iterator[dict[str, Any]]:
        """What it says until it ends."""
        while (message := self._next()) is not None:
            yield message

    def say(self, kind: str, **content: Any) -> None:
        """Tells it something; what it does not read any more is lost with it."""
        assert self._process.stdin is not None
        try:
            with self._saying:
                self._process.stdin.write(line(kind, **content))
                self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            logger.info("the bridge has ended")

    def close(self) -> None:
        """Ends it."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except BrokenPipeError:
            logger.info("the bridge has ended")
        try:
            self._process.wait(CLOSE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._output.close()
