"""Ray's actors for an attempt at a run.

One starts the worker and hands on its words and files; others play its episodes on other nodes. The worker is a
process of the local executor, so one that falls silent, lingers or dies is treated as on one machine. It works in a
folder of its node, which begins with the files of the run's folder on the server's machine.

A run of rounds has one rollout process beside its worker, and an actor for each further slot. Ray places the actors
where it has room. A thread of the first actor passes proposals to an actor; a lost one is replaced.
"""

import contextlib
import logging
import os
import pickle
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

import ray
from ray.exceptions import RayError, RayTaskError

from risk_sac.errors import SimulationError
from risk_sac.execution.executor import Exited
from risk_sac.execution.local import THREADS, LocalExecutor
from risk_sac.execution.messages import Event
from risk_sac.execution.ray import RaySettings
from risk_sac.execution.ray.node import Files, Order, Versions, check, signatures, write
from risk_sac.run_folder.durable import claim, scratch_name
from risk_sac.search.rollouts import ELSEWHERE, LOST, Rollouts

logger = logging.getLogger(__name__)

BEATS = 5  # reports within a lease
GATHER_S = 0.25  # messages within this time are sent together
GROWN_S = 2.0  # least time between two copies of files that only grow
GROWN_BYTES_PER_S = 1 << 20  # average rate that such copies may reach
LOOK_S = 1.0  # between two looks whether a rollout process is still wanted
AGAIN_S = 5.0  # until another actor is tried
END_S = 5.0  # for an actor to remove its folder


def resources(settings: RaySettings) -> dict[str, float]:
    """Returns what an actor takes of its node."""
    memory = {"memory": settings.ray_memory_bytes_per_run} if settings.ray_memory_bytes_per_run else {}
    return {"num_cpus": settings.ray_cpus_per_run, **memory}


class Attendant:
    """Ray's actor for one attempt; `cancel` may be called while `poll` waits."""

    def begin(self, order: Order, seed: Files, beside: Files, expected: Versions) -> str:
        """Starts the worker; returns Ray's name of this node.

        Raises:
          ConfigError: see `check`.
          OSError: the folder cannot be written.
        """
        check(order.scratch.parent, expected)
        self._scratch = order.scratch
        self._lock = claim(order.scratch)
        self._folder = order.scratch / order.folder.name
        self._folder.mkdir()
        write(self._folder, seed)
        write(order.scratch, beside)
        self._seen = signatures(self._folder)
        self._grown_due = 0.0
        self._elsewhere = RolloutRelays(order, beside, expected)
        with self._elsewhere.opened() as descriptors:
            named = {ELSEWHERE: " ".join(map(str, descriptors))}
            environment = order.environment(order.scratch) | named
            self._local = LocalExecutor(replace(order.program, environment=environment, descriptors=descriptors))
            self._local.submit(1, order.spec, self._folder, order.slots)
        return str(ray.get_runtime_context().get_node_id())

    def poll(self, wait_s: float) -> tuple[list[Event | Exited], Files]:
        """Returns new messages and files written before them; waits up to `wait_s`."""
        heard = self._local.events(wait_s)
        if heard and not isinstance(heard[-1][1], Exited):
            time.sleep(GATHER_S)
            heard += self._local.events(0)
        messages = [message for _, message in heard]
        ended = bool(messages) and isinstance(messages[-1], Exited)
        files = self._changed(ended)
        if ended:
            self._elsewhere.join()
            shutil.rmtree(self._scratch, ignore_errors=True)
        return messages, files

    def cancel(self, grace_s: float) -> None:
        """Tells the worker to stop."""
        self._local.cancel(1, grace_s)

    def _changed(self, final: bool) -> Files:
        """Returns new and replaced files, and at intervals those that only grew.

        It looks again after reading, so that a checkpoint comes with every file that was written before it.
        """
        grown = final or time.monotonic() >= self._grown_due
        content_by_path: dict[str, bytes] = {}
        size = 0
        while True:
            there, new = signatures(self._folder), []
            for name, signature in there.items():
                seen = self._seen.get(name)
                if signature != seen and (grown or seen is None or seen[0] != signature[0]):
                    new.append(name)
            for name in sorted(new, key=lambda name: there[name][2]):
                with contextlib.suppress(FileNotFoundError):  # replaced or removed just now
                    content_by_path.pop(name, None)
                    content_by_path[name] = (self._folder / name).read_bytes()
                    size += grown * len(content_by_path[name])
                self._seen[name] = there[name]
            if not new:
                return content_by_path
            if grown:
                self._grown_due = time.monotonic() + max(GROWN_S, size / GROWN_BYTES_PER_S)
                grown = False


