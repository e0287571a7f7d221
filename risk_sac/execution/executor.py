"""The seam between the scheduler and the machines on which runs execute."""

import contextlib
import math
import queue
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from risk_sac.config import RunSpec
from risk_sac.execution.messages import Event, Heard, hear

FOLDER = "{folder}"  # argument that stands for the path of the run's folder
WORDS = "RISK_SAC_WORDS"
"""Variable that names the file descriptor to which a worker writes its words."""


class Cause(StrEnum):
    """Why a worker is gone."""

    ENDED = "ended"  # the worker sent its last message or was asked to stop
    KILLED = "killed"  # the kernel, for want of memory, or an operator killed it
    STOPPED = "stopped"  # it sent no heartbeat or finished nothing, and was killed for that
    CRASHED = "crashed"  # it ended by itself without a last message
    LOST = "lost"  # the whole cluster was lost, which says nothing about the run


@dataclass(frozen=True, slots=True)
class Exited:
    """Last message of an attempt; `reason` is None after an orderly end."""

    reason: str | None
    cause: Cause = Cause.ENDED
    status: int | None = None  # of its process, negative for a signal; None where there was none


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerProgram:
    """Settings of a worker's start and of its time limits.

    A worker gets its run as a line of JSON on its standard input. The end of that means that nothing reads its words.
    """

    arguments: tuple[str, ...]
    """For the Python interpreter."""
    log: str
    """File in the run's folder for what it prints."""
    hear: Callable[[bytes], Heard] = hear
    """Reads a line of its words; a ValueError refuses it."""
    environment: Mapping[str, str] = field(default_factory=dict)
    """Variables that it has besides those of its starter."""
    descriptors: tuple[int, ...] = ()
    """File descriptors that it inherits."""
    lease_s: float = math.inf
    """It is killed once it neither says anything nor uses its processor for so long, s."""
    stall_s: float = math.inf
    """It is killed once it finishes no episode for so long, s."""
    linger_s: float = math.inf
    """It is killed once it is still there so long after its last word, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterNode:
    """A machine of the cluster."""

    id: str  # Ray's; several nodes may share an address
    address: str
    alive: bool
    slots: int  # runs that it has room for
    silences: Mapping[int, float] = field(default_factory=dict)  # this server's run on it -> s since its last report

    @property
    def silent_s(self) -> float:
        """Time since the last report of any run; 0 without runs."""
        return min(self.silences.values(), default=0.0)


@dataclass(frozen=True, slots=True)
class ClusterState:
    """The machines of a cluster, as they were a few seconds ago."""

    nodes: tuple[ClusterNode, ...] = ()

    @property
    def slots(self) -> int:
        """Runs that it has room for."""
        return sum(node.slots for node in self.nodes if node.alive)


class Executor(Protocol):
    """Executes runs and reports their events; any thread may call it.

    A run is known by its number. It is submitted again only after its end was reported.
    """

    def submit(self, number: int, spec: RunSpec, folder: Path, slots: int) -> None:
        """Starts a run in `folder`, with at most `slots` rollout processes.

        Raises:
          OSError: it cannot be started.
        """

    def events(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        """Returns messages since the last call, by run; waits up to `timeout_s`.

        The last message of each run is `Exited`.
        """

    def cancel(self, number: int, grace_s: float) -> None:
        """Asks a run to stop, kills it after `grace_s`; ignores unknown runs.

        Of several calls the earliest deadline counts.
        """

    def silent_s(self, number: int) -> float | None:
        """Returns the time since the worker's last sign of life, else None."""

    def wake(self) -> None:
        """Lets a waiting `events` return early."""

    @property
    def slots(self) -> float:
        """Processes that play episodes, at least one per run; infinite if unknown."""

    @property
    def cluster(self) -> ClusterState | None:
        """Its machines; None if it has this one only."""

    def close(self) -> None:
        """Releases what it holds, once nothing is at work."""


Messages = queue.SimpleQueue[tuple[int, Event | Exited] | None]
"""By run, from the threads of an executor to the one that asks for `events`; None ends a wait."""


def taken(messages: Messages, timeout_s: float) -> list[tuple[int, Event | Exited]]:
    """Empties a queue of messages, waiting up to `timeout_s` for one."""
    batch = []
    with contextlib.suppress(queue.Empty):
        message = messages.get(timeout=timeout_s)
        while True:
            if message is not None:
                batch.append(message)
            message = messages.get_nowait()
    return batch


MakeExecutor = Callable[[WorkerProgram], Executor]
