"""Processes that play a run's episodes in parallel, one simulation each.

    python -m risk_sac.search.rollouts CONNECTION FOLDER NUMBER

is such a process: it reads its terms and then proposals from the connection, and writes what was played. Processes of a
run are numbered from 0; each plays against the remote ego's server of its number.

Some of them may be elsewhere. Then the starter of the run has opened a connection for each, listed in
`RISK_SAC_ROLLOUTS_ELSEWHERE`. Terms and proposals go into it; out of it come True once there is a process, what was
played, and False if the process was lost with its proposal.
"""

import logging
import os
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import NamedTuple, Self

from risk_sac.config import RunMethod, RunSpec, method_of
from risk_sac.env.env import RiskSacEnv
from risk_sac.errors import RiskSacError, SimulationError
from risk_sac.host.machine import limit_memory, memory_limit_bytes, out_of_memory
from risk_sac.host.process_state import collect_seldom
from risk_sac.risk.reward import TrainingReward
from risk_sac.run_folder.crash_guard import PATIENCE, CrashGuard
from risk_sac.search.agents.controls import ScriptFollower, control
from risk_sac.search.agents.snapshot import SnapshotActor
from risk_sac.search.playing import GuardedEnv, PlayedEpisode, Proposal, play
from risk_sac.search.prior.attacker import AttackerView
from risk_sac.search.prior.policy import starts_pretrained

logger = logging.getLogger(__name__)

LOST = (EOFError, ConnectionResetError, BrokenPipeError)  # errors of a connection whose other end has died
ELSEWHERE = "RISK_SAC_ROLLOUTS_ELSEWHERE"
"""Variable that lists the descriptors of connections to processes that others start."""


class Terms(NamedTuple):
    """First message to a process."""

    spec: str  # JSON
    niceness: int
    memory_bytes: int | None  # that it may take

    @classmethod
    def of(cls, spec: RunSpec) -> Self:
        """Returns those of the process that calls this."""
        return cls(spec.model_dump_json(), os.nice(0), memory_limit_bytes())


@dataclass(slots=True)
class RolloutProcess:
    """A process, and the proposal that it plays."""

    number: int
    process: subprocess.Popen[bytes] | None  # None: it is elsewhere
    connection: Connection
    there: bool = True
    playing: Proposal | None = None
    deaths: int = 0  # since its last episode


class Rollouts:
    """Player of proposals in processes; replays an episode whose process died.

    A thread receives what was played and sends what waits, so that no process idles while a learner learns.
    """

    def __init__(
        self, terms: Terms, folder: Path, most: int, *, first: int = 0, elsewhere: Sequence[Connection] = ()
    ) -> None:
        """Starts no process yet.

        Args:
          terms: of all processes.
          folder: each process here gets a folder in it, for what its crash guard notes.
          most: number of processes here.
          first: number of the first.
          elsewhere: connections to others, numbered from `first + most`; they take part once they are there.
        """
        self._terms, self._folder, self._most, self._first = terms, folder, most, first
        self._processes = [RolloutProcess(first + most + k, None, one, there=False) for k, one in enumerate(elsewhere)]
        for one in elsewhere:
            one.send(terms)
        self._waiting: deque[Proposal] = deque()
        self._played: dict[int, PlayedEpisode] = {}
        self._changed, self._closing = threading.Condition(), False
        self._failure: Exception | None = None
        self._woken, self._wakes = Pipe(duplex=False)
        self._thread = threading.Thread(target=self._exchange, daemon=True)
        self._thread.start()

    def submit(self, proposal: Proposal) -> None:
        """Lets a process play a proposal, once one is free."""
        self._waiting.append(proposal)
        self._wakes.send_bytes(b"")

    def wait_for(self, index: int, at_most_s: float) -> PlayedEpisode | None:
        """Waits for an episode; returns None if unplayed after `at_most_s`.

        Raises:
          SimulationError: a process failed, or died again and again.
        """
        with self._changed:
            self._changed.wait_for(lambda: index in self._played or self._failure is not None, at_most_s)
            if self._failure is not None:
                raise self._failure
            return self._played.pop(index, None)

    def close(self) -> None:
        """Ends the processes; what they play is lost."""
        self._closing = True
        self._wakes.close()
        for one in [*self._processes]:
            if one.process is not None:
                one.process.kill()  # the thread may be sending to it
        self._thread.join()
        self._woken.close()
        for one in self._processes:
            one.connection.close()
            if one.process is not None:
                one.process.kill()
                one.process.wait()
        self._processes.clear()

    def _exchange(self) -> None:
        """Receives and sends until `close`, or until a process fails."""
        try:
            while not self._closing:
                busy = {one.connection: one for one in self._processes if one.playing is not None or not one.there}
                for connection in wait([self._woken, *busy]):
                    if connection is self._woken:
                        self._woken.recv_bytes()
                    else:
                        self._receive(busy[connection])  # type: ignore[index]
                self._send()
        except EOFError:  # of `_woken`
            return
        except Exception as error:  # noqa: BLE001 - `wait_for` raises it
            with self._changed:
                self._failure = error
                self._changed.notify()

    def _send(self) -> None:
        """Gives what waits to processes without an episode."""
        while self._waiting and not self._closing:
            free = next((one for one in self._processes if one.there and one.playing is None), None)
            here = sum(one.process is not None for one in self._processes)
            if free is None and here < self._most:
                number = self._first + here
                free = RolloutProcess(number, *self._started(number))
                self._processes.append(free)
            if free is None:
                return
            free.playing = self._waiting.popleft()
            self._play(free)

    def _play(self, one: RolloutProcess) -> None:
        try:
            one.connection.send(one.playing)
        except LOST:
            self._restart(one)

    def _receive(self, one: RolloutProcess) -> None:
        try:
            answer = one.connection.recv()
        except LOST:
            self._restart(one)
            return
        if isinstance(answer, str):
            raise SimulationError(f"a rollout process failed: {answer}")
        if isinstance(answer, SimulationError):
            raise answer
        if isinstance(answer, bool):
            one.there = answer
            self._give_up(one)
            return
        assert one.playing is not None
        with self._changed:
            self._played[one.playing.index] = answer
            self._changed.notify()
        one.playing, one.deaths = None, 0

    def _give_up(self, one: RolloutProcess) -> None:
        """Lets the next free process play what a process elsewhere has lost."""
        if one.playing is not None:
            logger.warning("a process elsewhere was lost in episode %d, which is played again", one.playing.index)
            self._waiting.appendleft(one.playing)
            one.playing = None

    def _restart(self, one: RolloutProcess) -> None:
        """Restarts a process on the same episode; its guard skips crashing ones."""
        if self._closing:
            return
        if one.process is None:
            self._processes.remove(one)
            self._give_up(one)
            return
        assert one.playing is not None
        one.connection.close()
        status, one.deaths = one.process.wait(), one.deaths + 1
        if one.deaths > PATIENCE:
            raise SimulationError(f"rollout processes died {one.deaths} times in a row, the last with status {status}")
        logger.warning("a rollout process ended with status %d in episode %d", status, one.playing.index)
        one.process, one.connection = self._started(one.number)
        self._play(one)

    def _started(self, number: int) -> tuple[subprocess.Popen[bytes], Connection]:
        folder = self._folder / str(number)
        folder.mkdir(parents=True, exist_ok=True)
        own, other = Pipe()
        descriptor = other.fileno()
        command = [sys.executable, "-m", "risk_sac.search.rollouts", str(descriptor), str(folder), str(number)]
        process = subprocess.Popen(command, pass_fds=[descriptor], stdin=subprocess.DEVNULL)
        other.close()
        own.send(self._terms)
        return process, own