class RolloutAttendant:
    """Ray's actor of one rollout process, which it restarts: see `Rollouts`."""

    def begin(self, order: Order, number: int, terms: bytes, beside: Files, expected: Versions) -> None:
        """Prepares the process of that number.

        Raises:
          ConfigError: see `check`.
          OSError: the folder cannot be written.
        """
        check(order.scratch.parent, expected)
        self._scratch = order.scratch.with_name(scratch_name())
        self._lock = claim(self._scratch)
        write(self._scratch, beside)
        os.environ.update(THREADS | order.environment(self._scratch))
        self._rollouts = Rollouts(pickle.loads(terms), self._scratch, 1, first=number)

    def play(self, proposal: bytes | None, wait_s: float) -> bytes | None:
        """Returns what was played of the latest proposal; None after `wait_s`."""
        if proposal is not None:
            self._proposal = pickle.loads(proposal)
            self._rollouts.submit(self._proposal)
        try:
            played = self._rollouts.wait_for(self._proposal.index, wait_s)
        except SimulationError as error:
            return pickle.dumps(error)
        return None if played is None else pickle.dumps(played)

    def end(self) -> None:
        """Ends the process and removes its folder."""
        self._rollouts.close()
        shutil.rmtree(self._scratch, ignore_errors=True)


class RolloutRelays:
    """Connections of a worker to rollout processes elsewhere, a thread for each."""

    def __init__(self, order: Order, beside: Files, expected: Versions) -> None:
        self._order, self._beside, self._expected = order, beside, expected
        self._threads: list[threading.Thread] = []

    @contextmanager
    def opened(self) -> Iterator[tuple[int, ...]]:
        """Opens a connection per slot but the first; yields the worker's ends."""
        ends = []
        for number in range(1, self._order.slots):
            own, other = Pipe()
            ends.append(other)
            self._threads.append(threading.Thread(target=self._relay, args=(number, own), daemon=True))
            self._threads[-1].start()
        try:
            yield tuple(end.fileno() for end in ends)
        finally:
            for end in ends:
                end.close()

    def join(self) -> None:
        """Waits until no process is left; they end with the worker."""
        until = time.monotonic() + END_S
        for thread in self._threads:
            thread.join(max(0.0, until - time.monotonic()))

    def _relay(self, number: int, worker: Connection) -> None:
        with contextlib.closing(worker), contextlib.suppress(*LOST):
            terms = worker.recv_bytes()
            while True:
                self._attend(number, terms, worker)

    def _attend(self, number: int, terms: bytes, worker: Connection) -> None:
        """Passes proposals to an actor until that is lost.

        Raises:
          EOFError: the worker needs none any more.
        """
        actor: Any = ray.remote(RolloutAttendant).options(**resources(self._order.settings)).remote()
        playing = False
        try:
            begun = actor.begin.remote(self._order, number, terms, self._beside, self._expected)
            while not ray.wait([begun], timeout=LOOK_S)[0]:
                _check_wanted(worker)
            ray.get(begun)
            worker.send(True)
            while True:
                proposal = worker.recv_bytes()
                playing = True
                worker.send_bytes(self._played(actor, proposal, worker))
                playing = False
        except RayError as error:
            why = error.cause if isinstance(error, RayTaskError) else type(error).__name__
            logger.warning("rollout process %d was lost: %s", number, why)
            if playing:
                worker.send(False)
            else:
                time.sleep(AGAIN_S)
                _check_wanted(worker)
        except LOST:
            with contextlib.suppress(RayError):
                ray.get(actor.end.remote(), timeout=END_S)
            raise
        finally:
            ray.kill(actor)

    def _played(self, actor: Any, proposal: bytes, worker: Connection) -> bytes:
        """Waits for an actor's episode; each report must come within the lease."""
        lease_s = self._order.settings.ray_lease_s
        wait_s = min(LOOK_S, lease_s / BEATS)
        asked: bytes | None = proposal
        while (played := ray.get(actor.play.remote(asked, wait_s), timeout=lease_s)) is None:
            asked = None
            _check_wanted(worker)
        return bytes(played)


def _check_wanted(worker: Connection) -> None:
    """Raises EOFError if a worker that says nothing meanwhile has gone."""
    if worker.poll():
        worker.recv_bytes()
