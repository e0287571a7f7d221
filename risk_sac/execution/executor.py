"""Where runs execute: the seam between the scheduler and the machines."""

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

    ENDED = "ended"  # it said its last word, or was told to stop
    KILLED = "killed"  # by somebody else: the kernel for want of memory, an operator
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
    """What a line of a worker's output comes to."""

    word: Word | None  # to be passed on; None for a mere sign of life
    progress: bool = False  # it has finished an episode
    last: bool = False  # it has no more to say, and is to leave


@dataclass(frozen=True, slots=True, kw_only=True)
class Program(Generic[Word]):
    """How a worker is started, what it says, and what patience it is met with."""

    arguments: Callable[[RunSpec, Path], Sequence[str]]
    """For the Python interpreter, given a run and its folder."""
    log: str
    """File in the run's folder for what it prints."""
    hear: Callable[[bytes], Heard[Word]]
    """Reads a line of the worker's words; a ValueError refuses it. A worker gets its run as a line of JSON on its
    standard input, whose end tells it that its words are not read any more."""
    environment: Mapping[str, str] = field(default_factory=dict)
    """Variables that it finds beside those of whoever starts it."""
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
    silent_s: float = 0.0  # since the last report of the one that was heard last; 0 without any


@dataclass(frozen=True, slots=True)
class Cluster:
    """What the cluster looks like, told every few seconds."""

    nodes: tuple[Node, ...] = ()

    @property
    def slots(self) -> int:
        """Runs that it has room for."""
        return sum(node.slots for node in self.nodes if node.alive)


class Executor(Protocol[Word]):
    """Executes attempts at runs elsewhere and tells what becomes of them; any thread may call it.

    A run is known by a number. Each attempt at it has a higher number than the one before, and only the latest is
    heard: what an older one still says, its end too, is dropped.
    """

    def submit(self, number: int, attempt: int, spec: RunSpec, folder: Path) -> None:
        """Start an attempt at a run, whose files go to `folder`; an older attempt that is still there is killed.

        Raises:
          OSError: it cannot be started.
          ValueError: the run has had this attempt or a later one.
        """

    def events(self, timeout_s: float) -> list[tuple[int, Word | Exited]]:
        """What happened since the last call, by run, waiting up to `timeout_s` for something.

        The last message of every attempt that was not overtaken by another is `Exited`.
        """

    def cancel(self, number: int, grace_s: float) -> None:
        """Ask a run to stop, and make it stop if it has not after `grace_s`; unknown runs are ignored.

        Of several calls the one with the earliest end counts.
        """

    def wake(self) -> None:
        """Let a waiting `events` return early."""

    @property
    def slots(self) -> float:
        """How many attempts it has room for at present; infinite where whoever submits has to know."""

    @property
    def cluster(self) -> Cluster | None:
        """The machines that it has, as they were a few seconds ago; None if there is but this one."""

    def close(self) -> None:
        """Lets go of what it holds, when nothing is at work any more."""


ExecutorName = Literal["local", "ray"]
MakeExecutor = Callable[[Program[Any]], Executor[Any]]


def executor_named(name: str) -> MakeExecutor:
    """Returns what makes the executor of this name for one kind of worker.

    Raises:
      ConfigError: there is none of this name.
    """
    if name == "local":
        from risk_sac.execution.local import LocalExecutor

        return LocalExecutor
    if name == "ray":
        from risk_sac.execution.ray.executor import RayExecutor

        return RayExecutor
    raise ConfigError("RISK_SAC_EXECUTOR", f"{name!r}", f"one of {', '.join(get_args(ExecutorName))}")