def processes_elsewhere() -> list[Connection]:
    """Takes the connections that the starter of this process has opened."""
    return [Connection(int(descriptor)) for descriptor in os.environ.pop(ELSEWHERE, "").split()]


def serve(connection: Connection, folder: Path, number: int) -> None:
    """Plays proposals as process `number` of a run until the connection closes."""
    terms: Terms = connection.recv()
    os.nice(max(0, terms.niceness - os.nice(0)))
    if terms.memory_bytes is not None:
        limit_memory(terms.memory_bytes)
    spec = RunSpec.model_validate_json(terms.spec)
    reward = TrainingReward(method_of(spec.method), spec.learner)
    with closing(RiskSacEnv.of(spec, ego_server=number)) as env, CrashGuard(folder) as guard:
        guarded = GuardedEnv(env, guard)
        view = AttackerView(env.problem) if starts_pretrained(spec, env.problem) else None
        while True:
            proposal: Proposal = connection.recv()
            guarded.begin(proposal.index)
            connection.send(played(guarded, proposal, spec.method, reward, view))


def played(
    guarded: GuardedEnv,
    proposal: Proposal,
    method: RunMethod,
    reward: TrainingReward,
    view: AttackerView | None = None,
) -> PlayedEpisode:
    """Plays a proposal; with a policy, the steps are for the learner. `view` is for a policy of one adversary."""
    family, actor = guarded.env.problem.family, None
    if proposal.policy is None:
        driver = control(method, family, proposal.seed)
        driver.begin(proposal.genes)
        return play(guarded, proposal, driver, driver, reward)
    learner = SnapshotActor(proposal.policy, proposal.seed, None if view is None else view.begin)
    if proposal.guided:
        actor = ScriptFollower(family)
        actor.begin(proposal.genes)
    episode = play(guarded, proposal, actor or learner, learner, reward)
    return replace(episode, transitions=learner.transitions)


def main() -> None:
    """Serves the process that has started this one."""
    collect_seldom()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the run decides what it does not play
    connection, folder, number = Connection(int(sys.argv[1])), Path(sys.argv[2]), int(sys.argv[3])
    try:
        serve(connection, folder, number)
    except LOST:
        return
    except RiskSacError as error:
        connection.send(str(error))
    except Exception as error:
        if not out_of_memory(error):
            raise
        most = memory_limit_bytes()
        may = "there is" if most is None else f"the {most / 2**30:.3g} GiB that each process of a run may take"
        remedy = "a machine with more of it" if most is None else "a larger RISK_SAC_WORKER_MEMORY_BYTES"
        connection.send(f"it needs more memory than {may}; wanted {remedy}")


if __name__ == "__main__":
    main()
