"""Ray cluster for the tests: local processes, with a token."""

import contextlib
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

import psutil
import pytest

from tests.ports import free_port

needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed")

ROOT = Path(__file__).parents[1]
STORE_BYTES = 80_000_000
LONG_S = 300
GONE_S = 30
STARTED = b"Ray runtime started"  # and the head knows of it
# Nothing that a test does not need: each process of Ray that is started in advance takes a second of a processor.
FRUGAL = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_enable_metrics_collection": "false",
    "RAY_prestart_worker_first_driver": "false",
    "RAY_enable_worker_prestart": "false",
}


# Of a head: a cluster without dashboard and autoscaler.
HEAD_ALONE = ("--include-dashboard=false", "--no-monitor")


def wait_until(holds: Callable[[], object]) -> None:
    deadline = time.monotonic() + LONG_S
    while not holds():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.1)


class Cluster:
    """Nodes that share this machine; the first is the head.

    Attributes:
      environment: variables that its users need.
      nodes: what was started for each node, by its number.
    """

    def __init__(self, folder: Path, cpus: int, **environment: str) -> None:
        # Ray's sockets lie in there, whose paths must be short.
        self.temp = Path(tempfile.mkdtemp(prefix="rs", dir="/tmp"))
        self.port = free_port()
        self.cpus = cpus
        self.nodes: dict[int, psutil.Popen] = {}
        self.scratch = folder / "scratch"
        self._log = folder / "ray.log"
        paths = [str(ROOT), str(ROOT / "tests" / "integration"), os.environ.get("PYTHONPATH", "")]
        self.environment = {
            "RISK_SAC_EXECUTOR": "ray",
            "RISK_SAC_RAY_ADDRESS": f"127.0.0.1:{self.port}",
            "RISK_SAC_RAY_SCRATCH_DIR": str(self.scratch),
            "RISK_SAC_RAY_MEMORY_BYTES_PER_RUN": "0",
            "RAY_AUTH_MODE": "token",
            "RAY_AUTH_TOKEN": secrets.token_hex(16),
            "PYTHONPATH": os.pathsep.join(paths),
            "OMP_NUM_THREADS": "1",
            **FRUGAL,
            **environment,
        }

    def start(self, nodes: int) -> None:
        """The head, and then the others."""
        for number in range(nodes):
            self.add(number)

    def add(self, number: int, prefix: Sequence[str] = (), **environment: str) -> None:
        """Starts a node, 0 the head; `ray start --block` stays as parent.

        Args:
          number: of the node.
          prefix: a command that executes the one after it.
          environment: variables of its own.
        """
        where = (
            ["--head", f"--port={self.port}", *HEAD_ALONE, f"--temp-dir={self.temp}"]
            if number == 0
            else [f"--address=127.0.0.1:{self.port}"]
        )
        with self._log.open("ab") as log:
            before = log.tell()
            start = psutil.Popen(
                [*prefix, sys.executable, "-m", "ray.scripts.scripts", "start", *where, f"--num-cpus={self.cpus}",
                 f"--object-store-memory={STORE_BYTES}", "--include-log-monitor=false", "--disable-usage-stats",
                 "--block"],
                env=os.environ | self.environment | environment,
                stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True, cwd=ROOT,
            )  # fmt: skip
        self.nodes[number] = start
        deadline = time.monotonic() + LONG_S
        while STARTED not in (said := self._log.read_bytes()[before:]):
            assert start.poll() is None, said[-3000:].decode()
            assert time.monotonic() < deadline, said[-3000:].decode()
            time.sleep(0.1)

    def names(self, number: int) -> list[str]:
        """Of a node's processes."""
        return [name for _, name in self.processes(number)]

    def processes(self, number: int) -> list[tuple[psutil.Process, str]]:
        """Of a node, each with what it is called."""
        found = []
        for process in self.nodes[number].children(recursive=True):
            with contextlib.suppress(psutil.Error):
                command = process.cmdline()
                found.append((process, Path(command[0]).name if command else process.name()))
        return found

    def kill(self, number: int, *names: str, number_of_signal: int = signal.SIGKILL) -> int:
        """Signals a node's processes whose name begins so; how many."""
        victims = [each for each, name in self.processes(number) if any(name.startswith(part) for part in names)]
        for victim in victims:
            with contextlib.suppress(psutil.Error):
                victim.send_signal(number_of_signal)
        return len(victims)

    def end(self, number: int) -> None:
        """Kills a node with all that belongs to it."""
        start = self.nodes.pop(number)
        family = [start, *start.children(recursive=True)] if start.is_running() else [start]
        for each in family:
            with contextlib.suppress(psutil.Error):
                each.kill()
        start.wait(GONE_S)
        psutil.wait_procs(family, GONE_S)

    def close(self) -> None:
        for number in sorted(self.nodes, reverse=True):
            self.end(number)
        for process in self.left():
            with contextlib.suppress(psutil.Error):
                process.kill()
        shutil.rmtree(self.temp, ignore_errors=True)

    def left(self) -> list[psutil.Process]:
        """Returns the cluster's remaining processes, runs included, found by its token."""
        mark, found = self.environment["RAY_AUTH_TOKEN"], []
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error):
                if process.pid != os.getpid() and process.environ().get("RAY_AUTH_TOKEN") == mark:
                    found.append(process)
        return found


@contextlib.contextmanager
def running(folder: Path, nodes: int = 1, cpus: int = 2, **environment: str) -> Iterator[Cluster]:
    """Starts a cluster, with its users' environment in this process."""
    cluster = Cluster(folder, cpus, **environment)
    before = dict(os.environ)
    try:
        cluster.start(nodes)
        os.environ.update(cluster.environment)
        yield cluster
    finally:
        os.environ.clear()
        os.environ.update(before)
        cluster.close()
