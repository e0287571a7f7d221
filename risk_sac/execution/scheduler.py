"""Starts waiting runs, passes on workers' messages, retries lost runs.

`risk-sac evaluate` and the service share it; each keeps its runs in a store of its own. Runs share slots: a slot is one
process that plays episodes. A run has as many from its start to its end, at least one.
"""

import logging
import math
import time
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from risk_sac.config import RunSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Cause, Executor, Exited
from risk_sac.execution.messages import EpisodeDone, Event, Failed, Finished, Started
from risk_sac.host.machine import rollout_limit
from risk_sac.records import State
from risk_sac.search.processes import most_processes

logger = logging.getLogger(__name__)

MOST_AT_ONCE = 500  # messages that are gathered


@dataclass(frozen=True, slots=True, kw_only=True)
class QueuedRun:
    """A run that may start."""

    number: int  # unique in its store
    spec: RunSpec
    folder: Path
    slots: int  # that it takes
    project: str = ""
    ids: Mapping[str, str] = field(default_factory=dict)  # of campaign and run, for the log


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotUse:
    """Slots that runs share, and those that each project has."""

    free: int
    taken: Mapping[str, int]  # by project
    most: float  # that one run may take

    def granted(self, spec: RunSpec, project: str = "", waiting: Collection[str] = ("",)) -> int:
        """Returns how many free slots a run takes, at least one.

        It takes all that it can use, but no more than its project's share: the projects with runs that wait or are at
        work share alike.

        Args:
          spec: the run.
          project: that it belongs to.
          waiting: projects with runs that wait, this one among them.
        """
        share = (self.free + sum(self.taken.values())) // len({project, *waiting, *self.taken})
        try:
            wanted = most_processes(spec)
        except ConfigError:  # its ego is gone; the worker says so
            wanted = 1
        return int(max(1, min(wanted, self.most, self.free, share - self.taken.get(project, 0))))


class RunStore(Protocol):
    """Store of runs, called in the scheduler's thread; only `start_next` may raise."""

    def start_next(self, use: SlotUse) -> QueuedRun | None:
        """Takes the next waiting run, grants it slots, and notes its start."""

    def not_started(self, run: QueuedRun, error: OSError) -> None:
        """Its worker could not be started."""

    def add_episodes(self, events: Sequence[tuple[int, EpisodeDone]]) -> set[int]:
        """Stores episodes, even repeated ones; returns runs that had a new one."""

    def ended(self, run: QueuedRun, state: State, reason: str | None = None, result: Finished | None = None) -> None:
        """Stores the end of a run: a result, a reason, or cancelled."""

    def requeued(self, run: QueuedRun, reason: str | None) -> None:
        """Notes that it waits again.

        `reason` says why its worker was lost; without one the scheduler stops.
        """

    def storage_refused(self, run: QueuedRun, reason: str) -> None:
        """Its worker has left because the disk refused."""


@dataclass(slots=True)
class Active:
    """A run whose worker lives."""

    run: QueuedRun
    cancelled: bool = False
    abandoned: bool = False  # what it still says is not wanted, since another worker will say it again
    last: Finished | Failed | None = None
    since: float = field(default_factory=time.time)


