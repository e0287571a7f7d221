"""Runs an attempt on a node: an actor that starts the worker.

The actor hands on the worker's words and files.

The worker is a process of the local executor, so one that falls silent, lingers or dies is treated as on one machine.
It works in a folder of its node, which begins with the files of the run's folder on the server's machine.
"""

import contextlib
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from risk_sac.config import RunSpec
from risk_sac.egos.registry import installed
from risk_sac.errors import ConfigError
from risk_sac.execution.executor import Exited, WorkerProgram
from risk_sac.execution.local import LocalExecutor
from risk_sac.execution.messages import Event, without_folders
from risk_sac.execution.ray import ADDRESS, variable
from risk_sac.run_folder.durable import claim, replace_file

GATHER_S = 0.25  # messages within this time are sent together
GROWN_S = 2.0  # least time between two copies of files that only grow
GROWN_BYTES_PER_S = 1 << 20  # average rate that such copies may reach
Files = Mapping[str, bytes]  # by their paths in a folder, the oldest first
# What results depend on, besides Python and egos: the same on the server's machine and on all nodes.
PACKAGES = ("risk-sac", "ray", "libsumo", "torch", "botorch", "gpytorch", "rtamt", "numpy")
MISSING = "missing"

Versions = Mapping[str, str]


@dataclass(slots=True, kw_only=True)
class Order:
    """An attempt at a run."""

    number: int
    spec: RunSpec
    slots: int
    program: WorkerProgram
    folder: Path  # of the run, on the server's machine
    scratch: Path  # of this attempt and no other, on its node
    beside: Mapping[str, Path]  # what the worker reads beside the run's folder, by its path in `scratch`
    told_to_stop: bool = False

    @property
    def id(self) -> str:
        """Of this attempt and no other, of this server or an earlier one."""
        return self.scratch.name


class Attendant:
    """Ray's actor for one attempt; `cancel` may be called while `poll` waits."""

    def begin(self, order: Order, seed: Files, beside: Files, expected: Versions) -> str:
        """Starts the worker; returns Ray's name of this node.

        Raises:
          ConfigError: see `check`.
          OSError: the folder cannot be written.
        """
        import ray

        check(order.scratch.parent, expected)
        self._scratch = order.scratch
        self._lock = claim(order.scratch)
        self._folder = order.scratch / order.folder.name
        self._folder.mkdir()
        write(self._folder, seed)
        write(order.scratch, beside)
        self._seen = signatures(self._folder)
        self._grown_due = 0.0
        self._local = LocalExecutor(order.program)
        self._local.submit(1, order.spec, self._folder, order.slots)
        return str(ray.get_runtime_context().get_node_id())

    def poll(self, wait_s: float) -> tuple[list[Event | Exited], Files]:
        """Returns messages since the last call and files written before them, waiting up to `wait_s` for a message."""
        heard = self._local.events(wait_s)
        if heard and not isinstance(heard[-1][1], Exited):
            time.sleep(GATHER_S)
            heard += self._local.events(0)
        messages = [message for _, message in heard]
        ended = bool(messages) and isinstance(messages[-1], Exited)
        files = self._changed(ended)
        if ended:
            shutil.rmtree(self._scratch, ignore_errors=True)
        return messages, files

    def cancel(self, grace_s: float) -> None:
        """Tells the worker to stop."""
        self._local.cancel(1, grace_s)

    def _changed(self, final: bool) -> Files:
        """New and replaced files, and from time to time those that have only grown.

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


def check(scratch: Path, expected: Versions) -> None:
    """Checks this node's versions, and its folder for attempts.

    Raises:
      ConfigError: it has other versions than the server's machine, or cannot use the folder.
    """
    import ray

    node = f"node {ray.util.get_node_ip_address()}"
    if other := differing(versions(), expected):
        raise ConfigError(ADDRESS, f"on {node}: {other}")
    try:
        scratch.mkdir(parents=True, exist_ok=True, mode=0o700)
        tempfile.TemporaryFile(dir=scratch).close()
        if scratch.stat().st_uid != os.getuid():
            raise PermissionError("it belongs to another user")
    except OSError as error:
        got = f"{str(scratch)!r}, which {node} cannot write to ({without_folders(str(error))})"
        raise ConfigError(variable("ray_scratch_dir"), got, "a folder that every node makes for itself") from error


def signatures(folder: Path) -> dict[str, tuple[int, int, int]]:
    """Inode, size and time of each file of a folder, by its path in it."""
    signature_by_path = {}
    for parent, _, names in os.walk(folder):
        for name in names:
            path = Path(parent, name)
            if not name.endswith(".tmp") and name != ".lock":
                with contextlib.suppress(FileNotFoundError):
                    status = path.stat()
                    signature_by_path[str(path.relative_to(folder))] = status.st_ino, status.st_size, status.st_mtime_ns
    return signature_by_path


def read(folder: Path) -> Files:
    """All files of a folder that an attempt may read or write."""
    return {name: (folder / name).read_bytes() for name in signatures(folder)}


def write(folder: Path, files: Files) -> None:
    """Writes files, each whole or not at all."""
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, content)


def versions() -> Versions:
    """Of Python, of packages, and of the egos that are installed, on this machine."""
    version_by_name = {"python": ".".join(map(str, sys.version_info[:3]))}
    for name in PACKAGES:
        try:
            version_by_name[name] = version(name)
        except PackageNotFoundError:
            version_by_name[name] = MISSING
    return version_by_name | {f"the ego {name}": version for name, version in installed().items()}


def differing(actual: Versions, expected: Versions) -> str:
    """Lists the versions that differ from the server's machine, in words.

    Returns "" if none differs.

    An ego that is installed here alone is no difference: no campaign can name it.
    """
    other = [
        f"{name} is {actual.get(name, MISSING)}; wanted {wanted}"
        for name, wanted in expected.items()
        if actual.get(name, MISSING) != wanted
    ]
    return f"{', '.join(other)}, as on the server's machine" if other else ""
