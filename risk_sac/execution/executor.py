"""The seam between the scheduler and the machines on which runs execute."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Generic, Literal, Protocol, TypeVar, get_args

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError

Word = TypeVar("Word")  # what a worker may say
WORDS = "RISK_SAC_WORDS"
"""Variable that names the file descriptor to which a worker writes its words."""


class Cause(StrEnum):
    """Why a worker is gone."""

    ENDED = "ended"  # it said its last word or was asked to stop
    KILLED = "killed"  # by the kernel for want of memory, or by an operator
    STOPPED = "stopped"  # it gave no sign of life or finished nothing, and was killed for that
    CRASHED = "crashed"  # by itself, without a last word
    LOST = "lost"  # with the whole cluster that it ran on, which says nothing about the run


@dataclass(frozen=True, slots=True)
class Exited:
    """The last message about an attempt: its worker is gone. `reason` says why, unless it ended in order."""

    reason: str | None
    cause: Cause = Cause.ENDED
    status: int | None = None  # of its process, negative for a signal; None where there was none


@dataclass(frozen=True, slots=True)
class Heard(Generic[Word]):
    """A line of a worker, understood."""

    word: Word | None  # to be passed on; None for a mere sign of life
    progress: bool = False  # it has finished an episode
    last: bool = False  # it has no more to say, and is to leave


@dataclass(frozen=True, slots=True, kw_only=True)
class Program(Generic[Word]):
    """How a worker is started, what it says, and when it is killed."""

    arguments: Callable[[RunSpec, Path], Sequence[str]]
    """For the Python interpreter, given a run and its folder."""
    log: str
    """File in the run's folder for what it prints."""
    hear: Callable[[bytes], Heard[Word]]
    """Reads a line of the worker's words; a ValueError refuses it. A worker gets its run as a line of JSON on its
    standard input, whose end tells it that its words are not read any more."""
    environment: Mapping[str, str] = field(default_factory=dict)
    """Variables that it has besides those of its starter."""
    lease_s: float = math.inf
    """It is killed once it neither says anything nor uses its processor for so long, s."""
    stall_s: float = math.inf
    """It is killed once it finishes no episode for so long, s."""
    linger_s: float = math.inf
    """It is killed once it is still there so long after its last word, s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A machine of the cluster."""

    id: str  # Ray's; several nodes may share an address
    address: str
    alive: bool
    slots: int  # runs that it has room for
    runs: int = 0  # of this server's, at work on it
    silent_s: float = 0.0  # since the last report of any of them; 0 without any


@dataclass(frozen=True, slots=True)
class Cluster:
    """The machines of a cluster, as they were a few seconds ago."""

    nodes: tuple[Node, ...] = ()

    @property
    def slots(self) -> int:
        """Runs that it has room for."""
        return sum(node.slots for node in self.nodes if node.alive)


class Executor(Protocol[Word]):
    """Executes attempts at runs and reports what becomes of them; any thread may call it.

    A run has a number. Each attempt at it has a higher number than the one before. Messages of all but the latest
    attempt are dropped, their ends too.
    """

    def submit(self, number: int, attempt: int, spec: RunSpec, folder: Path) -> None:
        """Starts an attempt at a run, whose files go to `folder`; kills an older attempt.

        Raises:
          OSError: it cannot be started.
          ValueError: the run has had this attempt or a later one.
        """

    def events(self, timeout_s: float) -> list[tuple[int, Word | Exited]]:
        """Returns messages since the last call, by run, waiting up to `timeout_s` for one.

        The last message of each latest attempt is `Exited`.
        """

    def cancel(self, number: int, grace_s: float) -> None:
        """Asks a run to stop, and kills it after `grace_s`; ignores unknown runs.

        Of several calls the earliest deadline counts.
        """

    def wake(self) -> None:
        """Lets a waiting `events` return early."""

    @property
    def slots(self) -> float:
        """Attempts that it has room for at present; infinite if it does not know."""

    @property
    def cluster(self) -> Cluster | None:
        """Its machines; None if it has this one only."""

    def close(self) -> None:
        """Releases what it holds, once nothing is at work."""


ExecutorName = Literal["local", "ray"]
MakeExecutor = Callable[[Program[Any]], Executor[Any]]


def executor_named(name: str) -> MakeExecutor:
    """Returns the factory of an executor.

    Raises:
      ConfigError: there is none of this name.
    """
    if name == "local":
        from risk_sac.execution.local import LocalExecutor  # here, since it imports this module

        return LocalExecutor
    if name == "ray":
        from risk_sac.execution.ray.executor import RayExecutor

        return RayExecutor
    raise ConfigError("RISK_SAC_EXECUTOR", f"{name!r}", f"one of {', '.join(get_args(ExecutorName))}")