class Scheduler:
    """Scheduler that keeps runs at work until none waits.

    It is not safe for threads without a lock around it, but for `hear`.

    Attributes:
      active: runs whose workers live, by number.
      restarts: workers that were lost and replaced, by cause.
      stopping: whether no run starts any more.
    """

    def __init__(self, executor: Executor, store: RunStore, attempts: int) -> None:
        """Starts nothing yet.

        A run may lose `attempts` workers in a row without a new episode.

        Raises:
          ConfigError: RISK_SAC_ROLLOUTS is no positive integer.
        """
        self.active: dict[int, Active] = {}
        self.restarts: Counter[str] = Counter()
        self.stopping = False
        self._executor = executor
        self._store = store
        self._attempts = attempts
        self._most_slots = rollout_limit() or math.inf
        self._deaths: Counter[int] = Counter()

    def fill(self, most: float) -> None:
        """Starts waiting runs until `most` slots, or all of them, are taken."""
        while True:
            taken = Counter[str]()
            for active in self.active.values():
                taken[active.run.project] += active.run.slots
            free = int(min(most, self._executor.slots) - taken.total())
            use = SlotUse(free=free, taken=taken, most=self._most_slots)
            run = self._store.start_next(use) if free > 0 else None
            if run is None:
                return
            self.active[run.number] = Active(run)
            try:
                self._executor.submit(run.number, run.spec, run.folder, run.slots)
            except OSError as error:
                del self.active[run.number]
                self._store.not_started(run, error)

    def hear(self, timeout_s: float, gather_s: float = 0.0) -> list[tuple[int, Event | Exited]]:
        """Collects workers' messages, waiting up to `timeout_s`.

        Episodes are gathered, since one write of many costs less.
        """
        heard = more = self._executor.events(timeout_s)
        until = time.monotonic() + gather_s
        while more and all(isinstance(message, EpisodeDone) for _, message in more) and len(heard) < MOST_AT_ONCE:
            left_s = until - time.monotonic()
            more = self._executor.events(left_s) if left_s > 0.0 else []
            heard = heard + more
        return heard

    def take_in(self, heard: Sequence[tuple[int, Event | Exited]]) -> None:
        """Acts on messages in order, storing consecutive episodes in one batch."""
        episodes: list[tuple[int, EpisodeDone]] = []
        for number, message in heard:
            if isinstance(message, EpisodeDone):
                episodes.append((number, message))
                continue
            self._add_episodes(episodes)
            episodes = []
            active = self.active[number]
            if isinstance(message, Exited):
                del self.active[number]
                self._end(active, message)
            elif isinstance(message, Started):
                logger.info("process %d", message.pid, extra=active.run.ids)
            else:
                active.last = message
        self._add_episodes(episodes)

    def cancel(self, number: int, grace_s: float) -> None:
        """Cancels a run if it is at work."""
        if number in self.active:
            self.active[number].cancelled = True
            self._executor.cancel(number, grace_s)

    def stop(self, grace_s: float) -> None:
        """Starts no more runs, and stops those at work after their episode."""
        self.stopping = True
        for number in self.active:
            self._executor.cancel(number, grace_s)

    def abandon(self, grace_s: float) -> None:
        """Stops the runs at work and leaves their states to the store."""
        for number, active in self.active.items():
            active.abandoned = True
            self._executor.cancel(number, grace_s)

    def _add_episodes(self, told: Sequence[tuple[int, EpisodeDone]]) -> None:
        wanted = [(number, event) for number, event in told if not self.active[number].abandoned]
        for number in self._store.add_episodes(wanted) if wanted else ():
            self._deaths.pop(number, None)

    def _end(self, active: Active, exited: Exited) -> None:
        """Stores a run's end; the worker's last message outweighs its exit status."""
        run, last = active.run, active.last
        if active.abandoned:
            return
        if active.last is not None or active.cancelled:
            self._deaths.pop(run.number, None)
        if isinstance(last, Finished) and last.finished:
            self._store.ended(run, State.SUCCEEDED, result=last)
        elif isinstance(last, Failed) and last.storage:
            self._store.storage_refused(run, last.reason)
        elif isinstance(last, Failed):
            self._store.ended(run, State.FAILED, last.reason)
        elif active.cancelled:
            self._store.ended(run, State.CANCELLED)
        elif self.stopping:
            self._store.requeued(run, None)
        elif isinstance(last, Finished):
            self._replace(run, Exited("worker was stopped from outside", Cause.KILLED))
        else:
            self._replace(run, exited)

    def _replace(self, run: QueuedRun, exited: Exited) -> None:
        """Requeues a run that lost its worker, or fails it after `attempts`."""
        reason = exited.reason or "worker stopped before its run was done"
        self._deaths[run.number] += exited.cause is not Cause.LOST  # which is nothing that the run has done
        self.restarts[exited.cause] += 1
        deaths = self._deaths[run.number]
        logger.warning("%s; attempt %d", reason, deaths, extra=run.ids)
        if deaths < self._attempts:
            self._store.requeued(run, f"{reason}; goes on from its checkpoint")
        else:
            del self._deaths[run.number]
            self._store.ended(run, State.FAILED, f"{reason}; {deaths} workers in a row finished no episode")
