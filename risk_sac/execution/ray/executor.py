"""Runs as tasks of a Ray cluster, seen from the server: it knows Ray only through the bridge, a process of its own."""

import math
import secrets
import threading
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Generic

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Cause, Cluster, Exited, Program, Word
from risk_sac.execution.mailbox import Mailbox
from risk_sac.execution.ray.beside import beside
from risk_sac.execution.ray.link import Link
from risk_sac.execution.ray.scratch import BESIDE
from risk_sac.execution.ray.settings import read_settings
from risk_sac.execution.ray.words import Order, exited_of

FOREVER_S = 1e9  # JSON has no infinity


@dataclass(slots=True)
class _Ordered:
    """An attempt that has not ended."""

    order: Order
    sent: bool = False
    told_to_stop: bool = False


class RayExecutor(Generic[Word]):
    """Orders attempts and hands on what is said of them.

    When the cluster is lost, what was at work on it is told to be lost, and what is submitted waits until there is a
    cluster again. Each attempt has a token; what is said with another one is dropped.
    """

    def __init__(self, program: Program[Word], link: Link | None = None) -> None:
        """Reaches the cluster.

        Args:
          program: how a worker is started.
          link: to the cluster, of which somebody else takes care; by default one of its own.

        Raises:
          ConfigError: Ray is not installed, the cluster cannot be reached, or it cannot do what it will have to;
            the field is the variable to look at.
        """
        if find_spec("ray") is None:
            raise ConfigError(
                "RISK_SAC_EXECUTOR", "'ray', which is not installed", "`local`, or `pip install risk-sac[ray]`"
            )
        self._program = program
        self._settings = read_settings()
        self._mailbox: Mailbox[Word] = Mailbox()
        self._ordered: dict[int, _Ordered] = {}
        self._lock = threading.RLock()
        self._own = link is None
        self._link = link or Link(program.within)
        self._link.attach(self)

    @property
    def cluster(self) -> Cluster:
        """As it was a few seconds ago; without nodes while it is lost."""
        return self._link.cluster

    @property
    def losses(self) -> int:
        """How often the cluster was lost."""
        return self._link.losses

    @property
    def slots(self) -> float:
        """See `Executor.slots`."""
        return self._link.cluster.slots

    def submit(self, number: int, attempt: int, spec: RunSpec, folder: Path) -> None:
        """See `Executor.submit`."""
        self._mailbox.admit(number, attempt)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            order = self._order(number, attempt, spec, folder)
        except OSError:
            self._mailbox.dismiss(number)
            raise
        with self._lock:
            self._ordered[number] = ordered = _Ordered(order)
            self._send(ordered)

    def _order(self, number: int, attempt: int, spec: RunSpec, folder: Path) -> Order:
        token = secrets.token_hex(8)
        own = self._settings.ray_scratch_dir / f"{folder.name}-{attempt}-{token}"
        scratch = own / folder.name
        copies = {str(path): str(own / BESIDE / path.name) for path in self._program.inputs}
        taken = beside(spec, self._program.inputs, own / BESIDE)
        hear = self._program.hear
        return Order(
            number=number,
            attempt=attempt,
            token=token,
            spec=spec.model_dump_json(),
            folder=str(folder.resolve()),
            scratch=str(scratch),
            arguments=tuple(copies.get(each, each) for each in self._program.arguments(spec, scratch)),
            beside=taken.files,
            environment=taken.environment | dict(self._program.environment),
            log=self._program.log,
            hear=None if hear is None else f"{hear.__module__}:{hear.__qualname__}",
            lease_s=_finite(self._program.lease_s),
            stall_s=_finite(self._program.stall_s),
            linger_s=_finite(self._program.linger_s),
        )

    def _send(self, ordered: _Ordered) -> None:
        ordered.sent = self._link.say("submit", **asdict(ordered.order))

    def events(self, timeout_s: float) -> list[tuple[int, Word | Exited]]:
        """See `Executor.events`."""
        return self._mailbox.take(timeout_s)

    def wake(self) -> None:
        """See `Executor.wake`."""
        self._mailbox.wake()

    def cancel(self, number: int, grace_s: float) -> None:
        """See `Executor.cancel`."""
        with self._lock:
            ordered = self._ordered.get(number)
            if ordered is None:
                return
            ordered.told_to_stop = True
            if ordered.sent:
                self._link.say("cancel", token=ordered.order.token, number=number, grace_s=min(grace_s, FOREVER_S))
            else:
                self._end(ordered, Exited("stopped before it began", Cause.ENDED))

    def close(self) -> None:
        """See `Executor.close`."""
        if self._own:
            self._link.close()

    def hear(self, message: dict[str, Any]) -> None:
        """See `Listener.hear`."""
        with self._lock:
            ordered = self._ordered.get(message["number"])
            if ordered is None or ordered.order.token != message["token"]:
                return  # of an attempt that was overtaken
            if message["kind"] == "exited":
                self._end(ordered, exited_of(message["exited"]))
                return
        assert self._program.hear is not None
        for text in message["lines"]:
            word = self._program.hear(text.encode(errors="surrogateescape")).word
            if word is not None:
                self._mailbox.put(ordered.order.number, ordered.order.attempt, word)

    def lose(self) -> None:
        """See `Listener.lose`."""
        with self._lock:
            for ordered in list(self._ordered.values()):
                if ordered.sent:
                    cause = Cause.ENDED if ordered.told_to_stop else Cause.LOST
                    self._end(ordered, Exited("the cluster was lost", cause))

    def go_on(self) -> None:
        """See `Listener.go_on`."""
        with self._lock:
            for ordered in self._ordered.values():
                if not ordered.sent:
                    self._send(ordered)
        self._mailbox.wake()

    def _end(self, ordered: _Ordered, exited: Exited) -> None:
        del self._ordered[ordered.order.number]
        self._mailbox.put(ordered.order.number, ordered.order.attempt, exited)


def _finite(seconds: float) -> float | None:
    return None if math.isinf(seconds) else seconds
