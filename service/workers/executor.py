"""Where runs execute: the seam between the manager and whatever has processors."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from risk_sac.config import RunSpec
from service.workers.messages import Event


class Cause(StrEnum):
    """Why a worker is gone."""

    ENDED = "ended"  # it said its last word, or was told to stop
    KILLED = "killed"  # by somebody else: the kernel for want of memory, an operator
    STOPPED = "stopped"  # it gave no sign of life or finished nothing, and was killed for that
    CRASHED = "crashed"  # by itself, without a last word


@dataclass(frozen=True, slots=True)
class Exited:
    """The last message about a run: its worker is gone. `reason` says why, unless it ended in order."""

    reason: str | None
    cause: Cause = Cause.ENDED


class Executor(Protocol):
    """Executes runs elsewhere and tells what becomes of them."""

    def submit(self, number: int, spec: RunSpec, folder: Path) -> None:
        """Start a run; its files go to `folder`.

        Raises:
          OSError: it cannot be started.
        """

    def events(self, timeout_s: float) -> list[tuple[int, Event | Exited]]:
        """What happened since the last call, waiting up to `timeout_s` for something.

        The last message of every submitted run is `Exited`.
        """

    def cancel(self, number: int, grace_s: float) -> None:
        """Ask a run to stop, and make it stop if it has not after `grace_s`; unknown runs are ignored.

        Of several calls the one with the earliest end counts.
        """

    def wake(self) -> None:
        """Let a waiting `events` return early."""
